// Distribution of a wrench over eight strings that can only pull, within bounds.
//
// minimise  |W (A^T t - w)|^2 + effort * |t - t_min|^2 + continuity * |t - t_previous|^2   over  t_min <= t <= t_max
// with W scaling torque by the grip's radius. A strictly convex quadratic programme of 8 unknowns in a box; its minimum
// is unique and is found exactly by an active-set method with a fixed bound on the work, warm-started from the last
// set.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"
#include "haptic/rt/kinematics.hpp"

namespace haptic::rt {

struct TensionSettings {
    double minimum = 0.0;       // N
    double maximum = 0.0;       // N
    double torque_scale = 1.0;  // 1/m: torque error is weighed as force error at a lever of 1 / torque_scale
    double effort = 1e-6;       // 1: small beside 1, so that the wrench is met wherever it can be
    double continuity = 1e-6;   // 1
};

struct TensionResult {
    StringArray tensions{};  // N, within bounds on every path
    Wrench wrench;           // A^T t: what these tensions really make
    bool reached = true;     // the wrench asked for is met to 1e-3 relative, and 1 mN / 0.05 mN*m absolute
    bool exact = true;       // the optimality conditions hold; false only if the bound on the work was met first
};

class TensionSolver {
  public:
    static constexpr int kBlockRounds = 6;
    static constexpr int kDescentRounds = 40;

    /// Throws std::invalid_argument for settings that leave the box empty or the minimum not unique.
    explicit TensionSolver(const TensionSettings& settings);
    /// Fixed worst-case work. A wrench that is not finite counts as zero.
    TensionResult solve(const WireMatrix& wires, const Wrench& wanted) HAPTIC_RT;
    void reset() HAPTIC_RT;

  private:
    TensionSettings settings_;
    StringArray previous_{};
    std::array<std::int8_t, kStrings> at_bound_{};  // -1 lower, +1 upper, 0 free
};

}  // namespace haptic::rt
