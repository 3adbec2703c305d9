// Device faults: failures behind an emulated board, such as stuck or jumping encoders, strings that become longer, and
// motors that no longer respond.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "haptic/device/fault.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

class DeviceFaults {
  public:
    /// Rate at which the slack of a fault that ended is removed, m/s: slow enough that no string is torn.
    static constexpr double kSlackRemovalSpeed = 0.5;

    /// Keeps the device faults and ignores the packet faults.
    explicit DeviceFaults(std::vector<Fault> faults);

    /// Moves to a time on the fault clock, negative before it starts. `passed_ns` is the time since the last call.
    void advance(std::int64_t time_ns, std::int64_t passed_ns) HAPTIC_RT;
    /// Stores the counters of encoders that became stuck since the last call.
    void latch_stuck_encoders(const std::array<std::uint32_t, kStrings>& counters) HAPTIC_RT;

    /// Counters that the faulty encoders report for the true `counters`, modulo 2^32.
    [[nodiscard]] std::array<std::uint32_t, kStrings> counters(
        const std::array<std::uint32_t, kStrings>& counters) const HAPTIC_RT;
    /// Extra length of the strings, m.
    [[nodiscard]] const std::array<double, kStrings>& slack() const HAPTIC_RT { return slack_; }
    /// Motors without current.
    [[nodiscard]] const std::array<bool, kStrings>& dead() const HAPTIC_RT { return dead_; }
    [[nodiscard]] bool motors_frozen() const HAPTIC_RT { return motors_frozen_; }
    /// While the motors are frozen: whether the board echoes the frozen DAC codes rather than those it received.
    [[nodiscard]] bool echo_frozen() const HAPTIC_RT { return echo_frozen_; }

  private:
    std::vector<Fault> faults_;
    std::array<double, kStrings> slack_{};
    std::array<std::uint32_t, kStrings> offset_{};   // counts added by jumps
    std::array<std::uint32_t, kStrings> latched_{};  // counters of stuck encoders
    std::array<bool, kStrings> stuck_{};             // a fault is active
    std::array<bool, kStrings> dead_{};
    std::array<bool, kStrings> has_latched_{};  // latched_ is valid
    bool motors_frozen_ = false;
    bool echo_frozen_ = false;
};

}  // namespace haptic::device
