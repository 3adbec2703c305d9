#include "tool/close_gaps.hpp"

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "tool/bare_depth.hpp"

namespace haptic::sim {
namespace {

constexpr double kKept = 0.9;  // of the radii, within which the net is to be
constexpr double kFinest = 1e-4;
constexpr std::size_t kMostCounted = 1000;

using Corners = std::array<std::uint32_t, 3>;  // of a triangle; of a line, the second and third are the same

bool touch(const Neighbours& neighbours, std::uint32_t a, std::uint32_t b) {
    return std::binary_search(neighbours.begin(), neighbours.end(), std::pair{a, b});
}

std::vector<Corners> net_of(const Neighbours& neighbours) {
    std::vector<Corners> net;
    for (const auto& [a, b] : neighbours) {
        net.push_back({a, b, b});
    }
    for (const auto& [a, b] : neighbours) {
        for (const auto& [first, c] : neighbours) {
            if (first == b && touch(neighbours, a, c)) {
                net.push_back({a, b, c});
            }
        }
    }
    return net;
}

TriangleCorners corners_of(std::span<const Ball> balls, const Corners& t) {
    return {balls[t[0]].centre, balls[t[1]].centre, balls[t[2]].centre};
}

double finest_of(std::span<const Ball> balls) {
    Vec3 low = balls[0].centre;
    Vec3 high = low;
    for (const Ball& ball : balls) {
        low = glm::min(low, ball.centre - ball.radius);
        high = glm::max(high, ball.centre + ball.radius);
    }
    return kFinest * glm::length(high - low);
}

/// `now` with their radii shortened.
std::vector<Ball> kept(const std::vector<Ball>& now) {
    std::vector<Ball> balls = now;
    for (Ball& ball : balls) {
        ball.radius *= kKept;
    }
    return balls;
}

/// Adds the fewest balls evenly along a line that is not covered.
void fill_line(std::span<const Ball> given, const Corners& line, double finest, const Room& room,
               std::vector<Ball>& all) {
    const std::vector<Ball> present = kept(all);
    BareDepth bare(present, finest);
    bare.take(corners_of(given, line));
    if (bare.seen() <= 0.0) {
        return;
    }
    const Ball& from = given[line[0]];
    const Ball& to = given[line[1]];
    const double length = glm::length(to.centre - from.centre);
    for (std::size_t between = 1; between <= kMostCounted; ++between) {
        const double part = 1.0 / static_cast<double>(between + 1);
        // Neighbours are nearest to bare where both are small, at one of the ends.
        const double smaller = std::min(from.radius, to.radius);
        const double beside = smaller + part * (std::max(from.radius, to.radius) - smaller);
        if (part * length > kKept * (smaller + beside)) {
            continue;
        }
        for (std::size_t k = 1; k <= between; ++k) {
            const double at = static_cast<double>(k) * part;
            const Vec3 centre = glm::mix(from.centre, to.centre, at);
            const double radius = std::min(glm::mix(from.radius, to.radius, at), room(centre));
            if (radius > finest) {
                all.push_back({centre, radius});
            }
        }
        return;
    }
    throw std::invalid_argument("tool: closing the gaps takes more than " + std::to_string(kMostCounted) +
                                " spheres; have larger ones");
}

/// Adds a ball where a triangle or line is farthest from the others, until it is covered or has no room.
void fill_rest(std::span<const Ball> given, const Corners& t, double finest, const Room& room, std::vector<Ball>& all) {
    const TriangleCorners corners = corners_of(given, t);
    while (all.size() < kMostCounted) {
        const std::vector<Ball> present = kept(all);
        BareDepth bare(present, finest);
        bare.take(corners);
        if (bare.seen() <= 0.0) {
            return;
        }
        const Vec3 weights = closest_point_on_triangle(bare.farthest(), corners).weights;
        const Vec3 radii(given[t[0]].radius, given[t[1]].radius, given[t[2]].radius);
        const double radius = std::min(glm::dot(weights, radii), room(bare.farthest()));
        if (!(radius > finest)) {
            return;
        }
        all.push_back({bare.farthest(), radius});
    }
}

}  // namespace

double widest_gap(std::span<const Ball> balls, const Neighbours& neighbours) {
    BareDepth bare(balls, finest_of(balls));
    for (const Corners& t : net_of(neighbours)) {
        bare.take(corners_of(balls, t));
    }
    return 2.0 * std::max(0.0, bare.seen());
}

std::vector<Ball> close_gaps(std::span<const Ball> balls, const Neighbours& neighbours, std::size_t most,
                             const Room& room) {
    std::vector<Ball> all(balls.begin(), balls.end());
    const double finest = finest_of(balls);
    for (const Corners& t : net_of(neighbours)) {
        if (t[1] == t[2]) {
            fill_line(balls, t, finest, room, all);
        }
        fill_rest(balls, t, finest, room, all);
    }
    if (all.size() > most) {
        throw std::invalid_argument("tool: closing the gaps between its " + std::to_string(balls.size()) +
                                    " spheres takes " + (all.size() < kMostCounted ? "" : "more than ") +
                                    std::to_string(all.size()) + ", and there may be " + std::to_string(most) +
                                    "; have larger spheres, or fewer where they are close");
    }
    return all;
}

}  // namespace haptic::sim
