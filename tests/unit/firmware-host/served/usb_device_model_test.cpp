#include "served/usb_device_model.hpp"

#include <gtest/gtest.h>

#include "usbip_bytes.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::hex;

class UsbDevice : public testing::Test {
  protected:
    UsbDeviceModel::ControlResult ask(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                                      std::uint16_t length) {
        return model.control({type, request, value, index, length});
    }
    void expect_stall(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                      std::uint16_t length) {
        EXPECT_TRUE(ask(type, request, value, index, length).stalled)
            << std::hex << int{type} << ' ' << int{request} << ' ' << value << ' ' << index;
    }

    UsbDeviceModel model{usb_identity(BoardKind::Sh4)};
};

TEST(UsbSetupPacket, IsLittleEndian) {
    const SetupPacket setup = decode_setup(std::array<std::uint8_t, 8>{0x80, 6, 0x02, 0x03, 0x09, 0x04, 0xFF, 0x01});
    EXPECT_EQ(setup.request_type, 0x80);
    EXPECT_EQ(setup.request, 6);
    EXPECT_EQ(setup.value, 0x0302);
    EXPECT_EQ(setup.index, 0x0409);
    EXPECT_EQ(setup.length, 0x01FF);
}

TEST_F(UsbDevice, DescriptorIsOfUsb2WithTheBoardsIds) {
    EXPECT_EQ(ask(0x80, 6, 0x0100, 0, 64).data, hex("12 01 0002 ff 00 00 40 ec0c 0502 0100 01 02 03 01"));
    const UsbDeviceModel simple(usb_identity(BoardKind::Simple));
    EXPECT_EQ(simple.device_descriptor(), hex("12 01 0002 ff 00 00 40 ec0c 0302 0100 01 02 03 01"));
    EXPECT_THROW(static_cast<void>(usb_identity(BoardKind::Uart)), std::invalid_argument);
}

TEST_F(UsbDevice, ConfigurationHasOneInterfaceWithBulkOut02AndIn86Of512Bytes) {
    EXPECT_EQ(ask(0x80, 6, 0x0200, 0, 255).data, hex("09 02 2000 01 01 00 c0 32"
                                                     "09 04 00 00 02 ff 00 00 00"
                                                     "07 05 02 02 0002 00"
                                                     "07 05 86 02 0002 00"));
}

TEST_F(UsbDevice, AtFullSpeedItWouldHavePacketsOf64Bytes) {
    EXPECT_EQ(ask(0x80, 6, 0x0600, 0, 10).data, hex("0a 06 0002 ff 00 00 40 01 00"));
    EXPECT_EQ(ask(0x80, 6, 0x0700, 0, 255).data, hex("09 07 2000 01 01 00 c0 32"
                                                     "09 04 00 00 02 ff 00 00 00"
                                                     "07 05 02 02 4000 00"
                                                     "07 05 86 02 4000 00"));
}

TEST_F(UsbDevice, ConnectedAtFullSpeedItsConfigurationHasPacketsOf64BytesAndTheOtherSpeedsOf512) {
    UsbDeviceModel full(usb_identity(BoardKind::Sh4), UsbSpeed::Full);
    EXPECT_EQ(full.control({0x80, 6, 0x0200, 0, 255}).data, hex("09 02 2000 01 01 00 c0 32"
                                                                "09 04 00 00 02 ff 00 00 00"
                                                                "07 05 02 02 4000 00"
                                                                "07 05 86 02 4000 00"));
    EXPECT_EQ(full.control({0x80, 6, 0x0700, 0, 255}).data, hex("09 07 2000 01 01 00 c0 32"
                                                                "09 04 00 00 02 ff 00 00 00"
                                                                "07 05 02 02 0002 00"
                                                                "07 05 86 02 0002 00"));
}

TEST_F(UsbDevice, StringsAreUtf16InUsEnglish) {
    EXPECT_EQ(ask(0x80, 6, 0x0300, 0, 255).data, hex("04 03 0904"));
    EXPECT_EQ(ask(0x80, 6, 0x0303, 0x0409, 255).data, hex("12 03 6500 6d00 7500 6c00 6100 7400 6500 6400"));
    EXPECT_FALSE(ask(0x80, 6, 0x0301, 0x0409, 255).stalled);
    EXPECT_FALSE(ask(0x80, 6, 0x0302, 0x0409, 255).stalled);
    expect_stall(0x80, 6, 0x0304, 0x0409, 255);
    expect_stall(0x80, 6, 0x03EE, 0, 18);  // Windows requests it
}

