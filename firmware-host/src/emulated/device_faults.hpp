// What goes wrong behind an emulated board: encoders that stand still or jump, strings that get longer, motors that no
// longer listen.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <haptic/device/fault.hpp>
#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>

namespace haptic::device {

class DeviceFaults {
  public:
    /// m/s, at which slack that ends is taken back, so that no string is torn.
    static constexpr double kTakenBack = 0.5;

    /// Keeps those that are of the device.
    explicit DeviceFaults(std::vector<Fault> faults);

    /// Moves on to a time on the faults' clock; negative before it runs.
    void advance(std::int64_t time_ns, std::int64_t passed_ns) HAPTIC_RT;
    /// Holds the encoders that have come to stand still since the last time.
    void hold(const std::array<std::uint32_t, kStrings>& counters) HAPTIC_RT;

    /// What the encoders say where they should say `counters`, modulo 2^32.
    [[nodiscard]] std::array<std::uint32_t, kStrings> counters(
        const std::array<std::uint32_t, kStrings>& counters) const HAPTIC_RT;
    /// m, by which the strings are longer.
    [[nodiscard]] const std::array<double, kStrings>& slack() const HAPTIC_RT { return slack_; }
    /// Motors that have no current.
    [[nodiscard]] const std::array<bool, kStrings>& dead() const HAPTIC_RT { return dead_; }
    [[nodiscard]] bool motors_frozen() const HAPTIC_RT { return motors_frozen_; }
    /// Whether the board then reads back what the motors have, rather than what it was sent.
    [[nodiscard]] bool echo_frozen() const HAPTIC_RT { return echo_frozen_; }

  private:
    std::vector<Fault> faults_;
    std::array<double, kStrings> slack_{};
    std::array<std::uint32_t, kStrings> added_{};  // counts
    std::array<std::uint32_t, kStrings> held_{};   // counters
    std::array<bool, kStrings> stuck_{};
    std::array<bool, kStrings> dead_{};
    std::array<bool, kStrings> holding_{};
    bool motors_frozen_ = false;
    bool echo_frozen_ = false;
};

}  // namespace haptic::device
