// How the particles of a tool share the force so that it does not fall with their number, and stays passive.
//
// The thesis divides the sum of all particles' springs by the number of all particles (section 5.2.2): one of 37 that
// touches is felt with k / 37. A mean over those that touch, even one weighted with their depths, is no gradient: it
// gives energy to a hand that presses flat and comes back tilted, and falls when another particle begins to touch. Here
// each particle has a spring k, and all of them together are in series with the springs of the grip, k for its position
// and k_t rho^2 for its attitude. With the offset u and the small turn phi between grip and tool, and for each plane of
// a particle its normal n, the particle's lever r and its signed depth s,
//
//     (u, phi)  minimises  k |u|^2 / 2 + k_t rho^2 |phi|^2 / 2 + k / 2 sum [s - n . (u + phi x r)]+^2
//     push = k [s - n . (u + phi x r)]+       F = sum push n       T = sum r x push (n + n x phi)
//
// M particles at depth d of one face, far from turning the tool, make F = k d M / (1 + M): half of k for one, toward k
// for many, never more. F = k u, and F and T are the gradient of the minimum by the grip's pose (n x phi is there
// because levers turn with the grip), so nothing is ever given that was not put in. Both are exactly zero where no
// depth is positive. rho is the gyration of the particles' rest offsets about the grip, so that it does not depend on
// how finely the tool is sampled either.
// @source series of springs as a Moreau envelope (Rockafellar and Wets, Variational Analysis, 1.G); the limit of stiff
// particles is the god-object of six degrees of freedom (Ortega, Redon, Coquillart 2007).
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
    Vec3 lever{0.0, 0.0, 0.0};   // m, from the grip's origin to where the grip has the particle
    Vec3 normal{0.0, 0.0, 0.0};  // unit
    double depth = 0.0;          // m, how far beyond the plane the grip has it; negative: before the plane
    double push = 0.0;           // N, out: along the normal, onto the tool; not negative
};

struct SeriesCoupling {
    double stiffness = 0.0;         // N/m
    double torque_stiffness = 0.0;  // N/m
    double gyration = 0.0;          // m; 0: a point, which makes no torque
};

/// m, rho^2 = 2/3 of the mean square of the offsets of `count` particles whose squares add up to `squares` (m^2): the
/// mean over all axes of the square of the distance from the axis.
[[nodiscard]] double gyration(double squares, std::size_t count) HAPTIC_RT;

/// The minimum above, exact to rounding: Newton's method on a function that is quadratic in pieces, 1 to 5 rounds as a
/// rule, and begun where the last one ended.
class SeriesSprings {
  public:
    /// Fills each row's push; rows beyond kMaxSpringRows get none. The wrench is F and T, about the grip's origin.
    /// Finite where the rows are. Bounded by kMostRounds times the rows.
    Wrench solve(std::span<SpringRow> rows, const SeriesCoupling& coupling) HAPTIC_RT;
    /// J, the minimum itself at the last solve(): what all springs hold, with k_t in place of k for the attitude's.
    [[nodiscard]] double stored() const HAPTIC_RT { return stored_; }
    /// Rounds of the last solve().
    [[nodiscard]] int rounds() const HAPTIC_RT { return rounds_; }

    static constexpr int kMostRounds = 24;

  private:
    std::array<double, 6> offset_{};  // m, u and phi times its lever
    double stored_ = 0.0;
    int rounds_ = 0;
};

}  // namespace haptic
