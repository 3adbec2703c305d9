// Distribution of a wrench over eight strings that can only pull, within bounds.
//
// minimise  |W (A^T t - w)|^2 + effort * |t - t_min|^2 + continuity * |t - t_previous|^2   over  t_min <= t <= t_max,
//                                                                                    |t - t_previous| <= slew
// with W scaling torque by the grip's radius. A strictly convex quadratic programme of 8 unknowns in a box: its minimum
// is unique, and is found exactly (to rounding), warm-started from the set of strings that were at a bound in the last
// tick. Two methods share the work, each round of both a Cholesky factorisation of at most 8 x 8:
//   1. Block principal pivoting: solve for the free strings, change the side of every string that breaks a condition,
//      repeat. Nearly always done after 1 to 4 rounds, but may cycle.
//      @source Judice and Pires 1994, "A block principal pivoting algorithm for large-scale strictly monotone linear
//      complementarity problems".
//   2. If it has not ended after kBlockRounds: the primal active-set method from the point reached, cut to the box.
//      Each step that has a length lowers the objective and steps without one follow Bland's rule, so no set of bounds
//      comes twice and the method ends; kDescentRounds is twice what any of three million random wrenches needed.
#pragma once

#include <cstdint>
#include <limits>

#include <haptic/realtime.hpp>
#include "device/kinematics.hpp"

namespace haptic::rt {

/// What is made of a wrench that tensions within their bounds cannot make.
enum class Infeasible : std::uint8_t {
    Closest,   // the wrench nearest to it, in the norm above: may push to the side of where it was asked to
    Direction  // the largest share of it, force and torque alike, that can be made
};

struct TensionSettings {
    double minimum = 0.0;       // N
    double maximum = 0.0;       // N
    double torque_scale = 1.0;  // 1/m: torque error is weighed as force error at a lever of 1 / torque_scale
    double effort = 1e-5;       // 1: small beside 1, so that the wrench is met wherever it can be
    double continuity = 1e-5;   // 1: likewise; picks the nearest of the many tensions that make nearly one wrench
    // N per call: no tension changes by more. At the border of what the strings can reach, the tensions that come
    // closest to a wrench jump between two sets that make nearly the same one; this bounds the jump.
    double slew = std::numeric_limits<double>::infinity();
    Infeasible infeasible = Infeasible::Closest;
};

struct TensionResult {
    StringArray tensions{};  // N, within minimum and maximum on every path
    Wrench wrench;           // A^T t: what these tensions really make
    double scale = 1.0;      // share of the wrench that was aimed at: below 1 only with Infeasible::Direction
    bool reached = true;     // the wrench asked for is met to 1e-3 relative, and 1 mN / 0.05 mN*m absolute
    bool exact = true;       // the optimality conditions hold; false only if the bound on the work was met first
    int rounds = 0;  // of the solver, at most kBlockRounds + kDescentRounds, and times kHalvings + 1 for Direction
};

class TensionSolver {
  public:
    static constexpr int kBlockRounds = 3;
    static constexpr int kDescentRounds = 45;
    // Of the share of an infeasible wrench, which so is found to 1 in 4096 of eight strings at full pull.
    static constexpr int kHalvings = 12;

    /// Throws std::invalid_argument for settings that leave the box empty or the minimum not unique.
    explicit TensionSolver(const TensionSettings& settings);
    /// At most kBlockRounds + kDescentRounds rounds; with Infeasible::Direction, for an infeasible wrench, that again
    /// for each of kHalvings shares of it, and the closest is made where no share can be. A wrench that is not finite
    /// counts as zero, one far beyond what any strings reach is shortened first, and wires that are not finite give the
    /// minimum tension, neither reached nor exact.
    TensionResult solve(const WireMatrix& wires, const Wrench& wanted) HAPTIC_RT;
    void reset() HAPTIC_RT;
    /// N: the largest tension of each string from now on, within the settings' bounds; the slew holds all the same.
    void set_maxima(const StringArray& maxima) HAPTIC_RT { maxima_ = maxima; }

  private:
    using Set = std::array<std::int8_t, kStrings>;  // -1 lower bound, +1 upper, 0 free

    void aim(const WireMatrix& wires, const Wrench& goal, Set& set, TensionResult& result) const HAPTIC_RT;
    void keep_direction(const WireMatrix& wires, const Wrench& goal, Set& set, TensionResult& result) const HAPTIC_RT;

    TensionSettings settings_;
    StringArray maxima_{};
    StringArray previous_{};
    Set at_bound_{};
};

}  // namespace haptic::rt
