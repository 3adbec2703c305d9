// Closed links: keep surfaces from passing between overlapping spheres of a tool (declared in tool_proxies.hpp;
// detection: link_guard.hpp).
//
// A link is the segment between the centres of two such spheres. If a move would take it across a surface, both its
// particles get the plane of that surface through their start as a further barrier and are moved again, as if the link
// were a rod of no thickness. Links that still cross after a few rounds stay where they were. The half-CCD of the
// constraints has no barriers: there, crossing links stay at p_start at once.
#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <span>

#include "contact/contact_points.hpp"
#include "contact/half_spaces.hpp"
#include "contact/link_guard.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

// Rounds of adding barriers. Several are needed: a particle that is blocked may make another of its links cross.
constexpr int kRounds = 4;
// Part of the radius: tolerance of the projection.
constexpr double kTolerance = 1e-9;

/// The point nearest to the goal in the intersection of the planes' half-spaces.
Vec3 nearest_in(const SurfacePlanes& planes, const Vec3& goal, double radius) {
    std::array<HalfSpace, kMaxSurfacePlanes> half_spaces;
    for (std::size_t k = 0; k < planes.count; ++k) {
        half_spaces[k].normal = planes.plane[k].normal;
        half_spaces[k].offset = planes.plane[k].offset;
    }
    return project_onto(std::span(half_spaces).first(planes.count), goal, kTolerance * radius).point;
}

/// `planes` followed by as many of `others` as fit.
SurfacePlanes combined(const SurfacePlanes& planes, const SurfacePlanes& others) {
    SurfacePlanes all = planes;
    for (std::size_t k = 0; k < others.count && all.count < kMaxSurfacePlanes; ++k) {
        all.plane[all.count++] = others.plane[k];
    }
    return all;
}

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
        starts_[i].knots = paths_.empty() ? 0 : paths_[i].knots().size();
    }
}

void ToolProxies::block(std::size_t particle, const SurfacePlane& plane) {
    // The barrier is parallel to the surface and passes through the particle's start: the particle may slide along it.
    Start& start = starts_[particle];
    const ToolProxy& p = particles_[particle];
    SurfacePlane barrier = plane;
    barrier.offset = glm::dot(plane.normal, start.particle.position);
    barrier.velocity = velocity_of(surfaces_, plane, settings_.step);
    if (glm::dot(plane.normal, p.goal) >= barrier.offset) {
        return;  // this particle's goal is on the free side; the other one crosses
    }
    // If all planes are used, the new barrier replaces the last one. Repeat the move from its start within the
    // barriers.
    start.barriers.count = std::min<std::uint32_t>(start.barriers.count, kMaxSurfacePlanes - 1);
    start.barriers.plane[start.barriers.count++] = barrier;
    restore_start(particle);
    move_toward(particle, nearest_in(start.barriers, p.goal, p.radius));
    add_barriers(particle);
}

void ToolProxies::restore_start(std::size_t particle) {
    const Start& start = starts_[particle];
    particles_[particle] = start.particle;
    if (!paths_.empty()) {
        paths_[particle].rewind(start.knots);
    }
}

void ToolProxies::add_barriers(std::size_t particle) {
    const SurfacePlanes& barriers = starts_[particle].barriers;
    if (barriers.count == 0) {
        return;
    }
    ToolProxy& p = particles_[particle];
    p.contacts = combined(barriers, p.contacts);
    p.constrained_goal = nearest_in(p.contacts, p.goal, p.radius);
}

bool ToolProxies::restore_crossing_links() {
    bool any = false;
    for (const auto& [a, b] : links_) {
        const Vec3& from_a = starts_[a].particle.position;
        const Vec3& from_b = starts_[b].particle.position;
        const Vec3& to_a = particles_[a].position;
        const Vec3& to_b = particles_[b].position;
        // A link whose particles are both restored is skipped even if rounding makes it cross, so that the loop ends.
        if ((to_a == from_a && to_b == from_b) || !find_link_hit(surfaces_, {from_a, from_b, to_a, to_b})) {
            continue;
        }
        // The link crosses: return both particles to p_start, and the constraints' positions with them.
        any = true;
        for (const std::size_t i : {std::size_t{a}, std::size_t{b}}) {
            restore_start(i);
            body_.particles.position[i] = particles_[i].position;
        }
    }
    return any;
}

void ToolProxies::block_crossing_links() {
    // Barriers are valid for one step only.
    for (Start& start : starts_) {
        start.barriers.count = 0;
    }
    // Gauss-Seidel over the links: test each with its particles' latest positions, and block those that cross.
    bool crosses = true;
    for (int round = 0; crosses && round < kRounds; ++round) {
        crosses = false;
        for (const auto& [a, b] : links_) {
            const Vec3& from_a = starts_[a].particle.position;
            const Vec3& from_b = starts_[b].particle.position;
            if (const auto hit =
                    find_link_hit(surfaces_, {from_a, from_b, particles_[a].position, particles_[b].position})) {
                crosses = stopped_ = true;
                // Both ends get the plane, so that the whole segment stays on its side.
                block(a, hit->plane);
                block(b, hit->plane);
            }
        }
    }
    // Give up on links that still cross: their particles return to their starts.
    while (crosses && restore_crossing_links()) {
    }
    // Particles back at their start are in contact with their barriers alone.
    for (std::size_t i = 0; crosses && i < starts_.size(); ++i) {
        if (particles_[i].position == starts_[i].particle.position && starts_[i].barriers.count > 0) {
            particles_[i].contacts.count = 0;
            particles_[i].constrained_goal = particles_[i].contact_position = particles_[i].position;
            add_barriers(i);
        }
    }
}

}  // namespace haptic::sim
