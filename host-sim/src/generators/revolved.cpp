#include "generators/revolved.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace haptic::sim {
namespace {

constexpr std::size_t kRingPoints = 32;
constexpr std::size_t kQuarter = kRingPoints / 4;
constexpr double kRingSpacing = 0.5;       // along straight parts, in diameters
constexpr double kMaxSlenderness = 200.0;  // length in diameters

/// A point of the profile, which runs from the pole at -z to that at +z.
struct Outline {
    double z;
    double radius;
};

struct Direction {
    double cosine;
    double sine;
};

/// Unit vectors at equal angles from 0 to 90 degrees. Each is the normalised sum of two known neighbours, so that only
/// square roots are needed.
std::array<Direction, kQuarter + 1> quarter_circle() {
    std::array<Direction, kQuarter + 1> quarter{};
    quarter.front() = {1.0, 0.0};
    quarter.back() = {0.0, 1.0};
    for (std::size_t step = kQuarter / 2; step > 0; step /= 2) {
        for (std::size_t k = step; k < kQuarter; k += 2 * step) {
            const double x = quarter[k - step].cosine + quarter[k + step].cosine;
            const double y = quarter[k - step].sine + quarter[k + step].sine;
            const double length = std::sqrt(x * x + y * y);
            quarter[k] = {x / length, y / length};
        }
    }
    return quarter;
}

Direction around(std::size_t k) {
    static const std::array<Direction, kQuarter + 1> quarter = quarter_circle();
    const Direction& d = quarter[k % kQuarter];
    switch (k % kRingPoints / kQuarter) {
        case 0:
            return d;
        case 1:
            return {-d.sine, d.cosine};
        case 2:
            return {-d.cosine, -d.sine};
        default:
            return {d.sine, -d.cosine};
    }
}

/// Adds rings `first` to `last` of a sphere centred at z; ring 0 is its pole at -z, ring kRingPoints / 2 the other
/// pole.
void add_arc(std::vector<Outline>& outline, double z, double radius, std::size_t first, std::size_t last) {
    for (std::size_t k = first; k <= last; ++k) {
        const Direction d = around(k);
        outline.push_back({z - radius * d.cosine, radius * d.sine});
    }
}

/// Adds the rings of a cylinder between its ends, without the ends.
void add_straight(std::vector<Outline>& outline, double from, double to, double radius) {
    const double wanted = std::ceil((to - from) / (2.0 * kRingSpacing * radius));
    const int rings = static_cast<int>(std::max(wanted, 1.0));
    for (int k = 1; k < rings; ++k) {
        outline.push_back({from + (to - from) * (static_cast<double>(k) / rings), radius});
    }
}

/// The surface over a sequence of rings between two poles.
TriangleMesh revolve(double low, const std::vector<Outline>& rings, double high) {
    TriangleMesh mesh;
    mesh.closed = true;
    mesh.vertices.emplace_back(0.0, 0.0, low);
    for (const Outline& ring : rings) {
        for (std::size_t k = 0; k < kRingPoints; ++k) {
            const Direction d = around(k);
            mesh.vertices.emplace_back(ring.radius * d.cosine, ring.radius * d.sine, ring.z);
        }
    }
    mesh.vertices.emplace_back(0.0, 0.0, high);
    const auto index = [](std::size_t ring, std::size_t k) {
        return static_cast<std::uint32_t>(1 + ring * kRingPoints + k % kRingPoints);
    };
    const std::size_t last = rings.size() - 1;
    const auto top = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
    for (std::size_t k = 0; k < kRingPoints; ++k) {
        mesh.triangles.push_back({0, index(0, k + 1), index(0, k)});
        for (std::size_t ring = 0; ring < last; ++ring) {
            mesh.triangles.push_back({index(ring, k), index(ring, k + 1), index(ring + 1, k + 1)});
            mesh.triangles.push_back({index(ring, k), index(ring + 1, k + 1), index(ring + 1, k)});
        }
        mesh.triangles.push_back({index(last, k), index(last, k + 1), top});
    }
    return mesh;
}

void require(bool holds, const std::string& what) {
    if (!holds) {
        throw std::invalid_argument(what);
    }
}

}  // namespace

TriangleMesh make_sphere_mesh(double radius) {
    require(radius > 0.0 && std::isfinite(radius), "sphere: the radius must be positive");
    std::vector<Outline> outline;
    add_arc(outline, 0.0, radius, 1, kRingPoints / 2 - 1);
    return revolve(-radius, outline, radius);
}

TriangleMesh make_rod_mesh(double length, double thickness) {
    require(thickness > 0.0 && length > thickness && length <= kMaxSlenderness * thickness,
            "rod: thickness must be positive and length between 1 and 200 times the thickness");
    const double radius = 0.5 * thickness;
    const double end = 0.5 * length - radius;  // z of the hemispheres' centres
    std::vector<Outline> outline;
    add_arc(outline, -end, radius, 1, kQuarter);
    add_straight(outline, -end, end, radius);
    add_arc(outline, end, radius, kQuarter, kRingPoints / 2 - 1);
    return revolve(-0.5 * length, outline, 0.5 * length);
}

TriangleMesh make_probe_mesh(double length, double thickness, double ball_radius) {
    const double radius = 0.5 * thickness;
    require(
        thickness > 0.0 && ball_radius > radius && length > 2.0 * ball_radius + radius &&
            length <= kMaxSlenderness * thickness,
        "probe: the ball must be thicker than the shaft, and the length must exceed ball and shaft end and be at most "
        "200 times the thickness");
    const double ball = -0.5 * length + ball_radius;
    const double end = 0.5 * length - radius;
    const double root =
        ball + std::sqrt(ball_radius * ball_radius - radius * radius);  // where the shaft leaves the ball
    std::vector<Outline> outline;
    for (std::size_t k = 1; k < kRingPoints / 2; ++k) {
        const double z = ball - ball_radius * around(k).cosine;
        // Stop before the rings come close to the root of the shaft.
        if (2 * k > kRingPoints / 2 && ball_radius * around(k).sine < 1.1 * radius) {
            break;
        }
        outline.push_back({z, ball_radius * around(k).sine});
    }
    outline.push_back({root, radius});
    add_straight(outline, root, end, radius);
    add_arc(outline, end, radius, kQuarter, kRingPoints / 2 - 1);
    return revolve(-0.5 * length, outline, 0.5 * length);
}

}  // namespace haptic::sim
