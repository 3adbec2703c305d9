#include "generators/triangle_grid.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "haptic/sim/closest_point.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {
namespace {

constexpr double kMaxCellsAlong = 96.0;  // along an axis
constexpr double kNoCrossing = 2.0;

TriangleCorners corners_of(std::span<const Vec3> vertices, const Triangle& t) {
    return {vertices[t[0]], vertices[t[1]], vertices[t[2]]};
}

/// Parameter at which the segment crosses the triangle, its border included.
double crossing(const Vec3& from, const Vec3& to, const TriangleCorners& t, double on_plane) {
    const Vec3 normal = glm::cross(t.b - t.a, t.c - t.a);
    // The ends must lie on different sides of the plane, the start not on it.
    const double before = glm::dot(from - t.a, normal);
    const double after = glm::dot(to - t.a, normal);
    const double limit = on_plane * glm::length(normal);
    if (std::abs(before) <= limit || before * after > 0.0 || before == after) {
        return kNoCrossing;
    }
    // Inside if the segment passes all edges on the same side (signed volumes; Ericson, section 5.3.4).
    const Vec3 displacement = to - from;
    const auto side = [&](const Vec3& p, const Vec3& q) {
        return glm::dot(glm::cross(p - from, q - from), displacement);
    };
    const double u = side(t.a, t.b);
    const double v = side(t.b, t.c);
    const double w = side(t.c, t.a);
    const bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    return inside ? before / (before - after) : kNoCrossing;
}

}  // namespace

TriangleGrid::TriangleGrid(std::span<const Vec3> vertices, std::span<const Triangle> triangles, double cell)
    : vertices_(vertices), triangles_(triangles) {
    const Aabb box = vertices.empty() ? Aabb{Vec3(0.0), Vec3(0.0)} : aabb_of(vertices);
    low_ = box.min;
    for (std::size_t k = 0; k < 3; ++k) {
        const double width = box.max[static_cast<int>(k)] - box.min[static_cast<int>(k)];
        const double cells = std::clamp(std::ceil(width / cell), 1.0, kMaxCellsAlong);
        count_[k] = static_cast<std::size_t>(cells);
        cells_per_metre_[static_cast<int>(k)] = width > 0.0 ? cells / width : 0.0;
    }
    first_.assign(count_[0] * count_[1] * count_[2] + 1, 0);
    // Counting sort: the first pass counts the triangles of each cell, the second fills them in.
    for (const bool filling : {false, true}) {
        for (std::uint32_t t = 0; t < triangles.size(); ++t) {
            const TriangleCorners c = corners_of(vertices, triangles[t]);
            const Aabb around = aabb_of(c.a, c.b, c.c);
            const Cells range = cells_of(around.min, around.max);
            for (std::size_t z = range.low[2]; z <= range.high[2]; ++z) {
                for (std::size_t y = range.low[1]; y <= range.high[1]; ++y) {
                    for (std::size_t x = range.low[0]; x <= range.high[0]; ++x) {
                        std::uint32_t& slot = first_[(z * count_[1] + y) * count_[0] + x];
                        if (filling) {
                            member_[--slot] = t;
                        } else {
                            ++slot;
                        }
                    }
                }
            }
        }
        if (!filling) {
            std::uint32_t sum = 0;
            for (std::uint32_t& slot : first_) {
                sum += slot;
                slot = sum;  // end of the cell; filling counts down from it
            }
            member_.resize(sum);
        }
    }
}

TriangleGrid::Cells TriangleGrid::cells_of(const Vec3& low, const Vec3& high) const {
    Cells range{};
    for (std::size_t k = 0; k < 3; ++k) {
        const int axis = static_cast<int>(k);
        const auto last = static_cast<double>(count_[k] - 1);
        const auto cell = [&](double x) {
            return static_cast<std::size_t>(
                std::clamp(std::floor((x - low_[axis]) * cells_per_metre_[axis]), 0.0, last));
        };
        range.low[k] = cell(low[axis]);
        range.high[k] = cell(high[axis]);
    }
    return range;
}

template <typename Visitor>
void TriangleGrid::visit(const Vec3& low, const Vec3& high, Visitor&& visitor) const {
    const Cells range = cells_of(low, high);
    for (std::size_t z = range.low[2]; z <= range.high[2]; ++z) {
        for (std::size_t y = range.low[1]; y <= range.high[1]; ++y) {
            for (std::size_t x = range.low[0]; x <= range.high[0]; ++x) {
                const std::size_t cell = (z * count_[1] + y) * count_[0] + x;
                for (std::uint32_t m = first_[cell]; m < first_[cell + 1]; ++m) {
                    if (!visitor(corners_of(vertices_, triangles_[member_[m]]))) {
                        return;
                    }
                }
            }
        }
    }
}

double TriangleGrid::first_crossing(const Vec3& from, const Vec3& to, double on_plane) const {
    double first = kNoCrossing;
    visit(glm::min(from, to), glm::max(from, to), [&](const TriangleCorners& t) {
        first = std::min(first, crossing(from, to, t, on_plane));
        return true;
    });
    return first;
}

bool TriangleGrid::near(const Vec3& p, double distance) const {
    bool found = false;
    visit(p - Vec3(distance), p + Vec3(distance), [&](const TriangleCorners& t) {
        found = closest_point_on_triangle(p, t).squared_distance < distance * distance;
        return !found;
    });
    return found;
}

}  // namespace haptic::sim