TEST_F(UsbDevice, StringsTooLongForADescriptorAreCut) {
    const UsbDeviceModel wordy({.serial = std::string(300, 's')});
    EXPECT_EQ(wordy.string_descriptor(3).size(), 254u);
    EXPECT_EQ(wordy.string_descriptor(3)[0], std::byte{254});
}

TEST_F(UsbDevice, NothingIsLongerThanWasAskedFor) {
    EXPECT_EQ(ask(0x80, 6, 0x0100, 0, 8).data, hex("12 01 0002 ff 00 00 40"));
    EXPECT_EQ(ask(0x80, 6, 0x0200, 0, 9).data, hex("09 02 2000 01 01 00 c0 32"));
    EXPECT_TRUE(ask(0x80, 0, 0, 0, 0).data.empty());
}

TEST_F(UsbDevice, ConfigurationsAreZeroAndOne) {
    EXPECT_EQ(ask(0x80, 8, 0, 0, 1).data, hex("01"));
    EXPECT_TRUE(model.usable(0x02));
    EXPECT_TRUE(model.usable(0x86));
    EXPECT_FALSE(ask(0x00, 9, 0, 0, 0).stalled);
    EXPECT_EQ(ask(0x80, 8, 0, 0, 1).data, hex("00"));
    EXPECT_FALSE(model.usable(0x02));
    EXPECT_FALSE(model.usable(0x86));
    expect_stall(0x81, 10, 0, 0, 1);
    expect_stall(0x02, 1, 0, 0x86, 0);
    expect_stall(0x00, 9, 2, 0, 0);
    EXPECT_FALSE(ask(0x00, 9, 1, 0, 0).stalled);
    EXPECT_TRUE(model.usable(0x86));
}

TEST_F(UsbDevice, TheInterfaceHasOneSetting) {
    EXPECT_EQ(ask(0x81, 10, 0, 0, 1).data, hex("00"));
    EXPECT_FALSE(ask(0x01, 11, 0, 0, 0).stalled);
    expect_stall(0x01, 11, 1, 0, 0);
    expect_stall(0x01, 11, 0, 1, 0);
}

TEST_F(UsbDevice, SaysItsStatusAndThatItHasAPowerSupply) {
    EXPECT_EQ(ask(0x80, 0, 0, 0, 2).data, hex("01 00"));
    EXPECT_EQ(ask(0x81, 0, 0, 0, 2).data, hex("00 00"));
    EXPECT_EQ(ask(0x82, 0, 0, 0x86, 2).data, hex("00 00"));
    EXPECT_EQ(ask(0x82, 0, 0, 0x80, 2).data, hex("00 00"));
    expect_stall(0x82, 0, 0, 0x81, 2);
}

TEST_F(UsbDevice, AnEndpointIsHaltedAndClearedByItself) {
    EXPECT_FALSE(ask(0x02, 3, 0, 0x86, 0).stalled);
    EXPECT_EQ(ask(0x82, 0, 0, 0x86, 2).data, hex("01 00"));
    EXPECT_FALSE(model.usable(0x86));
    EXPECT_TRUE(model.usable(0x02));
    EXPECT_FALSE(ask(0x02, 1, 0, 0x86, 0).stalled);
    EXPECT_TRUE(model.usable(0x86));
    EXPECT_FALSE(ask(0x02, 3, 0, 0x02, 0).stalled);
    EXPECT_FALSE(model.usable(0x02));
    EXPECT_FALSE(ask(0x01, 11, 0, 0, 0).stalled);
    EXPECT_TRUE(model.usable(0x02)) << "a new setting clears halts";
    expect_stall(0x02, 3, 0, 0x81, 0);
    expect_stall(0x02, 3, 1, 0x86, 0);
}

TEST_F(UsbDevice, RequestsOfClassesAndVendorsAreStalled) {
    // A host loads firmware into the USB chip of these boards with 40 a0.
    expect_stall(0x40, 0xA0, 0xE600, 0, 1);
    expect_stall(0xC0, 0xA0, 0, 0, 1);
    expect_stall(0x21, 9, 0, 0, 0);
    expect_stall(0x03, 0, 0, 0, 0);
    expect_stall(0x80, 6, 0x2200, 0, 64);
    expect_stall(0x00, 3, 1, 0, 0);
}

}  // namespace
}  // namespace haptic::device
