#include "emulated/hand_keeper.hpp"

#include "haptic/device/dac_codes.hpp"

namespace haptic::device {
namespace {

/// Tension that the host believes to command for a string, N: a user does not see which motor is miswired.
double commanded_tension(const EmulatedDevice& device, std::size_t string) HAPTIC_RT {
    const DeviceGeometry& geometry = device.geometry();
    return tension_of_dac_code(device.dac_codes()[geometry.motor_channels[string]],
                               geometry.strings[string].newtons_per_code);
}

/// Whether every string has at least the DAC code of the minimum tension.
bool all_taut(const EmulatedDevice& device) HAPTIC_RT {
    const DeviceGeometry& geometry = device.geometry();
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double newtons_per_code = geometry.strings[i].newtons_per_code;
        const std::int16_t dac_code = dac_code_of_tension(geometry.minimum_tension, newtons_per_code);
        if (commanded_tension(device, i) < tension_of_dac_code(dac_code, newtons_per_code)) {
            return false;
        }
    }
    return true;
}

bool all_slack(const EmulatedDevice& device) HAPTIC_RT {
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (commanded_tension(device, i) > 0.0) {
            return false;
        }
    }
    return true;
}

}  // namespace

void HandKeeper::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    firmware_->receive(out, now_ns);
    // Slack -> Taut -> (after the delay) Moving -> Slack.
    switch (state_) {
        case State::Slack:
            if (all_taut(*device_)) {
                state_ = State::Taut;
                taut_since_ns_ = now_ns;
            }
            return;
        case State::Taut:
            if (!all_taut(*device_)) {
                state_ = State::Slack;
            } else if (now_ns - taut_since_ns_ >= delay_ns_) {
                state_ = State::Moving;
                device_->release_hand();
            }
            return;
        case State::Moving:
            if (all_slack(*device_)) {
                state_ = State::Slack;
                device_->hold_hand();
            }
            return;
    }
}

}  // namespace haptic::device
