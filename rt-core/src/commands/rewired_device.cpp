#include "commands/rewired_device.hpp"

#include <utility>

namespace haptic::rt {
namespace {

/// Sends the code of string i on channel channels[i].
class RewiredBoard final : public device::Board {
  public:
    RewiredBoard(device::Board& board, const std::array<std::uint8_t, kStrings>& channels)
        : board_(&board), channels_(channels) {}

    void start() override { board_->start(); }
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override {
        return board_->exchange(rewired(command), reading, now_ns);
    }
    device::ExchangeStatus send(const device::MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override {
        return board_->send(rewired(command), now_ns);
    }
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return board_->answer_due(); }
    device::ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override { return board_->collect(now_ns); }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }
    [[nodiscard]] device::ZeroPacket zero_packet() const override { return board_->zero_packet(); }

  private:
    [[nodiscard]] device::MotorCommand rewired(const device::MotorCommand& command) const HAPTIC_RT {
        device::MotorCommand result;
        for (std::size_t i = 0; i < kStrings; ++i) {
            result.dac_codes[channels_[i]] = command.dac_codes[i];
        }
        return result;
    }

    device::Board* board_;
    std::array<std::uint8_t, kStrings> channels_;
};

class RewiredDevice final : public OpenedDevice {
  public:
    RewiredDevice(std::unique_ptr<OpenedDevice> opened, const std::array<std::uint8_t, kStrings>& channels)
        : opened_(std::move(opened)), board_(opened_->board(), channels) {}

    [[nodiscard]] device::Board& board() override { return board_; }
    [[nodiscard]] bool is_real() const override { return opened_->is_real(); }
    [[nodiscard]] std::string description() const override { return opened_->description(); }
    [[nodiscard]] PeriodDemand demand() const override { return opened_->demand(); }
    [[nodiscard]] std::int64_t exchange_bound_ns() const override { return opened_->exchange_bound_ns(); }
    void reopen() override { opened_->reopen(); }
    void attach(const Tick& tick) override { opened_->attach(tick); }
    [[nodiscard]] device::EmulatedDevice* emulated() override { return opened_->emulated(); }

  private:
    std::unique_ptr<OpenedDevice> opened_;
    RewiredBoard board_;
};

}  // namespace

std::unique_ptr<OpenedDevice> with_motor_channels(std::unique_ptr<OpenedDevice> opened,
                                                  const device::DeviceGeometry& geometry) {
    if (geometry.motor_channels == device::DeviceGeometry{}.motor_channels) {
        return opened;
    }
    return std::make_unique<RewiredDevice>(std::move(opened), geometry.motor_channels);
}

}  // namespace haptic::rt
