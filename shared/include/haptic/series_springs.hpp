// Series springs: combines the contact forces of a tool's particles so that the total force does not decrease with the
// number of particles, and remains passive.
//
// The thesis divides the sum of the particles' springs by the number of all particles (section 5.2.2): one contact of
// 37 is felt with stiffness k / 37. A mean over the particles in contact, even weighted with their depths, is not a
// gradient: it gives energy to a hand that presses flat and returns tilted, and it drops when another particle comes
// into contact. Here each particle has a spring k, and all particles together are in series with the springs of the
// grip: k for its position and k_t rho^2 for its orientation. Unknowns are the offset u and the small rotation phi
// between grip and tool. For each plane of a particle with normal n, moment arm r and signed depth s:
//
//     (u, phi)  minimises  k |u|^2 / 2 + k_t rho^2 |phi|^2 / 2 + k / 2 sum [s - n . (u + phi x r)]+^2
//     push = k [s - n . (u + phi x r)]+       F = sum push n       T = sum r x push (n + n x phi)
//
// M particles at depth d of one face, which does not rotate the tool, make F = k d M / (1 + M): k / 2 for one particle,
// approaching k for many, never more. F = k u, and F and T are the gradient of the minimum with respect to the grip's
// pose (n x phi appears because the moment arms rotate with the grip), so no energy is generated. Both are exactly zero
// if no depth is positive. rho is the radius of gyration of the particles' rest offsets about the grip, so that it does
// not depend on the sampling density of the tool either.
// @source springs in series as a Moreau envelope: Rockafellar and Wets, Variational Analysis, 1.G. The limit of stiff
// particles is the six-degree-of-freedom god-object: Ortega, Redon, Coquillart 2007.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

inline constexpr std::size_t kMaxSpringRows = kMaxProxies * kMaxPlanes;

/// One plane of one particle.
struct SpringRow {
    Vec3 moment_arm{0.0, 0.0, 0.0};  // m, from the grip's origin to the particle's goal
    Vec3 normal{0.0, 0.0, 0.0};      // unit
    double depth = 0.0;              // m, of the goal behind the plane; negative: in front of it
    double push = 0.0;               // N, output: force on the tool along the normal, not negative
};

struct SeriesCoupling {
    double stiffness = 0.0;         // N/m
    double torque_stiffness = 0.0;  // N/m
    double gyration = 0.0;          // m, rho; 0: a point, without torque
};

/// Radius of gyration rho, m, of `count` particles whose squared offsets sum to `squares` (m^2). rho^2 is 2/3 of their
/// mean square: the squared distance from an axis, averaged over all axes.
[[nodiscard]] double gyration(double squares, std::size_t count) HAPTIC_RT;

/// Solver of the minimisation above, exact to rounding: Newton's method on a piecewise quadratic function, usually 1 to
/// 5 iterations, warm-started with the previous solution.
class SeriesSprings {
  public:
    /// Sets each row's push, 0 for rows beyond kMaxSpringRows, and returns F and T about the grip's origin. Finite for
    /// finite rows. Bounded by kMaxRounds times the rows.
    Wrench solve(std::span<SpringRow> rows, const SeriesCoupling& coupling) HAPTIC_RT;
    /// Minimum at the last solve(), J: energy stored in all springs.
    [[nodiscard]] double stored_energy() const HAPTIC_RT { return stored_energy_; }
    /// Newton iterations of the last solve().
    [[nodiscard]] int rounds() const HAPTIC_RT { return rounds_; }

    static constexpr int kMaxRounds = 24;

  private:
    std::array<double, 6> offset_{};  // m: u, and phi times its scale
    double stored_energy_ = 0.0;
    int rounds_ = 0;
};

}  // namespace haptic
