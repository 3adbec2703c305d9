// Which string contradicts the others, and whether it is slack.
//
// Eight lengths determine six coordinates, so two of them are redundant, and seven still determine the pose with one
// length to spare. Once the eight contradict each other, the pose is solved eight times more, each time without one of
// the strings: without the one at fault the other seven agree, whatever its error (as long as it is the only one), and
// what it reads beyond the length that they explain is that error.
//
// One spare length tells strings apart only as far as they pull in different ways: in frames as symmetrical as these
// most strings have, near the centre, one to three others without which the rest agree as well. So what is named is a
// set. It narrows as the hand moves: the string at fault goes on explaining the contradiction and its likes do not, so
// what each string leaves unexplained is summed up over the last ticks.
//
// A string that reads longer than the others explain is slack: its motor has paid out, or has not yet wound in, more
// than the distance from pulley to knot. One that reads shorter (it broke and was wound in, it slipped, its encoder
// stands still while it pays out) is a contradiction like any other.
#pragma once

#include <array>
#include <cstdint>

#include <haptic/realtime.hpp>
#include "device/kinematics.hpp"

namespace haptic::rt {

struct StringMonitorSettings {
    double residual = 1e-3;      // m, rms of measured minus explained lengths; below it no string is named
    double memory_ticks = 50.0;  // over which evidence is summed up
};

struct StringSuspicion {
    std::uint8_t strings = 0;  // bit i: without string i the others agree, as well as without any other; 0: all agree
    std::uint8_t slack = 0;    // those of them that read longer than the others explain
    double error = 0.0;        // m, measured minus explained, of the likeliest of them
};

class StringMonitor {
  public:
    /// Throws std::invalid_argument for settings that are not positive and finite, and like PoseSolver.
    StringMonitor(const device::Variant& variant, const StringMonitorSettings& settings);

    /// Takes one tick's lengths and the pose that explains all eight best. While they agree it costs nothing; else at
    /// most eight solutions of the pose.
    const StringSuspicion& update(const StringArray& lengths, const PoseEstimate& estimate) HAPTIC_RT;
    void reset(const Pose& pose) HAPTIC_RT;
    [[nodiscard]] const StringSuspicion& suspicion() const HAPTIC_RT { return suspicion_; }

  private:
    void judge(const std::array<double, kStrings>& errors) HAPTIC_RT;

    PoseSolver solver_;
    double residual_;
    double kept_;                                 // share of the evidence that the next tick keeps
    std::array<PoseEstimate, kStrings> without_;  // poses without each string; the last good one while all agree
    StringArray unexplained_{};                   // m^2, without each string
    double left_ = 0.0;                           // m^2, by all eight
    StringSuspicion suspicion_;
};

}  // namespace haptic::rt
