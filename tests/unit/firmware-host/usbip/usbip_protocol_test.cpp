#include "usbip/usbip_protocol.hpp"

#include <gtest/gtest.h>

#include "usbip_bytes.hpp"

namespace haptic::device::usbip {
namespace {

using test::Bytes;
using test::hex;
using test::joined;
using test::words;
using test::zeros;

DeviceRecord sh4_record() {
    return {.path = "/sys/x",
            .bus_id = "1-1",
            .bus = 1,
            .address = 2,
            .speed = 3,
            .vendor = 0x0CEC,
            .product = 0x0205,
            .release = 0x0100,
            .device_class = 0xFF,
            .device_subclass = 1,
            .device_protocol = 2,
            .configuration = 1,
            .configurations = 1};
}

Bytes sh4_record_bytes() {
    return joined({hex("2f7379732f78"), zeros(250),                   // path
                   hex("312d31"), zeros(29),                          // bus id
                   hex("00000001 00000002 00000003 0cec 0205 0100"),  // bus, address, speed, ids, release
                   hex("ff 01 02 01 01 01")});                        // classes, configuration, counts
}

TEST(UsbipProtocol, DeviceListIsThePublishedLayout) {
    Bytes stream;
    const InterfaceRecord interface{0xFF, 0x03, 0x04};
    append_device_list(stream, std::vector{sh4_record()}, std::vector{interface});
    EXPECT_EQ(stream, joined({hex("0111 0005 00000000 00000001"), sh4_record_bytes(), hex("ff 03 04 00")}));
}

TEST(UsbipProtocol, EmptyDeviceListHasACountOfZero) {
    Bytes stream;
    append_device_list(stream, {}, {});
    EXPECT_EQ(stream, hex("0111 0005 00000000 00000000"));
}

TEST(UsbipProtocol, ImportIsTheRecordWithoutInterfacesOrAStatusAlone) {
    Bytes accepted;
    append_import(accepted, OperationStatus::Ok, sh4_record(), 1);
    EXPECT_EQ(accepted, joined({hex("0111 0003 00000000"), sh4_record_bytes()}));
    Bytes busy;
    append_import(busy, OperationStatus::Busy, sh4_record(), 1);
    EXPECT_EQ(busy, hex("0111 0003 00000002"));
}

TEST(UsbipProtocol, TextsTooLongForTheirFieldsAreCutWithAZeroBehindThem) {
    DeviceRecord record = sh4_record();
    record.path = std::string(300, 'p');
    record.bus_id = std::string(40, 'b');
    Bytes stream;
    append_import(stream, OperationStatus::Ok, record, 1);
    ASSERT_EQ(stream.size(), 8 + kDeviceBytes);
    EXPECT_EQ(stream[8 + 254], std::byte{'p'});
    EXPECT_EQ(stream[8 + 255], std::byte{0});
    EXPECT_EQ(stream[8 + 256 + 30], std::byte{'b'});
    EXPECT_EQ(stream[8 + 256 + 31], std::byte{0});
}

TEST(UsbipProtocol, OperationsAndBusIdsAreRead) {
    const Bytes request = test::import_request("3-1.4");
    const OperationHeader header = decode_operation(std::span(request).first<kOperationBytes>());
    EXPECT_EQ(header.version, 0x0111);
    EXPECT_EQ(header.code, kRequestImport);
    EXPECT_EQ(header.status, 0u);
    EXPECT_EQ(decode_bus_id(std::span(request).subspan<8, 32>()), "3-1.4");
    const Bytes unterminated(32, std::byte{'7'});
    EXPECT_EQ(decode_bus_id(std::span(unterminated).first<32>()), std::string(32, '7'));
}

std::variant<Submit, Unlink, Defect> decode(const Bytes& bytes) {
    return decode_urb(std::span(bytes).first<kUrbBytes>());
}

TEST(UsbipProtocol, SubmitIsReadWithAllThatItSays) {
    const auto message = decode(
        joined({words({1, 0x0D05, 0x0001000F, 1, 6, 0x200, 512, 7, 0xFFFFFFFF, 9}), hex("80 06 00 01 00 00 40 00")}));
    const auto& submit = std::get<Submit>(message);
    EXPECT_EQ(submit.sequence, 0x0D05u);
    EXPECT_EQ(submit.device, 0x0001000Fu);
    EXPECT_TRUE(submit.in);
    EXPECT_EQ(submit.endpoint, 6);
    EXPECT_EQ(submit.flags, 0x200u);
    EXPECT_EQ(submit.length, 512u);
    EXPECT_EQ(submit.packets_field, 0xFFFFFFFFu);
    EXPECT_EQ(submit.setup, (std::array<std::uint8_t, 8>{0x80, 6, 0, 1, 0, 0, 0x40, 0}));
}

TEST(UsbipProtocol, UnlinkNamesItsTarget) {
    const auto message = decode(test::unlink(12, 11));
    const auto& unlink = std::get<Unlink>(message);
    EXPECT_EQ(unlink.sequence, 12u);
    EXPECT_EQ(unlink.target, 11u);
    EXPECT_EQ(unlink.device, test::kDevice);
}

TEST(UsbipProtocol, HeadersThatCannotBeAreRefusedByName) {
    const struct {
        Bytes bytes;
        Defect defect;
    } cases[] = {
        {joined({words({0, 1, 2, 0, 2, 0, 0, 0, 0, 0}), zeros(8)}), Defect::Command},
        {joined({words({3, 1, 2, 0, 2, 0, 0, 0, 0, 0}), zeros(8)}), Defect::Command},
        {joined({words({1, 1, 2, 2, 2, 0, 0, 0, 0, 0}), zeros(8)}), Defect::Direction},
        {joined({words({1, 1, 2, 0, 16, 0, 0, 0, 0, 0}), zeros(8)}), Defect::Endpoint},
        {joined({words({1, 1, 2, 1, 6, 0, 65537, 0, 0, 0}), zeros(8)}), Defect::Length},
        {joined({words({1, 1, 2, 1, 6, 0, 0xFFFFFFFF, 0, 0, 0}), zeros(8)}), Defect::Length},
        {joined({words({1, 1, 2, 1, 6, 0, 512, 0, 3, 0}), zeros(8)}), Defect::Isochronous},
    };
    for (const auto& [bytes, defect] : cases) {
        const auto message = decode(bytes);
        ASSERT_TRUE(std::holds_alternative<Defect>(message)) << describe(defect);
        EXPECT_EQ(std::get<Defect>(message), defect) << describe(defect);
    }
    EXPECT_TRUE(std::holds_alternative<Submit>(decode(test::submit_in(1, 6, 65536))));
}

TEST(UsbipProtocol, RepliesAreThePublishedLayout) {
    const Submit submit{.sequence = 0x0D06, .in = true, .endpoint = 6, .length = 4, .packets_field = 0xFFFFFFFF};
    Bytes in;
    append_in_reply(in, submit, kOk, hex("de ad be ef"));
    EXPECT_EQ(in, joined({words({3, 0x0D06, 0, 0, 0, 0, 4, 0, 0xFFFFFFFF, 0}), zeros(8), hex("deadbeef")}));
    Bytes out;
    append_out_reply(out, {.sequence = 5, .endpoint = 2, .length = 512}, kOk, 512);
    EXPECT_EQ(out, joined({words({3, 5, 0, 0, 0, 0, 512, 0, 0, 0}), zeros(8)}));
    Bytes stalled;
    append_out_reply(stalled, {.sequence = 5, .endpoint = 2, .length = 512}, kStalled, 0);
    EXPECT_EQ(stalled, joined({words({3, 5, 0, 0, 0, 0xFFFFFFE0, 0, 0, 0, 0}), zeros(8)}));
    Bytes unlinked;
    append_unlink_reply(unlinked, {.sequence = 9, .target = 5}, kConnectionReset);
    EXPECT_EQ(unlinked, joined({words({4, 9, 0, 0, 0, 0xFFFFFF98}), zeros(24)}));
}

}  // namespace
}  // namespace haptic::device::usbip
