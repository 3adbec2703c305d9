// Nothing gets between the spheres of a tool whose gaps are closed: see link_guard.hpp.
//
// A link that would be moved across a surface bars the way of both its spheres: they go to the points nearest to their
// goals beyond the plane through the segment, from where they came from, as if the link were a rod of no thickness.
// What crosses a surface after a few rounds of that stays where it was. The constraints of the tool move no particle
// over a surface either: their particles stay where they were.
#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <span>

#include "contact/half_spaces.hpp"
#include "contact/link_guard.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

// Rounds over all links in which planes bar their ways. A link that is barred may take its neighbours along.
constexpr int kRounds = 4;
// Of the radius.
constexpr double kTolerance = 1e-9;

/// The point nearest to the goal in the half-spaces of planes.
Vec3 nearest_in(const SurfacePlanes& planes, const Vec3& goal, double radius) {
    std::array<HalfSpace, kMaxSurfacePlanes> half_spaces;
    for (std::size_t k = 0; k < planes.count; ++k) {
        half_spaces[k].normal = planes.plane[k].normal;
        half_spaces[k].offset = planes.plane[k].offset;
    }
    return project_onto(std::span(half_spaces).first(planes.count), goal, kTolerance * radius).point;
}

/// The planes, and behind them as many of the others as there is room for.
SurfacePlanes together(const SurfacePlanes& planes, const SurfacePlanes& others) {
    SurfacePlanes all = planes;
    for (std::size_t k = 0; k < others.count && all.count < kMaxSurfacePlanes; ++k) {
        all.plane[all.count++] = others.plane[k];
    }
    return all;
}

/// m/s, of the touched point along the plane's normal.
double velocity_of(std::span<const MovingSurface> surfaces, const SurfacePlane& plane, double step) {
    const SurfaceMotion& motion = surfaces[plane.touched.object].motion;
    const Triangle& corners = motion.triangles[plane.touched.triangle];
    Vec3 travel(0.0);
    for (std::size_t k = 0; k < 3; ++k) {
        travel += plane.touched.weights[static_cast<int>(k)] * (motion.end[corners[k]] - motion.start[corners[k]]);
    }
    return glm::dot(plane.normal, travel) / step;
}

}  // namespace

void ToolProxies::find_links() {
    for (std::uint32_t a = 0; a < particles_.size(); ++a) {
        for (std::uint32_t b = a + 1; b < particles_.size(); ++b) {
            const ToolParticle& p = particles_[a];
            const ToolParticle& q = particles_[b];
            if (glm::length(p.rest_offset - q.rest_offset) < p.radius + q.radius) {
                links_.push_back({a, b});
            }
        }
    }
    starts_.resize(links_.empty() ? 0 : particles_.size());
}

void ToolProxies::begin_links() {
    for (std::size_t i = 0; i < starts_.size(); ++i) {
        starts_[i].particle = particles_[i];
        starts_[i].knots = paths_.empty() ? 0 : paths_[i].knots().size();
    }
}

void ToolProxies::bar(std::size_t particle, const SurfacePlane& plane) {
    Start& start = starts_[particle];
    const ToolParticle& p = particles_[particle];
    SurfacePlane bar = plane;
    bar.offset = glm::dot(plane.normal, start.particle.position);
    bar.velocity = velocity_of(surfaces_, plane, settings_.step);
    if (glm::dot(plane.normal, p.goal) >= bar.offset) {
        return;  // the other one goes beyond
    }
    start.bars.count = std::min<std::uint32_t>(start.bars.count, kMaxSurfacePlanes - 1);
    start.bars.plane[start.bars.count++] = bar;
    put_back(particle);
    move_toward(particle, nearest_in(start.bars, p.goal, p.radius));
    keep_bars(particle);
}

void ToolProxies::put_back(std::size_t particle) {
    const Start& start = starts_[particle];
    particles_[particle] = start.particle;
    if (!paths_.empty()) {
        paths_[particle].rewind(start.knots);
    }
}

void ToolProxies::keep_bars(std::size_t particle) {
    const SurfacePlanes& bars = starts_[particle].bars;
    if (bars.count == 0) {
        return;
    }
    ToolParticle& p = particles_[particle];
    p.contacts = together(bars, p.contacts);
    p.held_at = nearest_in(p.contacts, p.goal, p.radius);
}

bool ToolProxies::put_back_what_crosses() {
    bool any = false;
    for (const auto& [a, b] : links_) {
        const Vec3& from_a = starts_[a].particle.position;
        const Vec3& from_b = starts_[b].particle.position;
        const Vec3& to_a = particles_[a].position;
        const Vec3& to_b = particles_[b].position;
        // What is back already cannot go farther back, whatever rounding says: so this ends.
        if ((to_a == from_a && to_b == from_b) || !find_link_hit(surfaces_, {from_a, from_b, to_a, to_b})) {
            continue;
        }
        any = true;
        for (const std::size_t i : {std::size_t{a}, std::size_t{b}}) {
            put_back(i);
            body_.particles.position[i] = particles_[i].position;
        }
    }
    return any;
}

void ToolProxies::keep_links() {
    for (Start& start : starts_) {
        start.bars.count = 0;
    }
    bool crosses = true;
    for (int round = 0; crosses && round < kRounds; ++round) {
        crosses = false;
        for (const auto& [a, b] : links_) {
            const Vec3& from_a = starts_[a].particle.position;
            const Vec3& from_b = starts_[b].particle.position;
            if (const auto hit =
                    find_link_hit(surfaces_, {from_a, from_b, particles_[a].position, particles_[b].position})) {
                crosses = stopped_ = true;
                bar(a, hit->plane);
                bar(b, hit->plane);
            }
        }
    }
    while (crosses && put_back_what_crosses()) {
    }
    for (std::size_t i = 0; crosses && i < starts_.size(); ++i) {
        if (particles_[i].position == starts_[i].particle.position && starts_[i].bars.count > 0) {
            particles_[i].contacts.count = 0;
            particles_[i].held_at = particles_[i].touches_at = particles_[i].position;
            keep_bars(i);
        }
    }
}

}  // namespace haptic::sim
