// The grip's mechanics moved on to the caller's time in steps of a fixed length, and the hand's track with them.
#pragma once

#include <array>
#include <cstdint>

#include <haptic/device/grip_mechanics.hpp>
#include "emulated/hand_motion.hpp"
#include <haptic/device/variant.hpp>
#include <haptic/realtime.hpp>

namespace haptic::device {

/// The steps lie on a grid that begins at the first advance(); between the grid and the caller's time the state is
/// carried on by its velocity. Whoever divides the same time into other advances gets the same bits.
class MechanicalGrip {
  public:
    /// What acts from the last advance() to this one.
    struct Drive {
        std::array<double, kStrings> pull{};   // N, of the motors
        std::array<double, kStrings> slack{};  // m
        bool held = false;                     // the grip is held rigidly
    };

    /// Steps that one advance() makes at most: 50 ms or less of time, about 0.3 ms of work. Before a longer interval
    /// (the host was away) the hand carries grip and strings along to where it is by then; a free grip waits.
    static constexpr std::int64_t kMostSteps = 1000;

    /// At rest at a pose. Throws std::invalid_argument for mechanics that cannot be, or are too stiff to be followed in
    /// steps of 5 us.
    MechanicalGrip(const Variant& variant, const GripMechanics& mechanics, const Pose& start);

    /// `hand` has already moved on to now. Bounded by kMostSteps. Time that goes backwards changes nothing.
    void advance(std::int64_t now_ns, const Drive& drive, const HandMotion& hand) HAPTIC_RT;

    /// At the time of the last advance().
    [[nodiscard]] const GripState& state() const HAPTIC_RT { return now_; }
    [[nodiscard]] const GripMechanics& mechanics() const HAPTIC_RT { return mechanics_; }
    /// N, what the strings carry.
    [[nodiscard]] std::array<double, kStrings> tensions(const std::array<double, kStrings>& slack) const HAPTIC_RT;
    /// ns, of one step: at most 50 us, a millisecond is a multiple of it.
    [[nodiscard]] std::int64_t step_ns() const HAPTIC_RT { return step_ns_; }

  private:
    void carry_over(std::int64_t gap_ns, std::int64_t now_ns, const Drive& drive, const HandMotion& hand) HAPTIC_RT;
    void extrapolate(double time_s) HAPTIC_RT;

    Variant variant_;
    GripMechanics mechanics_;
    GripState grid_;  // at grid_ns_
    GripState now_;   // at the last advance
    Pose target_;     // of the hand, at grid_ns_
    std::int64_t step_ns_;
    std::int64_t grid_ns_ = 0;
    bool started_ = false;
};

}  // namespace haptic::device
