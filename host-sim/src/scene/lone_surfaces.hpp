// Lone surfaces: those that are entangled with nothing but one another go to their skins at once.
//
// A hand may crush bodies until their surfaces are entangled. Their particles are soon in shape again, but no straight
// paths lead the surfaces to their skins, though these cross nothing. Some way does: spheres that lie beside one
// another can be moved from one embedding in space to any other that has the same sides outside without passing through
// themselves or one another, within any convex room that holds both. So where surfaces are spheres and nothing else
// reaches into a box around them and their skins, those that lag are led to their skins within a step. The way itself
// is not sought. Skins of neighbours touch, so surfaces get a little less room than these. A tool that is a ball is one
// more sphere, which stays where it is: surfaces that were crushed around it let it go. A hand is none: it may hold
// a body in a ring of its fingers.
//
// Bodies may also wait for their surfaces for ever (waiting_bodies.hpp), folded through themselves or one another,
// because all that would unfold them leads away from their surfaces. Once they have been alone for a while they need
// not wait any more.
// @source J. W. Alexander, "On the Subdivision of 3-Space by a Polyhedron", 1924; S. Smale, "Diffeomorphisms of the
// 2-Sphere", 1959; R. S. Palais, "Extending Diffeomorphisms", 1960 (for several); their use is our own
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"
#include "simd/aabb.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {

struct Assembly;

struct Ball {
    Vec3 centre{0.0};     // m
    double radius = 0.0;  // m
};

/// What surfaces that are alone have to know of the tool.
struct LoneTool {
    Aabb reach;                // m, in which it may touch surfaces in the step
    std::optional<Ball> ball;  // all of it; none: it has another shape
};

class LoneSurfaces {
  public:
    /// `assembly` outlives it.
    explicit LoneSurfaces(const Assembly& assembly);

    /// Ends a step, s, after which the surface of a body lags by so much, m. Whether it is to be tested: it is a
    /// sphere, has lagged for a while since the last test, and has hardly caught up meanwhile.
    [[nodiscard]] bool end_step(std::size_t body, double lag, double step) noexcept;
    /// Whether a body has been alone in the last few tests, and may leave its surface behind as long as it is.
    [[nodiscard]] bool need_not_wait(std::size_t body) const noexcept;

    /// Boxes that hold surfaces over the step, and skins, m; one per body.
    [[nodiscard]] std::span<Aabb> rooms() noexcept { return rooms_; }
    /// Finds the group of a body: it and all that reaches into a box around them. Whether these are a few spheres. So
    /// is the tool, if it is a ball.
    [[nodiscard]] bool is_alone(std::size_t body, const LoneTool& tool) noexcept;
    /// Marks those of the last group by 1.
    [[nodiscard]] std::span<const std::uint8_t> group() const noexcept { return group_; }

    /// A body is tested, alone or not.
    void begin_test(std::size_t body, bool alone) noexcept;
    /// Where the surface of a body may go that lags by so much, m, and whose skin is this, of all: to the skin, but a
    /// little less far from its particles.
    void draw_in(std::size_t body, double lag, std::span<Vec3> skin) const noexcept;
    /// Some of the group, marked by 1, are to jump, so that all vertices go from where they are to other places, m.
    /// Takes the marks from those that would cross or touch something, the tool too, have their outside in, or leave
    /// the box. True: all marks stay.
    [[nodiscard]] bool may_jump(std::span<std::uint8_t> jumps, std::span<const Vec3> from, std::span<const Vec3> to);
    void note_jump(std::size_t body) noexcept;

  private:
    struct Surface {
        double volume = 0.0;     // m^3, at rest; negative if its triangles face inward
        double least_lag = 0.0;  // m, that is worth a test
        double lagged = 0.0;     // s, since the last look, test or jump
        double wait = 0.0;       // s, of that before the next look
        double lag = 0.0;        // m, at the last look
        bool is_due = false;     // it is to be tested since
        int tests_alone = 0;     // in a row
    };
    [[nodiscard]] bool is_within(std::size_t body, std::size_t other, std::span<const Vec3> vertices) const noexcept;
    [[nodiscard]] double winding_about(const Vec3& point, std::size_t body,
                                       std::span<const Vec3> vertices) const noexcept;
    [[nodiscard]] bool touches(const Ball& ball, std::size_t body, std::span<const Vec3> vertices) const noexcept;

    const Assembly& assembly_;
    std::vector<Surface> surfaces_;        // per body
    std::vector<std::uint8_t> is_sphere_;  // per body: it is one that moves, and is beside all others
    SurfaceCrossings crossings_;           // of spheres, whether nested or not
    std::size_t triangles_ = 0;            // of these
    std::vector<Aabb> rooms_;              // per body
    std::vector<std::uint8_t> group_;      // per body
    Aabb room_;                            // of the group
    std::optional<Ball> tool_;             // if it is in there
};

}  // namespace haptic::sim
