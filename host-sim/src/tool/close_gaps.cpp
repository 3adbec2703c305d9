#include "tool/close_gaps.hpp"

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "simd/aabb.hpp"
#include "tool/uncovered_depth.hpp"

namespace haptic::sim {
namespace {

constexpr double kCoveredPart = 0.9;  // part of the radii that must cover the net
constexpr std::size_t kMaxAll = 1000;

using NetTriangle = std::array<std::uint32_t, 3>;  // indices of balls; a segment repeats its second

bool are_neighbours(const Neighbours& neighbours, std::uint32_t a, std::uint32_t b) {
    return std::binary_search(neighbours.begin(), neighbours.end(), std::pair{a, b});
}

/// Segments between neighbours, then triangles between mutual neighbours a < b < c.
std::vector<NetTriangle> net_of(const Neighbours& neighbours) {
    std::vector<NetTriangle> net;
    // Segments.
    for (const auto& [a, b] : neighbours) {
        net.push_back({a, b, b});
    }
    // Triangles: c is a neighbour of both a and b.
    for (const auto& [a, b] : neighbours) {
        for (const auto& [first, c] : neighbours) {
            if (first == b && are_neighbours(neighbours, a, c)) {
                net.push_back({a, b, c});
            }
        }
    }
    return net;
}

TriangleCorners corners_of(std::span<const Ball> balls, const NetTriangle& t) {
    return {balls[t[0]].centre, balls[t[1]].centre, balls[t[2]].centre};
}

double resolution_of(std::span<const Ball> balls) {
    Aabb box;
    for (const Ball& ball : balls) {
        box.extend(Aabb{ball.centre - ball.radius, ball.centre + ball.radius});
    }
    return kCoverResolution * glm::length(box.size());
}

/// The balls with their radii reduced to kCoveredPart.
std::vector<Ball> shrunken(const std::vector<Ball>& full) {
    std::vector<Ball> balls = full;
    for (Ball& ball : balls) {
        ball.radius *= kCoveredPart;
    }
    return balls;
}

/// Adds the fewest evenly spaced balls that cover a segment, if it is not covered.
void fill_line(std::span<const Ball> given, const NetTriangle& line, double resolution, const RadiusLimit& limit,
               std::vector<Ball>& all) {
    // Nothing to do if the balls so far cover the segment with reduced radii.
    const std::vector<Ball> present = shrunken(all);
    UncoveredDepth uncovered(present, resolution);
    uncovered.add(corners_of(given, line));
    if (uncovered.max_seen() <= 0.0) {
        return;
    }
    // Smallest number of balls in between whose spacing lets the reduced radii of neighbours meet.
    const Ball& from = given[line[0]];
    const Ball& to = given[line[1]];
    const double length = glm::length(to.centre - from.centre);
    for (std::size_t between = 1; between <= kMaxAll; ++between) {
        const double part = 1.0 / static_cast<double>(between + 1);
        // Radii are linear along the segment, so the critical pair is the one at its thin end.
        const double smaller = std::min(from.radius, to.radius);
        const double next = smaller + part * (std::max(from.radius, to.radius) - smaller);
        if (part * length > kCoveredPart * (smaller + next)) {
            continue;
        }
        // Place them; the limit may shrink a ball, or leave it out where none may be.
        for (std::size_t k = 1; k <= between; ++k) {
            const double at = static_cast<double>(k) * part;
            const Vec3 centre = glm::mix(from.centre, to.centre, at);
            const double radius = std::min(glm::mix(from.radius, to.radius, at), limit(centre));
            if (radius > resolution) {
                all.push_back({centre, radius});
            }
        }
        return;
    }
    throw std::invalid_argument("tool: closing the gaps needs more than " + std::to_string(kMaxAll) +
                                " spheres; use larger spheres");
}

/// Repeatedly adds a ball at the uncovered point farthest from all balls, until the triangle or segment is covered or
/// no ball may be there. Its radius is interpolated between those at the corners.
void fill_rest(std::span<const Ball> given, const NetTriangle& t, double resolution, const RadiusLimit& limit,
               std::vector<Ball>& all) {
    const TriangleCorners corners = corners_of(given, t);
    while (all.size() < kMaxAll) {
        // Uncovered point farthest from all reduced balls.
        const std::vector<Ball> present = shrunken(all);
        UncoveredDepth uncovered(present, resolution);
        uncovered.add(corners);
        if (uncovered.max_seen() <= 0.0) {
            return;
        }
        // Radius interpolated at that point, within the limit.
        const Vec3 weights = closest_point_on_triangle(uncovered.farthest(), corners).weights;
        const Vec3 radii(given[t[0]].radius, given[t[1]].radius, given[t[2]].radius);
        const double radius = std::min(glm::dot(weights, radii), limit(uncovered.farthest()));
        if (!(radius > resolution)) {
            return;
        }
        all.push_back({uncovered.farthest(), radius});
    }
}

}  // namespace

double widest_gap(std::span<const Ball> balls, const Neighbours& neighbours) {
    UncoveredDepth uncovered(balls, resolution_of(balls));
    for (const NetTriangle& t : net_of(neighbours)) {
        uncovered.add(corners_of(balls, t));
    }
    return 2.0 * std::max(0.0, uncovered.max_seen());
}

std::vector<Ball> close_gaps(std::span<const Ball> balls, const Neighbours& neighbours, std::size_t max_count,
                             const RadiusLimit& limit) {
    // Segments come first in the net; their balls cover most of the triangles too.
    std::vector<Ball> all(balls.begin(), balls.end());
    const double resolution = resolution_of(balls);
    for (const NetTriangle& t : net_of(neighbours)) {
        if (t[1] == t[2]) {
            fill_line(balls, t, resolution, limit, all);
        }
        fill_rest(balls, t, resolution, limit, all);
    }
    // Cover everything first, so that the message can say how many are needed.
    if (all.size() > max_count) {
        throw std::invalid_argument("tool: closing the gaps between its " + std::to_string(balls.size()) +
                                    " spheres needs " + (all.size() < kMaxAll ? "" : "more than ") +
                                    std::to_string(all.size()) + "; the maximum is " + std::to_string(max_count) +
                                    ". Use larger spheres, or fewer where they are close together");
    }
    return all;
}

}  // namespace haptic::sim
