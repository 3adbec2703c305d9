// The force of the proxy on the particles it touches.
//
// The hand is rendered k (proxy - hip), the surface that holds the proxy takes the opposite, F = k (hip - proxy). It is
// spread over the vertices round the touched point with a pressure mask (thesis, equation 4.1 and section 4.1.3; James
// & Pai 2000):
//
//     f_j = w_j F,   w_j ~ (1 - d_j^2 / R^2)^2 for d_j < R,   sum w_j = 1
//
// with d_j the distance of vertex j from the touched point in the rest shape, so that the mass that takes the force
// stays the same however the surface is folded or stretched. The particles that carry a vertex take its force by their
// skinning weights b_ji, so that particle i takes W_i F with W_i = sum over j of w_j b_ji, and all W_i sum to 1: what
// the particles are given is the opposite of what the hand is given, to rounding.
//
// A spring alone throws back what it has caught. It is therefore given a loss that grows with depth (K. Hunt, F.
// Crossley, "Coefficient of Restitution Interpreted as Damping in Vibroimpact", 1975), F = k d (1 + c v) for a depth d
// and a surface that comes nearer with v: unlike a plain damper it starts from nothing, so the hand feels no knock. It
// is taken at the velocity that the step leads to, v' = v - F h / m, which keeps it stable however light the particles
// are. m is the mass that the mask presses on, 1 / sum(W_i^2 / m_i), or that of the surface which follows it within a
// step because constraints tie it to the patch, if that is known to be more.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <haptic/sim/contact.hpp>
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// How a force on a proxy divides among the contact planes that make it: strengths along their normals, none negative.
/// A part that no plane can make, which a proxy that has arrived does not have, is left out.
using ContactShares = std::array<double, kMaxSurfacePlanes>;  // N
[[nodiscard]] ContactShares divide_force(const Vec3& force, const SurfacePlanes& contacts) noexcept;

/// The particles that take the force of one contact.
struct PressedPatch {
    Vec3 velocity{0.0};  // m/s, of the particles, weighted
    double mass = 0.0;   // kg, that a force on the patch accelerates: 1 / sum(W_i^2 / m_i)
};

class PressureMask {
  public:
    /// `skin` has one element a vertex of `rest`, `mass` (kg) one a particle, infinite where
    /// nothing moves it; `radius` in m. If no vertex is within the
    /// radius, the three of the touched triangle take the force by their weights. Throws std::invalid_argument.
    PressureMask(const TriangleMesh& rest, const Skin& skin, std::span<const double> mass, double radius);

    /// Lays the mask on a touched point. Looks only at vertices round it. No allocation.
    PressedPatch lay(const SurfacePoint& touched, std::span<const Vec3> particle_velocity);

    /// Adds `force` (N) to `particle_force`, one element a particle, as the mask lies. What is added sums up to `force`
    /// to rounding. No allocation.
    void press(const Vec3& force, std::span<Vec3> particle_force) const;

  private:
    struct Pressed {
        std::uint32_t index;
        double weight;
    };
    using Cell = std::array<std::int32_t, 3>;
    struct CellVertex {
        Cell cell;
        std::uint32_t vertex;
    };

    [[nodiscard]] Cell cell_of(const Vec3& rest) const;
    void find_vertices(const Vec3& centre);
    void find_particles();

    std::vector<Vec3> rest_;
    std::vector<Triangle> triangles_;
    Skin skin_;
    std::vector<double> mass_;  // kg, per particle
    double radius_;
    double cell_size_;
    std::vector<CellVertex> grid_;     // by cell, within one by vertex
    std::vector<Pressed> vertices_;    // under the mask
    std::vector<Pressed> particles_;   // that carry them
    std::vector<std::uint32_t> slot_;  // per particle: where in particles_, or kNone
};

/// Spring and loss between hip and proxy, in the scene.
struct Coupling {
    double stiffness = 20.0;  // N/m
    double loss = 0.0;        // s/m, c above
    double tied_mass = 0.0;   // kg, of the surface that follows the pressed patch within a step; 0: unknown
};

/// The damping of one contact, N*s/m. `share` is the strength of the spring alone there, k d, N. Bounded so that within
/// a step it can bring a patch of that mass to rest, but not turn it round.
[[nodiscard]] double contact_damping(double share, double patch_mass, double step_s, const Coupling& coupling) noexcept;

/// The strength of the push at one contact, N, at least 0. `closing` is the velocity at which the patch comes toward
/// the hip, m/s.
[[nodiscard]] double contact_push(double share, double closing, double damping) noexcept;

}  // namespace haptic::sim
