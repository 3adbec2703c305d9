#include "scene/lone_surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "collision/surface_paths.hpp"
#include "contact/verification.hpp"
#include "haptic/sim/closest_point.hpp"
#include "mesh/mesh_measures.hpp"
#include "mesh/mesh_topology.hpp"
#include "scene/assembly.hpp"

namespace haptic::sim {
namespace {

constexpr double kLeastLagOfEdge = 1.0 / 16.0;  // of the mean edge: a heap at rest lags by less
// s of lag between tests: of what has not jumped, of what need not wait, and after a jump that did not help for long.
constexpr double kTestedAfter = 0.25;
constexpr double kTestedLater = 1.0;
constexpr double kTestedAfterJump = 8.0;
constexpr double kLeft = 0.9;                          // of the lag at the last look: what is less catches up
constexpr int kTestsAlone = 3;                         // in a row, after which a body need not wait
constexpr std::ptrdiff_t kMostInGroup = 16;            // bodies: a test takes longer the more they are
constexpr std::uint64_t kMostTestsPerTriangle = 1000;  // of a search for crossings; more are too many
constexpr double kNearest = 1e-9;                      // m: what comes nearer counts as touching
constexpr double kTouches = 0.01;                      // winding number: what is beside a surface has 0, within it 1
// How far a surface is drawn in, at most: of the distance of its skin from its particles, and of the lag.
constexpr double kDrawnIn = 0.1;
constexpr double kDrawnInOfLag = 0.5;

/// Per body: whether its surface is a sphere that moves.
std::vector<std::uint8_t> moving_spheres(const Assembly& assembly) {
    std::vector<std::uint8_t> are_spheres;
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        const TriangleMesh& mesh = assembly.bodies[b].mesh;
        const bool moves = assembly.is_movable(b) && !assembly.is_sheet(b);
        are_spheres.push_back(moves && detail::is_sphere(mesh.triangles, mesh.vertices.size()) ? 1 : 0);
    }
    return are_spheres;
}

SurfaceCrossings crossings_of(std::span<const std::uint8_t> bodies, const Assembly& assembly) {
    std::vector<CheckedSurface> surfaces(bodies.size());  // of other bodies, nothing
    for (std::size_t b = 0; b < surfaces.size(); ++b) {
        if (bodies[b] != 0) {
            surfaces[b] = {assembly.bodies[b].mesh.triangles, assembly.bodies[b].first_vertex};
        }
    }
    return {surfaces, assembly.mesh.vertices};
}

}  // namespace

LoneSurfaces::LoneSurfaces(const Assembly& assembly)
    : assembly_(assembly),
      surfaces_(assembly.bodies.size()),
      is_sphere_(moving_spheres(assembly)),
      crossings_(crossings_of(is_sphere_, assembly)),
      rooms_(assembly.bodies.size()),
      group_(assembly.bodies.size(), 0) {
    const std::span<const Vec3> at_rest = assembly.mesh.vertices;
    for (std::size_t b = 0; b < surfaces_.size(); ++b) {
        const SceneBody& body = assembly.bodies[b];
        Surface& surface = surfaces_[b];
        if (is_sphere_[b] == 0) {
            continue;
        }
        triangles_ += body.mesh.triangles.size();
        surface.volume = signed_volume(body.mesh);
        const SolidSurface of{.triangles = body.mesh.triangles, .first_vertex = body.first_vertex};
        surface.least_lag = kLeastLagOfEdge * mean_edge_of(of, at_rest);
        surface.wait = kTestedAfter;
        for (std::size_t other = 0; other < surfaces_.size(); ++other) {
            if (is_within(b, other, at_rest) || is_within(other, b, at_rest)) {
                is_sphere_[b] = 0;
            }
        }
    }
    crossings_.make_room(triangles_);
}

bool LoneSurfaces::end_step(std::size_t body, double lag, double step) noexcept {
    Surface& surface = surfaces_[body];
    if (is_sphere_[body] == 0 || !(lag > surface.least_lag)) {
        surface.lagged = surface.lag = 0.0;
        surface.wait = kTestedAfter;
        surface.tests_alone = 0;
        surface.is_due = false;
        return false;
    }
    surface.lagged += step;
    if (!surface.is_due && surface.lagged >= surface.wait) {
        surface.lagged = 0.0;
        const double before = std::exchange(surface.lag, lag);
        surface.is_due = before > 0.0 && lag > kLeft * before;
    }
    return surface.is_due;
}

void LoneSurfaces::begin_test(std::size_t body, bool alone) noexcept {
    Surface& surface = surfaces_[body];
    surface.is_due = false;
    surface.lagged = 0.0;
    surface.tests_alone = alone ? surface.tests_alone + 1 : 0;
    surface.wait = need_not_wait(body) ? kTestedLater : kTestedAfter;
}

void LoneSurfaces::note_jump(std::size_t body) noexcept {
    surfaces_[body].lagged = 0.0;
    surfaces_[body].wait = kTestedAfterJump;
}

bool LoneSurfaces::need_not_wait(std::size_t body) const noexcept {
    return surfaces_[body].tests_alone >= kTestsAlone;
}

