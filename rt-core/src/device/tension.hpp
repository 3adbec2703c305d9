// Tension distribution: the tensions of eight strings that make a wrench, within bounds, as a quadratic programme.
//
// minimise  |W (A^T t - w)|^2 + effort * |t - t_min|^2 + continuity * |t - t_previous|^2   over  t_min <= t <= t_max,
//                                                                                    |t - t_previous| <= slew
// A is the wire matrix, w the wanted wrench, and W scales torque by the inverse of the grip's radius. The programme has
// eight unknowns in a box and is strictly convex, so its minimum is unique. It is found exactly (to rounding), starting
// from the active set of the last tick. Two methods are used in turn; a round of either costs one Cholesky
// factorisation of at most 8 x 8:
//   1. Block principal pivoting: solve for the free strings, then move every string that violates an optimality
//      condition to the other side of its bound, and repeat. Nearly always done after 1 to 4 rounds, but may cycle.
//      @source Judice and Pires 1994, "A block principal pivoting algorithm for large-scale strictly monotone linear
//      complementarity problems".
//   2. If kBlockRounds did not suffice: the primal active-set method, started at the last point clamped to the box.
//      Every step of positive length lowers the objective, and steps of zero length follow Bland's rule, so no active
//      set repeats and the method terminates. kDescentRounds is twice the maximum seen over three million random
//      wrenches.
#pragma once

#include <cstdint>
#include <limits>

#include "device/kinematics.hpp"
#include "haptic/realtime.hpp"

namespace haptic::rt {

/// Treatment of a wrench that no tensions within the bounds can produce.
enum class Infeasible : std::uint8_t {
    Closest,   // make the closest wrench in the norm above; its direction may differ from the wanted one
    Direction  // make the largest multiple, at most 1, of the wanted wrench; force and torque scale together
};

struct TensionSettings {
    double minimum = 0.0;       // N
    double maximum = 0.0;       // N
    double torque_scale = 1.0;  // 1/m: a torque error counts like a force error at a moment arm of 1 / torque_scale
    double effort = 1e-5;       // 1; small against 1, so that a feasible wrench is met
    double continuity = 1e-5;   // 1; small against 1; picks the nearest of the tensions that make nearly one wrench
    // N per call: the largest change of a tension. At the border of the feasible wrenches the optimal tensions can jump
    // between two sets that make nearly the same wrench; this bounds the jump.
    double slew = std::numeric_limits<double>::infinity();
    Infeasible infeasible = Infeasible::Closest;
};

struct TensionResult {
    StringArray tensions{};  // N, within minimum and maximum on every path
    Wrench wrench;           // A^T t: the wrench that these tensions make
    double scale = 1.0;      // share of the wanted wrench that was solved for; below 1 only with Infeasible::Direction
    bool reached = true;     // the wanted wrench is met to 1e-3 relative, or to 1 mN and 0.05 mN*m
    bool exact = true;       // the optimality conditions hold; false only if the rounds were used up first
    int rounds = 0;  // at most kBlockRounds + kDescentRounds; with Infeasible::Direction kHalvings + 1 times as many
};

class TensionSolver {
  public:
    static constexpr int kBlockRounds = 3;
    static constexpr int kDescentRounds = 45;
    // Bisection steps on the scale of an infeasible wrench. They resolve it to 1/4096 of eight strings at full pull.
    static constexpr int kHalvings = 12;

    /// Throws std::invalid_argument for settings that leave the box empty or the minimum not unique.
    explicit TensionSolver(const TensionSettings& settings);
    /// Solves the programme, with previous tensions and active set taken from the last call. Bounded by kBlockRounds +
    /// kDescentRounds rounds, times kHalvings + 1 for an infeasible wrench with Infeasible::Direction; if no multiple
    /// of the wrench is feasible, the closest wrench is made. A wrench that is not finite counts as zero. A wrench far
    /// beyond the strings' reach is scaled down first. Wires that are not finite give the minimum tensions, neither
    /// reached nor exact.
    TensionResult solve(const WireMatrix& wires, const Wrench& wanted) HAPTIC_RT;
    /// Forgets the last call: previous tensions at the minimum.
    void reset() HAPTIC_RT;
    /// N: upper bound of each string's tension from now on, clamped to the settings' bounds. The slew still applies.
    void set_maxima(const StringArray& maxima) HAPTIC_RT { maxima_ = maxima; }

  private:
    using ActiveSet = std::array<std::int8_t, kStrings>;  // -1: at the lower bound, +1: at the upper, 0: free

    void solve_for(const WireMatrix& wires, const Wrench& goal, ActiveSet& active,
                   TensionResult& result) const HAPTIC_RT;
    void scale_to_feasible(const WireMatrix& wires, const Wrench& goal, ActiveSet& active,
                           TensionResult& result) const HAPTIC_RT;

    TensionSettings settings_;
    StringArray maxima_{};
    StringArray previous_{};
    ActiveSet active_{};
};

}  // namespace haptic::rt
