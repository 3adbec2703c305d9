// Coupling bound: no compliance makes contacts stiffer than the springs between hand and tool.
//
// The springs of the coupling, k for the tool's translation and k_t for its rotation about the centre c of its N
// proxies, are in series with every contact. With r_i = o_i - c, the offset of proxy i from the centre, and j the mean
// of |r_i|^2, the rotational stiffness about c is at most k_t j. So every tool has, for rows d that push proxies i,
//
//     k W >= B,      B_rs = d_r . d_s + k / (k_t j) (r x d)_r . (r x d)_s      (the difference is positive
//     semidefinite)
//
// and if this holds for the rows that push, with directions and moments D, then D^T W^-1 D <= diag(k, k_t j): the hand
// feels at most k in translation, and k_t j + k |c|^2 in rotation about the grip. rt-core's limits of stiffness rely on
// it, but W comes from another process, which may send it in m/N by mistake. So the condition is verified, by a
// Cholesky factor of k W - B that each row joins when it pushes for the first time in a frame. At a negative pivot B is
// added to all rows, as if the springs had been left out: for positive W, k W + B satisfies the condition. A row whose
// pivot remains negative, because no energy has this matrix, is coupled to the others by B alone.
// @source S. Boyd, L. Vandenberghe, "Convex Optimization", 2004, A.5.5 (Schur complement)
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/cholesky_factor.hpp"
#include "haptic/contact_problem.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

/// Row of the contact problem of a tool: a direction in which one of its proxies can be pushed.
struct FrameRow {
    Vec3 direction{0.0, 0.0, 0.0};  // unit, device frame
    std::uint16_t proxy = 0;
    bool tangential = false;
};

/// N/m, k_t: of the springs that make the torque.
[[nodiscard]] double torque_stiffness_of(const ContactFrame& frame) HAPTIC_RT;

/// N*m/rad, k_t j + k |c|^2: largest rotational stiffness about the grip that a tool in the frame's coupling can have,
/// however stiff.
[[nodiscard]] double rotational_stiffness_bound(const ContactFrame& frame) HAPTIC_RT;

/// The bound for one frame after the other. All memory is allocated by the constructor.
class CouplingBound {
  public:
    CouplingBound();

    /// Relative excess over k that passes: a surface's share weakens the coupling between the rows of a rigid tool.
    static constexpr double kTranslationExcess = 0.01;
    /// Over k_t j: W holds for the tool's orientation in the simulation, the moments for the grip's, which has moved
    /// on. Scripted and human-like hands in the built-in scenes need 0.25.
    static constexpr double kRotationExcess = 0.5;

    /// Starts with a frame, whose rows these are, and the orientation of the grip; no rows: nothing to verify.
    void load(const ContactFrame& frame, std::span<const FrameRow> rows, const Quat& device_from_grip) HAPTIC_RT;
    /// Verifies the rows that have a force. Returns true if the condition was violated and the matrix has been changed,
    /// at most once a frame: all rows of the frame then satisfy the condition. O(n^3) for n rows, in all calls for a
    /// frame together.
    [[nodiscard]] bool enforce(ComplianceMatrix& compliance, std::span<const double> force) HAPTIC_RT;
    /// The loaded frame lacked the springs.
    [[nodiscard]] bool springs_added() const HAPTIC_RT { return springs_added_; }

  private:
    [[nodiscard]] double translation(std::size_t r, std::size_t s) const HAPTIC_RT;
    [[nodiscard]] double rotation(std::size_t r, std::size_t s) const HAPTIC_RT;
    [[nodiscard]] double required(std::size_t r, std::size_t s) const HAPTIC_RT;
    [[nodiscard]] double reduce(const ComplianceMatrix& compliance, std::size_t row) HAPTIC_RT;
    void append(std::size_t row, double pivot) HAPTIC_RT;
    void add_springs(ComplianceMatrix& compliance) HAPTIC_RT;
    void complete(ComplianceMatrix& compliance) HAPTIC_RT;
    void clear_factor() HAPTIC_RT;

    std::size_t count_ = 0;               // rows of the frame
    double of_rotation_ = 0.0;            // 1/m^2, k / (k_t j); 0 for proxies at one point
    bool springs_added_ = false;          // since load()
    std::vector<Vec3> direction_;         // per row: d
    std::vector<Vec3> moment_;            // m, per row: r x d, device frame
    std::vector<std::uint8_t> verified_;  // per row: is in the factor
    std::vector<std::uint16_t> order_;    // rows in the order of the factor
    std::vector<double> reduced_;         // scratch: U^-T (k W - B)_Sq
    CholeskyFactor factor_;               // of k W - B
};

}  // namespace haptic
