// A hand that behaves as a person who uses a served board: it waits at the centre while the motors are slack or ramp
// up, begins to move some time after all strings have come taut, and takes the grip back when they go slack again.
//
// A driver calibrates between the two. A board sees its packets only, not what the driver has done with them, so "some
// time" has to be long enough for that.
#pragma once

#include <cstdint>

#include <haptic/device/emulated_device.hpp>
#include "emulated/firmware.hpp"
#include <haptic/realtime.hpp>

namespace haptic::device {

/// Stands before a firmware and watches what its packets do to the motors.
class HandKeeper final : public Firmware {
  public:
    /// Both must outlive the keeper. The device's hand is to wait (Settings::hand_waits). `delay_ns` counts from the
    /// first packet by which all motors carry the variant's minimum tension.
    HandKeeper(Firmware& firmware, EmulatedDevice& device, std::int64_t delay_ns)
        : firmware_(&firmware), device_(&device), delay_ns_(delay_ns) {}

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override {
        return firmware_->reply(in, now_ns);
    }
    [[nodiscard]] bool connected(std::int64_t now_ns) const HAPTIC_RT override { return firmware_->connected(now_ns); }

  private:
    enum class State : std::uint8_t { Slack, Taut, Moving };

    Firmware* firmware_;
    EmulatedDevice* device_;
    std::int64_t delay_ns_;
    std::int64_t taut_since_ns_ = 0;
    State state_ = State::Slack;
};

}  // namespace haptic::device
