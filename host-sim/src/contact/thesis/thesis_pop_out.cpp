#include "contact/thesis/thesis_pop_out.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <tuple>

#include "contact/contact_points.hpp"

namespace haptic::sim {

namespace {

constexpr double kSliver = 1e-7;   // height over sides below which a triangle is treated as its three edges
constexpr int kMaxPathPops = 128;  // recorded in the path one by one; an eighth of its capacity

/// in_range_triangle_list (lines 1 to 5), sorted by triangle index at the end.
class InRangeList {
  public:
    void insert(std::uint32_t object, std::uint32_t triangle, double squared_distance, const TriangleCorners& corners) {
        // Full: replace the farthest entry if the new triangle is nearer.
        std::size_t at = count_;
        if (count_ < kMaxInRange) {
            ++count_;
        } else {
            at = farthest();
            if (entries_[at].squared_distance <= squared_distance) {
                return;
            }
        }
        entries_[at] = {object, triangle, squared_distance, corners};
    }
    /// The list by object and triangle, prepared for the passes.
    std::span<const InRangeTriangle> ordered() noexcept {
        const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(count_);
        std::sort(entries_.begin(), end, [](const Entry& x, const Entry& y) {
            return std::tuple{x.object, x.triangle} < std::tuple{y.object, y.triangle};
        });
        for (std::size_t k = 0; k < count_; ++k) {
            triangles_[k] = in_range_triangle(entries_[k].corners);
        }
        return {triangles_.data(), count_};
    }

  private:
    struct Entry {
        std::uint32_t object = 0;
        std::uint32_t triangle = 0;
        double squared_distance = 0.0;
        TriangleCorners corners;
    };
    [[nodiscard]] std::size_t farthest() const noexcept {
        std::size_t worst = 0;
        for (std::size_t k = 1; k < count_; ++k) {
            worst = entries_[k].squared_distance > entries_[worst].squared_distance ? k : worst;
        }
        return worst;
    }

    std::array<Entry, kMaxInRange> entries_;
    std::array<InRangeTriangle, kMaxInRange> triangles_;
    std::size_t count_ = 0;
};

/// Vector from the closest point of the triangle's border to p. Only edges with p on their outer side can hold the
/// closest point.
Vec3 from_border(const InRangeTriangle& t, const std::array<bool, 3>& beyond, const Vec3& p) noexcept {
    Vec3 nearest(0.0);
    double min_squared = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
        if (!beyond[k]) {
            continue;
        }
        // Offset from the nearest point of the edge.
        const Vec3 d = p - t.edges[k].from;
        const Vec3 offset = d - t.edges[k].along * std::clamp(glm::dot(d, t.edges[k].along), 0.0, t.edges[k].length);
        const double squared = glm::dot(offset, offset);
        if (squared < min_squared) {
            min_squared = squared;
            nearest = offset;
        }
    }
    return nearest;
}

/// Test of line 9 and CalculatePenetration of line 10: distance and direction from the triangle to the centre, if
/// nearer than `threshold`.
bool penetrates(const InRangeTriangle& t, const Vec3& p, double threshold, double& distance, Vec3& direction) noexcept {
    // Far from the plane: no penetration.
    const double height = glm::dot(t.normal, p - t.edges[0].from);
    if (std::abs(height) >= threshold) {
        return false;
    }
    // Edges with the point on their outer side.
    std::array<bool, 3> beyond{};
    for (std::size_t k = 0; k < 3; ++k) {
        beyond[k] = !(glm::dot(t.edges[k].outward, p - t.edges[k].from) < 0.0);
    }
    // Inside all edges: the face is closest.
    if (!beyond[0] && !beyond[1] && !beyond[2]) {
        distance = std::abs(height);
        direction = height < 0.0 ? -t.normal : t.normal;
        return true;
    }
    // Otherwise an edge or a vertex.
    const Vec3 offset = from_border(t, beyond, p);
    const double squared = glm::dot(offset, offset);
    if (squared >= threshold * threshold) {
        return false;
    }
    distance = std::sqrt(squared);
    direction = distance > 0.0 ? offset / distance : t.normal;
    return true;
}

}  // namespace

