// The planes that a haptic loop needs until the next frame: those in contact and those that may be touched meanwhile.
#pragma once

#include <span>

#include <haptic/sim/contact.hpp>
#include "haptic/sim/contact/surroundings.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct ReachQuery {
    Vec3 position{0.0};    // m, centre of the proxy at the end of the step
    double radius = 0.0;   // m
    double reach = 0.0;    // m, how far the hand may take the proxy until the planes expire
    double dt = 0.0;       // s, length of the step
    double horizon = 1.5;  // steps until the planes expire; surfaces are taken to keep their velocity
};

/// At most three planes: first the contacts, which hold the proxy now, then those that come nearest within the horizon.
///
/// A plane is an approximation of its triangle near the touched point. It is only given for a triangle that the sphere,
/// grown by `reach`, touches within the horizon, so that what it forbids beyond the triangle's border is nearer than
/// radius + reach; keep `reach` below the radius, and the hand cannot get far enough round a border in one frame to
/// feel the difference. Normals are those at the predicted touch, so that a sheet that comes edge-on is met on its
/// edge.
[[nodiscard]] SurfacePlanes planes_in_reach(const NearSurfaces& surfaces, const SurfacePlanes& contacts,
                                            const ReachQuery& query) noexcept;

/// The same for one proxy of several.
struct ReachTask {
    SurfacePlanes contacts;
    ReachQuery query;
    SurfacePlanes planes;  // out
};

/// For all of them by one walk through each tree; the planes are the same bits. Takes about 4 kB of stack a proxy.
void planes_in_reach(std::span<const MovingSurface> surfaces, std::span<ReachTask> tasks) noexcept;

}  // namespace haptic::sim
