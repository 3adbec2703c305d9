// Mechanical grip: integrates the grip's mechanics to the caller's time in steps of fixed length, along with the hand's
// track.
#pragma once

#include <array>
#include <cstdint>

#include "emulated/hand_motion.hpp"
#include "haptic/device/device_geometry.hpp"
#include "haptic/device/grip_mechanics.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// The steps lie on a time grid that starts at the first advance(). Between the last grid point and the caller's time
/// the state is extrapolated with its velocity. The result is bit-identical however the same time is divided into
/// advances.
class MechanicalGrip {
  public:
    /// Inputs from the last advance() to this one.
    struct Drive {
        std::array<double, kStrings> pull{};   // N, of the motors
        std::array<double, kStrings> slack{};  // m
        bool held = false;                     // the grip is held rigidly
    };

    /// Limit of the steps of one advance(): 50 ms of time or less, about 0.3 ms of work. If a longer interval passed
    /// (the host was suspended), the hand first carries grip and strings along for the excess; a free grip waits.
    static constexpr std::int64_t kMaxSteps = 1000;

    /// Starts at rest. Throws std::invalid_argument for invalid mechanics, or if they are too stiff for steps of 5 us.
    MechanicalGrip(const DeviceGeometry& geometry, const GripMechanics& mechanics, const Pose& start);

    /// `hand` must already be at now_ns. Bounded by kMaxSteps. Time that goes backwards has no effect.
    void advance(std::int64_t now_ns, const Drive& drive, const HandMotion& hand) HAPTIC_RT;

    /// A hand pulls this length of a string off its motor's pulley, m.
    void pay_out(std::size_t string, double metres) HAPTIC_RT;

    /// State at the last advance().
    [[nodiscard]] const GripState& state() const HAPTIC_RT { return now_; }
    [[nodiscard]] const GripMechanics& mechanics() const HAPTIC_RT { return mechanics_; }
    /// Tensions that the strings carry, N.
    [[nodiscard]] std::array<double, kStrings> tensions(const std::array<double, kStrings>& slack) const HAPTIC_RT;
    /// Length of one step, ns: at most 50 us, a divisor of a millisecond.
    [[nodiscard]] std::int64_t step_ns() const HAPTIC_RT { return step_ns_; }

  private:
    void carry_over(std::int64_t gap_ns, std::int64_t now_ns, const Drive& drive, const HandMotion& hand) HAPTIC_RT;
    void extrapolate(double time_s) HAPTIC_RT;

    DeviceGeometry geometry_;
    GripMechanics mechanics_;
    GripState grid_;  // at grid_ns_
    GripState now_;   // at the last advance
    Pose target_;     // of the hand, at grid_ns_
    std::int64_t step_ns_;
    std::int64_t grid_ns_ = 0;
    bool started_ = false;
};

}  // namespace haptic::device
