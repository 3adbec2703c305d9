// What touches a sphere at an instant, reduced to the half-spaces that matter. Shared by the moves of the proxy.
#pragma once

#include <cstdint>
#include <span>

#include "contact/scratch.hpp"
#include <haptic/sim/closest_point.hpp>
#include <haptic/sim/contact.hpp>
#include "contact/half_spaces.hpp"
#include "haptic/sim/contact/surroundings.hpp"
#include "contact/swept_tree.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

inline constexpr double kArrived = 1e-6;         // of the radius: a move shorter than this is none
inline constexpr double kPlaneTolerance = 1e-9;  // of the radius: a plane violated by less is met
inline constexpr std::size_t kMaxTouching = 48;  // the nearest are kept; more than a dozen were never seen

/// Up to where points count as touched: as far beyond the radius as contacts are found within it, so that two surfaces
/// between which a proxy settles are both seen from wherever the last move was stopped.
[[nodiscard]] inline double touching_reach(double radius, const ContactSettings& settings) noexcept {
    return radius * (1.0 + 2.0 * (1.0 - settings.shrink));
}

/// One touched point.
struct Touching {
    Vec3 point{0.0};
    Vec3 normal{0.0};  // unit, from the point to the centre, or of the face where that bounds more (see gather)
    double distance = 0.0;
    std::uint32_t object = 0;
    std::uint32_t triangle = 0;
    ClosestPoint at;
    TriangleCorners corners;
};

/// Surfaces that were let through in this step: no longer collided with.
struct Ignored {
    static constexpr std::size_t kCapacity = 64;
    struct Entry {
        std::uint32_t object;
        std::uint32_t triangle;  // kWhole: all of the object
    };
    static constexpr std::uint32_t kWhole = 0xffffffffu;
    Scratch<Entry, kCapacity> entries;
    std::size_t count = 0;

    [[nodiscard]] bool has(std::uint32_t object, std::uint32_t triangle) const noexcept {
        for (std::size_t k = 0; k < count; ++k) {
            if (entries[k].object == object && (entries[k].triangle == kWhole || entries[k].triangle == triangle)) {
                return true;
            }
        }
        return false;
    }
    [[nodiscard]] bool add(std::uint32_t object, std::uint32_t triangle) noexcept {
        if (count == kCapacity) {
            return false;
        }
        entries[count++] = {object, triangle};
        return true;
    }
};

class TouchingSet {
  public:
    /// Collects the points within `reach` of a centre at a time of the step, nearest first, each point once, and leaves
    /// out what another one implies: a triangle that is wholly behind the tangent plane of a nearer point is kept at a
    /// distance by that plane. So the inner edges of a flat or convex surface give no planes of their own. Of a
    /// triangle that begins behind such a plane and rises out of it (the other side of a valley) the face is taken:
    /// that is what the sphere will meet, not the border from which it rises.
    void gather(const NearSurfaces& surfaces, double time, const Vec3& center, double reach,
                const Ignored* ignored) noexcept;

    [[nodiscard]] std::span<const Touching> points() const noexcept { return {points_.data(), count_}; }
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
    /// Least distance found, or `otherwise`.
    [[nodiscard]] double clearance(double otherwise) const noexcept {
        return count_ == 0 || points_[0].distance > otherwise ? otherwise : points_[0].distance;
    }

  private:
    void insert(const Touching& found, double same) noexcept;
    void remove_implied(const Vec3& center, double tolerance) noexcept;

    Scratch<Touching, kMaxTouching> points_;
    std::size_t count_ = 0;
};

/// Planes through surface points, still without a radius: dot(normal, x) >= base + radius.
class PlaneSet {
  public:
    void clear() noexcept { count_ = 0; }
    void add(const Vec3& normal, double base) noexcept {
        if (count_ < kMaxTouching) {
            normals_[count_] = normal;
            bases_[count_++] = base;
        }
    }
    [[nodiscard]] std::size_t size() const noexcept { return count_; }
    [[nodiscard]] double height(std::size_t k, const Vec3& x) const noexcept;

    /// Nearest point to the target that is `radius` beyond all planes.
    [[nodiscard]] Projection project(const Vec3& target, double radius) const noexcept;

    struct Room {
        Projection at;
        double radius = 0.0;  // beyond all planes
        bool any = false;     // false: not even `least`
    };
    /// The same with the largest radius up to `radius` that there is room for, at least `least`.
    [[nodiscard]] Room project_with_room(const Vec3& target, double radius, double least) const noexcept;

  private:
    Scratch<Vec3, kMaxTouching> normals_;
    Scratch<double, kMaxTouching> bases_;
    std::size_t count_ = 0;
};

/// Corners of a triangle of a surface at a time of the step.
[[nodiscard]] TriangleCorners corners_of(const SurfaceMotion& motion, std::uint32_t triangle, double time) noexcept;
[[nodiscard]] TriangleCorners corners_of(std::span<const Vec3> vertices, const Triangle& triangle) noexcept;

/// How far along a straight move at the end of the step the sphere comes with `radius`. A triangle that is nearer than
/// the radius already holds it from where it is `release` times as far as now.
[[nodiscard]] double free_fraction(const NearSurfaces& surfaces, const Vec3& from, const Vec3& displacement,
                                   double radius, double release) noexcept;

/// The touched point as the simulation is told of it.
[[nodiscard]] SurfacePoint surface_point(const Touching& touching) noexcept;

/// Displacement over the step of the material point with these weights.
[[nodiscard]] Vec3 displacement_of(const SurfaceMotion& motion, std::uint32_t triangle, const Vec3& weights) noexcept;

}  // namespace haptic::sim
