// Pop-out: moves the proxy clear of surfaces that still clip it once all have arrived (thesis 4.2.4).
#pragma once

#include "contact/contact_candidates.hpp"
#include "contact/proxy_path.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Result of pop_out().
struct PopOut {
    Vec3 position{0.0};            // m, centre
    double clearance = 0.0;        // m, distance to the nearest surface; the radius if none is nearer
    int iterations = 0;            // moves; with Algorithm 2, passes that moved
    bool overconstrained = false;  // clearance stayed below radius * shrink: no more room here
};

/// Moves a sphere to the nearest position at which it is clear of all surfaces at the end of the step. Each triangle
/// within the radius gives one half-space, on the side of the centre. All half-spaces are satisfied together, so the
/// order of triangles does not matter. Every move is swept, so that the centre stays on its side. With settings.pop_out
/// = Thesis it runs thesis_pop_out() instead. No allocation; at most settings.max_pop_outs moves.
/// @source replaces Algorithm 2 of the thesis, whose result depends on the order of triangles (4.6.1)
[[nodiscard]] PopOut pop_out(const NearSurfaces& surfaces, const Vec3& center, double radius,
                             const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
