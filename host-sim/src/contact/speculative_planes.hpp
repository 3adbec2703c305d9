// Speculative contact planes for the haptic loop: the active contacts and the planes it may touch before the next
// frame.
#pragma once

#include <span>

#include "contact/contact_candidates.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// One proxy and its prediction horizon.
struct SpeculativeQuery {
    Vec3 position{0.0};    // m, centre of the proxy at the end of the step
    double radius = 0.0;   // m
    double reach = 0.0;    // m, distance the hand may move the proxy until the planes expire
    double dt = 0.0;       // s, length of the step
    double horizon = 1.5;  // steps until the planes expire; surfaces are assumed to keep their velocity
};

/// Returns at most three planes: first the active contacts, then those that come nearest within the horizon.
///
/// A plane approximates its triangle near the contact point. It is given only for a triangle that the sphere, grown by
/// `reach`, touches within the horizon. So the space that it forbids beyond the triangle's border starts nearer than
/// radius + reach. Keep `reach` below the radius: then the hand cannot go far enough around a border within one frame
/// to feel the difference. Normals are those at the predicted contact, so that a sheet approaching edge-on is met on
/// its edge.
[[nodiscard]] SurfacePlanes speculative_planes(const NearSurfaces& surfaces, const SurfacePlanes& contacts,
                                               const SpeculativeQuery& query) noexcept;

/// One of several proxies: active contacts and query in, planes out.
struct SpeculativeTask {
    SurfacePlanes contacts;
    SpeculativeQuery query;
    SurfacePlanes planes;  // out
};

/// Same for many proxies with one traversal of each tree; the planes are bit-identical. About 4 kB of stack a proxy.
void speculative_planes(std::span<const MovingSurface> surfaces, std::span<SpeculativeTask> tasks) noexcept;

}  // namespace haptic::sim
