// Hand keeper: makes the hand of a served board behave like a user. It waits at the centre while the motors are slack
// or ramp up, starts to move some time after all strings are taut, and returns when they become slack again.
//
// A driver calibrates while the hand waits. A board only sees its packets and not the state of the driver, so the delay
// must be long enough for the calibration.
#pragma once

#include <cstdint>

#include "emulated/firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// Decorator of a firmware that observes the effect of its packets on the motors.
class HandKeeper final : public Firmware {
  public:
    /// Both must outlive the keeper. The device's Settings::hand_waits must be set. `delay_ns` counts from the first
    /// packet after which all motors carry the geometry's minimum tension.
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
