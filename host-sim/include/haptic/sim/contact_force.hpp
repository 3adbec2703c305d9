// Contact force: how the force of a proxy is spread over the body that it touches.
//
// The hand feels F; the touched surface receives the opposite (tool/contact_coupling.hpp). It is spread over the
// vertices around the touched point by a pressure mask (thesis, Eq. 4.1, section 4.1.3; James, Pai 2000):
//
//     f_j = w_j F,   w_j ~ (1 - d_j^2 / R^2)^2 for d_j < R,   sum w_j = 1
//
// d_j is the distance of vertex j from the touched point in the rest shape, so the mass that takes the force does not
// depend on how the surface is folded or stretched. A vertex passes its force to its particles by the skinning weights
// b_ji: particle i receives W_i F, W_i = sum over j of w_j b_ji. All W_i sum to 1, so the particles receive the
// opposite of the hand's force, to rounding.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/contact.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// A particle under a pressure mask.
struct PressedParticle {
    std::uint32_t particle = 0;  // of the body
    double weight = 0.0;         // W_i
};

/// Pressure mask of one body.
class PressureMask {
  public:
    /// `skin`: one element per vertex of `rest`, with particles below `particles`. `radius`: R, m. If no vertex is
    /// within the radius, the corners of the touched triangle take the force by its barycentric weights. Throws
    /// std::invalid_argument.
    PressureMask(const TriangleMesh& rest, const Skin& skin, std::size_t particles, double radius);

    /// The particles that take a force at the touched point; their weights sum to 1, to rounding. If they are more than
    /// `most`, those of the touched triangle's corners, at most kCornerParticles. Valid until the next call. Visits
    /// only vertices near the point. No allocation.
    [[nodiscard]] std::span<const PressedParticle> center_on(const SurfacePoint& touched,
                                                             std::size_t most = static_cast<std::size_t>(-1));

    static constexpr std::size_t kCornerParticles = 3 * SkinVertex::kMax;

    /// As those of sheets are.
    [[nodiscard]] bool vertices_are_particles() const noexcept { return vertices_are_particles_; }

  private:
    struct PressedVertex {
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
    void take_corners(const SurfacePoint& touched);
    void normalise();
    void find_particles();

    std::vector<Vec3> rest_;
    std::vector<Triangle> triangles_;
    Skin skin_;
    double radius_;
    bool vertices_are_particles_ = true;
    double cell_size_;
    std::vector<CellVertex> grid_;            // sorted by cell, then vertex
    std::vector<PressedVertex> vertices_;     // w_j of the vertices under the mask
    std::vector<PressedParticle> particles_;  // W_i of the particles that carry them
    std::vector<std::uint32_t> slot_;         // per particle: its index in particles_, or kNone
};

}  // namespace haptic::sim
