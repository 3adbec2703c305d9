#include "commands/rewired_device.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <string>

#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_board.hpp"

namespace haptic::rt {
namespace {

/// An emulated board that names a packet of zeros, as a real one does.
class BoardWithPacket final : public device::Board {
  public:
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override {
        return emulated.exchange(command, reading, now_ns);
    }
    device::ExchangeStatus send(const device::MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override {
        return emulated.send(command, now_ns);
    }
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return emulated.answer_due(); }
    device::ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override { return emulated.collect(now_ns); }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { emulated.zero_motors(now_ns); }
    [[nodiscard]] device::ZeroPacket zero_packet() const override {
        device::ZeroPacket zero;
        zero.set_packet(packet);
        return zero;
    }

    std::array<std::byte, 3> packet{std::byte{1}, std::byte{2}, std::byte{3}};
    device::EmulatedBoard emulated{{.geometry = device::spidar_g6_x3r()}};
};

class DeviceWithPacket final : public OpenedDevice {
  public:
    explicit DeviceWithPacket(BoardWithPacket& board) : board_(&board) {}
    [[nodiscard]] device::Board& board() override { return *board_; }
    [[nodiscard]] bool is_real() const override { return true; }
    [[nodiscard]] std::string description() const override { return "a device"; }
    [[nodiscard]] PeriodDemand demand() const override { return {.route = Route::Usb}; }

  private:
    BoardWithPacket* board_;
};

TEST(RewiredDevice, PassesEverythingOnButTheOrderOfItsMotors) {
    device::DeviceGeometry geometry = device::spidar_g6_x3r();
    std::swap(geometry.motor_channels[0], geometry.motor_channels[5]);
    BoardWithPacket original;
    const auto device = with_motor_channels(std::make_unique<DeviceWithPacket>(original), geometry);
    device::MotorCommand command;
    command.dac_codes = {10, 11, 12, 13, 14, 15, 16, 17};
    // A command that is only sent, and its answer.
    ASSERT_EQ(device->board().send(command, 0), device::ExchangeStatus::Ok);
    EXPECT_EQ(original.emulated.device().dac_codes(),
              (std::array<std::int16_t, kStrings>{15, 11, 12, 13, 14, 10, 16, 17}));
    EXPECT_TRUE(device->board().answer_due());
    EXPECT_EQ(device->board().collect(0), device::ExchangeStatus::Ok);
    EXPECT_FALSE(device->board().answer_due());
    // What the guard sends, and what the budget is made of.
    EXPECT_TRUE(std::ranges::equal(device->board().zero_packet().packet(), original.packet));
    EXPECT_EQ(device->demand().route, Route::Usb);
}

}  // namespace
}  // namespace haptic::rt
