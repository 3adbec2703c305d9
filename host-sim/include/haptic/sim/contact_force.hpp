// Contact force: the force of the proxies on the particles of the bodies that they touch.
//
// The hand feels k (proxy - hip); the surface that holds the proxy receives the opposite, F = k (hip - proxy). F is
// spread over the vertices around the touched point by a pressure mask (thesis, Eq. 4.1, section 4.1.3; James, Pai
// 2000):
//
//     f_j = w_j F,   w_j ~ (1 - d_j^2 / R^2)^2 for d_j < R,   sum w_j = 1
//
// d_j is the distance of vertex j from the touched point in the rest shape, so the mass that takes the force does not
// depend on how the surface is folded or stretched. A vertex passes its force to its particles by the skinning weights
// b_ji: particle i receives W_i F, W_i = sum over j of w_j b_ji. All W_i sum to 1, so the particles receive the
// opposite of the hand's force, to rounding.
//
// An undamped spring throws objects back. It is therefore combined with Hunt-Crossley damping, F = k d (1 + c v) for a
// depth d and a surface that approaches at v (K. Hunt, F. Crossley, "Coefficient of Restitution Interpreted as Damping
// in Vibroimpact", 1975). Unlike a linear damper it starts at zero force, so the hand feels no impulse. It is evaluated
// implicitly at the velocity that the step leads to, v' = v - F h / m, and is therefore stable for light particles too.
// m is the effective mass under the mask, 1 / sum(W_i^2 / m_i), or the mass of the surface that follows it within a
// step because constraints tie it to the patch, if that is known and larger.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/contact.hpp"
#include "haptic/sim/coupling.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Strengths along the normals of the contact planes that together make a force on a proxy; none is negative.
using ContactShares = std::array<double, kMaxSurfacePlanes>;  // N

/// Divides a force (N) among contact planes. Drops the part that no plane can make; a proxy in equilibrium has none.
[[nodiscard]] ContactShares divide_force(const Vec3& force, const SurfacePlanes& contacts) noexcept;

/// Motion of the particles that take the force of one contact.
struct PressedPatch {
    Vec3 velocity{0.0};  // m/s, mean of the particles, weighted by W_i
    double mass = 0.0;   // kg, effective: 1 / sum(W_i^2 / m_i)
};

/// Pressure mask of one body.
class PressureMask {
  public:
    /// `skin`: one element per vertex of `rest`. `mass`: kg, one per particle, infinite if it cannot move. `radius`: R,
    /// m. If no vertex is within the radius, the corners of the touched triangle take the force by its barycentric
    /// weights. Throws std::invalid_argument.
    PressureMask(const TriangleMesh& rest, const Skin& skin, std::span<const double> mass, double radius);

    /// Centres the mask on a touched point. Visits only vertices near it. No allocation.
    PressedPatch center_on(const SurfacePoint& touched, std::span<const Vec3> particle_velocity);

    /// Adds W_i `force` (N) to `particle_force`, one element per particle. The sum added is `force`, to rounding. No
    /// allocation.
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
    std::vector<CellVertex> grid_;     // sorted by cell, then vertex
    std::vector<Pressed> vertices_;    // w_j of the vertices under the mask
    std::vector<Pressed> particles_;   // W_i of the particles that carry them
    std::vector<std::uint32_t> slot_;  // per particle: its index in particles_, or kNone
};

/// Damping of one contact, N*s/m: k d c / (1 + k d c h / m), the implicit Hunt-Crossley coefficient. `share` is k d, N.
/// Within a step it can stop a patch of mass m, but not reverse it.
[[nodiscard]] double contact_damping(double share, double patch_mass, double step_s, const Coupling& coupling) noexcept;

/// Strength of one contact, N, not negative: share + damping * closing. `closing` is the velocity at which the patch
/// approaches the hip, m/s.
[[nodiscard]] double contact_push(double share, double closing, double damping) noexcept;

}  // namespace haptic::sim
