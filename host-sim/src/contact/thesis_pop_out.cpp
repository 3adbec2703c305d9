#include "haptic/sim/contact/thesis_pop_out.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <tuple>

#include "contact/touching.hpp"

namespace haptic::sim {

namespace {

constexpr int kShownPops = 128;  // that the path shows one by one; a quarter of what it holds

/// Lines 1 to 5, in the order of the triangles.
class InRangeList {
  public:
    void insert(std::uint32_t object, std::uint32_t triangle, double squared_distance, const TriangleCorners& corners) {
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

}  // namespace

InRangeTriangle in_range_triangle(const TriangleCorners& corners) noexcept {
    const Vec3 n = glm::cross(corners.b - corners.a, corners.c - corners.a);
    const double length = std::sqrt(glm::dot(n, n));
    return {corners, length > 0.0 ? n / length : Vec3(0.0)};
}

PoppedThrough pop_through(std::span<const InRangeTriangle> triangles, const Vec3& center, double radius,
                          const ContactSettings& settings, ProxyPath* path) noexcept {
    const double found = radius * settings.shrink;
    const double least = radius * settings.pop_out_minimum;
    PoppedThrough result;
    result.position = center;
    Vec3& p = result.position;
    for (; result.iterations < settings.pop_out_limit; ++result.iterations) {
        const std::int64_t before = result.pops;
        for (const InRangeTriangle& t : triangles) {
            if (std::abs(glm::dot(t.normal, p - t.corners.a)) >= found) {
                continue;  // its plane alone is too far away
            }
            const ClosestPoint nearest = closest_point_on_triangle(p, t.corners);
            if (nearest.squared_distance >= found * found) {
                continue;
            }
            const double distance = std::sqrt(nearest.squared_distance);
            const Vec3 direction = distance > 0.0 ? (p - nearest.point) / distance : t.normal;
            p += direction * std::max(radius - distance, least);
            ++result.pops;
            if (path != nullptr && result.pops <= kShownPops) {
                path->append(1.0, p);
            }
        }
        if (result.pops == before) {
            break;
        }
    }
    result.clear = result.iterations < settings.pop_out_limit;
    if (path != nullptr && result.pops > kShownPops) {
        path->append(1.0, p);
    }
    return result;
}

PopOut thesis_pop_out(std::span<const MovingSurface> surfaces, const Vec3& center, double radius,
                      const ContactSettings& settings, ProxyPath* path) noexcept {
    const double range = radius * settings.detection_range;
    const Box box = box_about(center, center, range);
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
    const PoppedThrough popped = pop_through(list.ordered(), center, radius, settings, path);
    TouchingSet touching;
    touching.gather(surfaces, 1.0, popped.position, radius, nullptr);
    PopOut result;
    result.position = popped.position;
    result.iterations = popped.iterations;
    result.clearance = touching.clearance(radius);
    result.squeezed = result.clearance < radius * settings.shrink;
    return result;
}

}  // namespace haptic::sim
