// Tool force: the forces between a tool and the bodies that it touches (thesis, sections 5.2.2 and 5.2.3).
//
// Particle i of N has its goal g_i and is held at x_i by contact planes n_c. Its spring presses along them with
// k (x_i - g_i) / N = sum s_c n_c, s_c >= 0; damping (contact_force.hpp) and friction along the planes are added, which
// gives f_i. The surfaces receive -f_i. The tool receives
//     F = sum f_i,   T = (k_t / k) sum r_i x f_i,   r_i = g_i - d
// over the particles in contact; the divisor N counts all particles, as in section 5.2.2. A plane that supports the
// whole tool is felt as a spring k, one that supports a single particle as k / N.
//
// ForceSharing::Series: the strengths s_c come from springs in series (haptic/series_springs.hpp), computed from the
// depth of each goal beyond each contact plane, and nothing is divided by N. The friction part of k (x_i - g_i) is
// scaled by the ratio of the s_c to the normal part.
//
// MultiRate::Positions, the thesis' own scheme, uses x_i - g_i in full, x_i being the particle's position in the
// deformed tool: also along the surface, with or without friction.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "haptic/series_springs.hpp"
#include "haptic/sim/contact_force.hpp"
#include "haptic/sim/coupling.hpp"
#include "haptic/sim/scene_body.hpp"
#include "haptic/types.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {

struct PressSettings {
    CouplingSettings coupling;
    double gain = 1.0;   // 0..1, of the clutch
    double step = 0.01;  // s
};

/// The bodies that the tool presses on.
struct PressedBodies {
    std::span<const SceneBody> bodies;
    std::span<PressureMask> masks;   // one per body
    std::span<const Vec3> velocity;  // m/s, per particle of all bodies
    std::span<Vec3> force;           // N, per particle of all bodies; added to
};

struct ToolForce {
    Vec3 force{0.0};           // N, on the tool
    Vec3 torque{0.0};          // N*m, on the tool about the hip
    double damping = 0.0;      // N*s/m, as in ContactFrame: of one particle's undivided spring; in series of all
    double depth = 0.0;        // m, greatest distance of a constrained goal from its goal
    std::size_t collided = 0;  // particles in contact
};

class ToolPress {
  public:
    /// Computes the force and adds its opposite to the bodies' particles. Stateless between calls. No allocation.
    [[nodiscard]] ToolForce press(const ToolProxies& tool, const PressSettings& settings, const PressedBodies& on);

  private:
    [[nodiscard]] Wrench solve_series(const ToolProxies& tool, const PressSettings& settings);

    SeriesSprings springs_;
    std::array<SpringRow, kMaxSpringRows> rows_{};  // one per contact plane, in the order of the particles
};

}  // namespace haptic::sim