InRangeTriangle in_range_triangle(const TriangleCorners& triangle) noexcept {
    const TriangleCorners& t = triangle;
    const Vec3 ab = t.b - t.a;
    const Vec3 ac = t.c - t.a;
    // A sliver has no usable normal.
    Vec3 n = glm::cross(ab, ac);
    if (!(glm::dot(n, n) > kSliver * kSliver * glm::dot(ab, ab) * glm::dot(ac, ac))) {
        n = Vec3(0.0);
    }
    const double length = std::sqrt(glm::dot(n, n));
    InRangeTriangle result;
    result.normal = length > 0.0 ? n / length : Vec3(0.0);
    // Edges with their outward direction in the plane.
    const std::array<Vec3, 4> corners{t.a, t.b, t.c, t.a};
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3 e = corners[k + 1] - corners[k];
        const double along = std::sqrt(glm::dot(e, e));
        result.edges[k] = {corners[k], along > 0.0 ? e / along : Vec3(0.0), along, glm::cross(e, n)};
    }
    return result;
}

ListPopOut pop_out_of_list(std::span<const InRangeTriangle> triangles, const Vec3& center, double radius,
                           const ContactSettings& settings, ProxyPath* path) noexcept {
    const double threshold = radius * settings.shrink;
    const double min_pop = radius * settings.pop_out_minimum;
    ListPopOut result;
    result.position = center;
    Vec3& p = result.position;
    for (; result.iterations < settings.pop_out_limit; ++result.iterations) {
        // One pass (lines 8 to 13).
        const std::int64_t before = result.pops;
        for (const InRangeTriangle& t : triangles) {
            double distance = 0.0;
            Vec3 direction(0.0);
            if (!penetrates(t, p, threshold, distance, direction)) {
                continue;
            }
            // Line 11: move to the full radius, by at least the minimum.
            p += direction * std::max(radius - distance, min_pop);
            ++result.pops;
            if (path != nullptr && result.pops <= kMaxPathPops) {
                path->append(1.0, p);
            }
        }
        // Line 14: no intersection is left.
        if (result.pops == before) {
            break;
        }
    }
    result.clear = result.iterations < settings.pop_out_limit;
    if (path != nullptr && result.pops > kMaxPathPops) {
        path->append(1.0, p);
    }
    return result;
}

PopOut thesis_pop_out(std::span<const MovingSurface> surfaces, const Vec3& center, double radius,
                      const ContactSettings& settings, ProxyPath* path) noexcept {
    const double range = radius * settings.detection_range;
    const Aabb box = aabb_of_segment(center, center, range);
    // Lines 1 to 5: triangles in the detection range, optionally only on the positive side (4.6.1).
    InRangeList list;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SurfaceMotion& motion = surfaces[object].motion;
        surfaces[object].tree->query(box, [&](std::uint32_t triangle) {
            const TriangleCorners t = corners_of(motion.end, motion.triangles[triangle]);
            const double squared = closest_point_on_triangle(center, t).squared_distance;
            if (squared >= range * range) {
                return;
            }
            if (settings.half_space && glm::dot(glm::cross(t.b - t.a, t.c - t.a), center - t.a) < 0.0) {
                return;
            }
            list.insert(object, triangle, squared, t);
        });
    }
    // Lines 6 to 15.
    const ListPopOut popped = pop_out_of_list(list.ordered(), center, radius, settings, path);
    // Clearance of the final position among all surfaces.
    ContactPointSet contacts;
    contacts.collect(surfaces, 1.0, popped.position, radius);
    PopOut result;
    result.position = popped.position;
    result.iterations = popped.iterations;
    result.clearance = contacts.clearance(radius);
    result.overconstrained = result.clearance < radius * settings.shrink;
    return result;
}

}  // namespace haptic::sim
