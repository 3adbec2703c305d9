// Lone surfaces: what is entangled with nothing but itself takes the place of its skin at once.
//
// A hand may crush a body until its surface is entangled with itself. Its particles are soon in shape again, but no
// straight paths lead the surface to its skin, though that crosses nothing. Some way does: a sphere can be moved from
// one embedding in space to any other that has the same side outside without passing through itself, within any convex
// room that holds both. So where a surface is a sphere and nothing else reaches into a box around it and its skin, it
// is led there within a step. The way itself is not sought.
//
// A body may also wait for its surface for ever (waiting_bodies.hpp), folded through itself, because all that would
// unfold it leads away from its surface. Once it has been alone for a while it need not wait any more.
// @source J. W. Alexander, "On the Subdivision of 3-Space by a Polyhedron", 1924; S. Smale, "Diffeomorphisms of the
// 2-Sphere", 1959; their use is our own
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {

struct Assembly;

class LoneSurfaces {
  public:
    /// `assembly` outlives it.
    explicit LoneSurfaces(const Assembly& assembly);

    /// Ends a step, s, after which the surface of a body lags by so much, m. Whether it is to be tested: it is a sphere
    /// and has lagged for a while, without a test since, and has hardly caught up meanwhile.
    [[nodiscard]] bool end_step(std::size_t body, double lag, double step) noexcept;
    /// Tests one: whether it may jump to its skin, which has these vertices, m, of all bodies. `alone`: nothing else
    /// reaches into a box around both and the way of the step.
    [[nodiscard]] bool may_jump(std::size_t body, bool alone, std::span<const Vec3> skin);
    /// Whether a body has been alone in the last few tests, and may leave its surface behind as long as it is.
    [[nodiscard]] bool need_not_wait(std::size_t body) const noexcept;

  private:
    [[nodiscard]] bool is_embedded(std::size_t body, std::span<const Vec3> vertices);

    /// Of bodies with the same triangles.
    struct Shape {
        double volume = 0.0;                          // m^3, at rest; negative if its triangles face inward
        std::optional<SurfaceCrossings> crossings{};  // of a sphere that can lag
    };
    struct Surface {
        std::size_t shape = 0;
        double lagged = 0.0;  // s, since it did not, or the last look at it
        double lag = 0.0;     // m, at that
        int tests_alone = 0;  // in a row
    };
    const Assembly& assembly_;
    std::vector<Shape> shapes_;
    std::vector<Surface> surfaces_;  // per body
};

}  // namespace haptic::sim
