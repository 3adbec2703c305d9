// String monitor: finds the string whose measured length contradicts the other seven, and whether it is slack.
//
// Eight lengths determine six coordinates, so two lengths are redundant; seven lengths still leave one. When the eight
// lengths contradict each other, the pose is solved eight more times, leaving out one string each time. Without the
// faulty string the other seven agree, however large its error (as long as only one is faulty). Its error is its
// measured length minus the length that the other seven explain.
//
// One redundant length distinguishes two strings only where they affect the lengths differently. In device geometries
// as symmetric as these, most strings have one to three others near the centre whose removal fits equally well, so the
// result is a set of suspects. It narrows as the hand moves: the faulty string keeps explaining the contradiction and
// the others do not. The unexplained squared error without each string is therefore summed over the last ticks.
//
// A string that reads longer than the others explain is slack: its motor has paid out more than the distance from
// pulley to knot, or has not yet wound it in. A string that reads shorter (it broke and was wound in, it slipped, or
// its encoder stopped while it paid out) is reported as a residual only.
#pragma once

#include <array>
#include <cstdint>

#include "device/kinematics.hpp"
#include "haptic/realtime.hpp"

namespace haptic::rt {

struct StringMonitorSettings {
    double residual = 1e-3;      // m, rms of measured minus explained lengths; no suspects below it
    double memory_ticks = 50.0;  // ticks, time constant of the sum of evidence
};

struct StringSuspicion {
    std::uint8_t strings = 0;  // bit i: string i is suspected; 0: all lengths agree
    std::uint8_t slack = 0;    // the suspects that read longer than the others explain
    double error = 0.0;        // m, measured minus explained, of the most likely suspect
};

class StringMonitor {
  public:
    /// Throws std::invalid_argument for settings that are not positive and finite, and as PoseSolver does.
    StringMonitor(const device::DeviceGeometry& geometry, const StringMonitorSettings& settings);

    /// Takes one tick's lengths and the least-squares pose of all eight. Costs at most eight pose solutions, and
    /// nothing while the lengths agree.
    const StringSuspicion& update(const StringArray& lengths, const PoseEstimate& estimate) HAPTIC_RT;
    void reset(const Pose& pose) HAPTIC_RT;
    [[nodiscard]] const StringSuspicion& suspicion() const HAPTIC_RT { return suspicion_; }

  private:
    void find_suspects(const std::array<double, kStrings>& errors) HAPTIC_RT;

    PoseSolver solver_;
    double residual_;
    double kept_;                                 // share of the evidence that is kept per tick
    std::array<PoseEstimate, kStrings> without_;  // poses leaving out each string; the last good pose while all agree
    StringArray unexplained_{};                   // m^2, leaving out each string, summed over ticks
    double unexplained_by_all_ = 0.0;             // m^2, with all eight, summed over ticks
    StringSuspicion suspicion_;
};

}  // namespace haptic::rt
