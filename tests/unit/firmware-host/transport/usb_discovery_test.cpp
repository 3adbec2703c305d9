#include "haptic/device/usb_discovery.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fake_usbfs.hpp"

namespace haptic::device {
namespace {

using test::kSh4;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::ResultOf;

constexpr UsbId kSimple{0x0cec, 0x0203};

auto at_port(const std::string& port) {
    return ResultOf([](const UsbDevice& device) { return device.port; }, port);
}

TEST(UsbId, IsWrittenAndReadAsLsusbDoes) {
    EXPECT_EQ(to_string(kSh4), "0cec:0205");
    EXPECT_EQ(parse_usb_id("0cec:0205"), kSh4);
    EXPECT_EQ(parse_usb_id("0CEC:0205"), kSh4);
    for (const char* wrong : {"", "0cec", "0cec:", "cec:205", "0cec:02050", "0x0c:0205", "0cec-0205", "0cec:02 5"}) {
        EXPECT_EQ(parse_usb_id(wrong), std::nullopt) << wrong;
    }
}

TEST(UsbId, IsKnownForTheBoardsThatAreDrivenOverUsb) {
    EXPECT_EQ(usb_id_of(BoardKind::Sh4), kSh4);
    EXPECT_EQ(usb_id_of(BoardKind::Simple), kSimple);
    EXPECT_EQ(usb_id_of(BoardKind::Uart), std::nullopt);
}

TEST(UsbDiscovery, FindsDevicesByIdPortAndNode) {
    test::FakeUsbfs bus;
    bus.plug({.port = "1-2", .number = 7});
    bus.plug({.port = "1-1.4", .number = 9});
    bus.plug({.port = "1-3", .number = 4, .id = kSimple});
    const std::vector<UsbDevice> all = list_usb_devices();
    EXPECT_THAT(all, ElementsAre(at_port("1-1.4"), at_port("1-2"), at_port("1-3")));
    EXPECT_THAT(candidates(all, {.id = kSh4}), ElementsAre(at_port("1-1.4"), at_port("1-2")));
    EXPECT_THAT(candidates(all, {.id = kSimple}), ElementsAre(at_port("1-3")));
    EXPECT_THAT(candidates(all, {.id = kSh4, .path = "1-2"}), ElementsAre(at_port("1-2")));
    EXPECT_THAT(candidates(all, {.id = kSh4, .path = "/dev/bus/usb/001/009"}), ElementsAre(at_port("1-1.4")));
    EXPECT_THAT(candidates(all, {.id = kSh4, .path = "1-3"}), IsEmpty()) << "another device is there";
    EXPECT_EQ(to_string(all.front()), "0cec:0205 at 1-1.4 (/dev/bus/usb/001/009)");
}

TEST(UsbDiscovery, SeesDevicesComeAndGo) {
    test::FakeUsbfs bus;
    EXPECT_THAT(list_usb_devices(), IsEmpty());
    test::FakeUsbBoard& board = bus.plug({});
    EXPECT_THAT(list_usb_devices(), ElementsAre(at_port("1-1")));
    bus.remove(board);
    EXPECT_THAT(list_usb_devices(), IsEmpty());
    bus.plug({.number = 3});
    EXPECT_THAT(list_usb_devices(), ElementsAre(at_port("1-1")));
}

TEST(UsbDiscovery, SaysWhatIsThereInsteadOfWhatWasLookedFor) {
    const UsbSelection selection{.id = kSh4, .path = "1-9"};
    const UsbDevice hub{{0x1d6b, 0x0002}, "usb1", "/dev/bus/usb/001/001"};
    EXPECT_THAT(describe_absence({hub}, selection),
                AllOf(HasSubstr("no USB device 0cec:0205 at 1-9"),
                      HasSubstr("1d6b:0002 at usb1 (/dev/bus/usb/001/001)"), HasSubstr("device.usb_path")));
    EXPECT_THAT(describe_absence({}, selection),
                AllOf(HasSubstr("no USB device at all"), Not(HasSubstr("Connected devices"))));
}

}  // namespace
}  // namespace haptic::device
