// What is left to do once all surfaces have arrived: push the proxy clear of those that still clip it (thesis, 4.2.4).
#pragma once

#include <haptic/sim/contact.hpp>
#include "contact/proxy_path.hpp"
#include <haptic/sim/contact/surroundings.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

struct PopOut {
    Vec3 position{0.0};
    double clearance = 0.0;  // m, distance to the nearest surface; the radius if none is nearer
    int iterations = 0;      // moves; with Algorithm 2 passes that moved
    bool squeezed = false;   // clearance stayed below radius * shrink: there is no more room here
};

/// Moves a sphere to the nearest place where it is clear of all surfaces at the end of the step. Every triangle within
/// the radius gives one half-space and all are met together, so that the order of triangles does not matter; the side
/// is the one on which the centre is, and every move is swept, so that it stays there.
/// settings.pop_out = Thesis calls thesis_pop_out() instead.
/// @source in place of the thesis' Algorithm 2, whose result depends on the order of triangles (4.6.1)
[[nodiscard]] PopOut pop_out(const NearSurfaces& surfaces, const Vec3& center, double radius,
                             const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
