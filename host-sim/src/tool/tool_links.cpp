// Closed links: keep surfaces from passing between overlapping spheres of a tool (declared in tool_proxies.hpp;
// detection: link_guard.hpp).
//
// A link is the segment between the centres of two such spheres. If a move takes it across a surface, both its
// particles (of an elastic tool, all) return to where the move began, and the plane of that surface through there, a
// barrier, joins the rows of the contact problem for the rest of the step, as if the link were a rod of no thickness.
// The equilibrium then has the link on its side of the surface.
#include <algorithm>
#include <glm/geometric.hpp>
#include <span>

#include "contact/contact_points.hpp"
#include "contact/link_guard.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

/// m/s: velocity of the touched point along the plane's normal, mean over the step.
double velocity_of(std::span<const MovingSurface> surfaces, const SurfacePlane& plane, double step) {
    const SurfacePoint& touched = plane.touched;
    const Vec3 displacement = displacement_of(surfaces[touched.object].motion, touched.triangle, touched.weights);
    return glm::dot(plane.normal, displacement) / step;
}

}  // namespace

void ToolProxies::find_closed_links() {
    for (std::uint32_t a = 0; a < particles_.size(); ++a) {
        for (std::uint32_t b = a + 1; b < particles_.size(); ++b) {
            // Spheres that overlap in the rest shape.
            const ToolProxy& p = particles_[a];
            const ToolProxy& q = particles_[b];
            if (glm::length(p.rest_offset - q.rest_offset) < p.radius + q.radius) {
                links_.push_back({a, b});
            }
        }
    }
    starts_.resize(links_.empty() ? 0 : particles_.size());
}

void ToolProxies::record_starts() {
    for (std::size_t i = 0; i < starts_.size(); ++i) {
        starts_[i].particle = particles_[i];
        starts_[i].grip = grips_[i];
        starts_[i].knots = paths_.empty() ? 0 : paths_[i].knots().size();
    }
}

void ToolProxies::restore_start(std::size_t particle) {
    const Start& start = starts_[particle];
    particles_[particle] = start.particle;
    grips_[particle] = start.grip;
    if (!paths_.empty()) {
        paths_[particle].rewind(start.knots);
    }
}

void ToolProxies::add_barrier(std::size_t particle, const SurfacePlane& plane) {
    // Parallel to the surface, through the particle's start: the particle may slide along it.
    SurfacePlane barrier = plane;
    barrier.offset = glm::dot(plane.normal, starts_[particle].particle.position);
    barrier.velocity = velocity_of(surfaces_, plane, settings_.step);
    if (glm::dot(plane.normal, target_[particle]) >= barrier.offset) {
        return;  // this particle's target is on the free side; the other one crosses
    }
    // If all planes are used, the new one replaces the last.
    SurfacePlanes& barriers = barriers_[particle];
    barriers.count = std::min<std::uint32_t>(barriers.count + 1, kMaxSurfacePlanes);
    barriers.plane[barriers.count - 1] = barrier;
}

/// Contacts of a particle that has returned to its start: all its barriers, then the other planes that it had there, as
/// many as fit.
void ToolProxies::put_barriers_first(std::size_t particle) {
    SurfacePlanes contacts = barriers_[particle];
    const SurfacePlanes& before = starts_[particle].particle.contacts;
    for (std::size_t c = barrier_rows_[particle]; c < before.count && contacts.count < kMaxSurfacePlanes; ++c) {
        contacts.plane[contacts.count++] = before.plane[c];
    }
    particles_[particle].contacts = contacts;
}

void ToolProxies::restore_crossing_links() {
    // Restoring one link may make another one cross; each pass restores at least one more particle.
    for (bool any = true; any;) {
        any = false;
        for (const auto& [a, b] : links_) {
            const Vec3 from_a = starts_[a].particle.position;
            const Vec3 from_b = starts_[b].particle.position;
            const Vec3& to_a = particles_[a].position;
            const Vec3& to_b = particles_[b].position;
            // A link whose particles are both restored is skipped even if rounding makes it cross, so that this ends.
            if (to_a == from_a && to_b == from_b) {
                continue;
            }
            const auto hit = find_link_hit(surfaces_, {from_a, from_b, to_a, to_b});
            if (!hit) {
                continue;
            }
            any = true;
            for (const std::size_t i : {std::size_t{a}, std::size_t{b}}) {
                restore_start(i);
                add_barrier(i, hit->plane);
                put_barriers_first(i);
            }
        }
    }
}

bool ToolProxies::restore_if_link_crosses() {
    bool crosses = false;
    for (const auto& [a, b] : links_) {
        const auto hit = find_link_hit(surfaces_, {starts_[a].particle.position, starts_[b].particle.position,
                                                   particles_[a].position, particles_[b].position});
        if (hit) {
            crosses = true;
            add_barrier(a, hit->plane);
            add_barrier(b, hit->plane);
        }
    }
    // The whole tool returns, so that it keeps its shape.
    for (std::size_t i = 0; crosses && i < particles_.size(); ++i) {
        restore_start(i);
    }
    return crosses;
}

}  // namespace haptic::sim