bool LoneSurfaces::is_alone(std::size_t body, const LoneTool& tool) noexcept {
    std::ranges::fill(group_, std::uint8_t{0});
    group_[body] = 1;
    room_ = rooms_[body];
    tool_.reset();
    bool are_spheres = is_sphere_[body] != 0;
    for (bool grows = true; grows;) {
        grows = false;
        if (!tool_ && overlaps(tool.reach, room_)) {
            if (!tool.ball) {
                return false;
            }
            tool_ = tool.ball;
            room_.extend(tool.reach);
            grows = true;
        }
        for (std::size_t b = 0; b < rooms_.size(); ++b) {
            if (group_[b] == 0 && overlaps(rooms_[b], room_)) {
                group_[b] = 1;
                room_.extend(rooms_[b]);
                are_spheres = are_spheres && is_sphere_[b] != 0;
                grows = true;
            }
        }
    }
    return are_spheres && std::ranges::count(group_, 1) <= kMostInGroup;
}

void LoneSurfaces::draw_in(std::size_t body, double lag, std::span<Vec3> skin) const noexcept {
    const Skinner::Part part = assembly_.part(body);
    for (std::size_t v = part.first_vertex; v < part.first_vertex + part.vertices; ++v) {
        const SkinVertex& of = assembly_.skin[v];
        Vec3 inward = -skin[v];
        for (std::size_t k = 0; k < SkinVertex::kMax; ++k) {
            inward += of.weight[k] * assembly_.model.position[of.particle[k]];
        }
        const double length = glm::length(inward);
        skin[v] += length > 0.0 ? std::min(kDrawnIn, kDrawnInOfLag * lag / length) * inward : Vec3(0.0);
    }
}

bool LoneSurfaces::may_jump(std::span<std::uint8_t> jumps, std::span<const Vec3> from, std::span<const Vec3> to) {
    if (std::ranges::find(jumps, 1) == jumps.end()) {
        return true;
    }
    bool all = true;
    const auto let_stay = [&](std::size_t b) { all = std::exchange(jumps[b], std::uint8_t{0}) == 0 && all; };
    for (std::size_t b = 0; b < jumps.size(); ++b) {
        if (jumps[b] == 0) {
            continue;
        }
        const std::span<const Vec3> surface = assembly_.surface_of(b, to);
        const double volume = signed_volume(surface, assembly_.bodies[b].mesh.triangles);
        const bool outside_is_out = volume * surfaces_[b].volume > 0.0;
        // The tool is beside it, and was.
        const bool spares_tool =
            !tool_ || (!(std::abs(winding_about(tool_->centre, b, from)) > kTouches) && !touches(*tool_, b, to));
        if (!outside_is_out || !spares_tool || !contains(room_, aabb_of(surface))) {
            let_stay(b);
        }
    }
    // What crosses nothing of another one is beside it, or within it as a whole.
    for (std::size_t b = 0; b < jumps.size(); ++b) {
        for (std::size_t other = 0; other < jumps.size(); ++other) {
            if ((group_[b] & group_[other]) != 0 && (jumps[b] | jumps[other]) != 0 && is_within(b, other, to)) {
                let_stay(b);
                let_stay(other);
            }
        }
    }
    // What touched would be left alone from then on (collision/surface_pairs.hpp).
    const auto let_both_stay = [&](const SurfaceCrossing& c) {
        let_stay(c.object);
        let_stay(c.edge_object);
    };
    const std::uint64_t tests = kMostTestsPerTriangle * triangles_;
    std::ranges::for_each(crossings_.find(to, rounding_of(to) + kNearest, tests), let_both_stay);
    crossings_.for_each_touch(let_both_stay);
    if (!crossings_.complete()) {
        std::ranges::fill(jumps, std::uint8_t{0});
    }
    return all && crossings_.complete();
}

/// Whether the first vertex of a body is within another one, or touches it.
bool LoneSurfaces::is_within(std::size_t body, std::size_t other, std::span<const Vec3> vertices) const noexcept {
    const std::span<const Vec3> of_body = assembly_.surface_of(body, vertices);
    return body != other && !of_body.empty() && std::abs(winding_about(of_body.front(), other, vertices)) > kTouches;
}

/// Of a body's surface about a point.
double LoneSurfaces::winding_about(const Vec3& point, std::size_t body, std::span<const Vec3> vertices) const noexcept {
    const std::span<const Vec3> surface = assembly_.surface_of(body, vertices);
    return overlaps({point, point}, aabb_of(surface))
               ? winding_number(surface, assembly_.bodies[body].mesh.triangles, point)
               : 0.0;
}

/// Whether a surface reaches into a ball, or has it within.
bool LoneSurfaces::touches(const Ball& ball, std::size_t body, std::span<const Vec3> vertices) const noexcept {
    const std::span<const Vec3> surface = assembly_.surface_of(body, vertices);
    const auto is_near = [&](const Triangle& t) {
        const Vec3 nearest =
            closest_point_on_triangle(ball.centre, {surface[t[0]], surface[t[1]], surface[t[2]]}).point;
        return !(glm::distance(nearest, ball.centre) > ball.radius + kNearest);
    };
    return std::ranges::any_of(assembly_.bodies[body].mesh.triangles, is_near) ||
           std::abs(winding_about(ball.centre, body, vertices)) > kTouches;
}

}  // namespace haptic::sim
