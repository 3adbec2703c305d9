// Contact points: the surface points near a sphere at one time, reduced to the half-spaces that matter. Shared by all
// moves of the proxy.
#pragma once

#include <cstdint>
#include <span>

#include "contact/contact_candidates.hpp"
#include "contact/half_spaces.hpp"
#include "contact/scratch.hpp"
#include "contact/swept_tree.hpp"
#include "haptic/sim/closest_point.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

inline constexpr double kMinMove = 1e-6;              // of the radius: a shorter move counts as none
inline constexpr double kPlaneTolerance = 1e-9;       // of the radius: a plane violated by less counts as satisfied
inline constexpr std::size_t kMaxContactPoints = 48;  // the nearest are kept; more than a dozen have never been seen

/// Distance up to which points count as contacts, m. The margin beyond the radius is twice the shrink margin, so that a
/// proxy that settles between two surfaces sees both, wherever its last move stopped.
[[nodiscard]] inline double contact_reach(double radius, const ContactSettings& settings) noexcept {
    return radius * (1.0 + 2.0 * (1.0 - settings.shrink));
}

/// One contact point of a sphere.
struct ContactPoint {
    Vec3 point{0.0};        // m
    Vec3 normal{0.0};       // unit, from the point to the centre; or the face's normal (see collect)
    double distance = 0.0;  // m, from the centre
    std::uint32_t object = 0;
    std::uint32_t triangle = 0;
    ClosestPoint at;          // closest point on the triangle
    TriangleCorners corners;  // m, at the time of collect()
};

/// The contact points of a sphere at one time of the step.
class ContactPointSet {
  public:
    ContactPointSet() = default;
    /// Copies only the points there are.
    ContactPointSet(const ContactPointSet& other) noexcept { *this = other; }
    ContactPointSet& operator=(const ContactPointSet& other) noexcept;
    ~ContactPointSet() = default;

    /// Collects the points within `reach` of the centre, nearest first, each point once. Points implied by a nearer one
    /// are left out: a triangle entirely behind the tangent plane of a nearer point cannot be touched. So the inner
    /// edges of a flat or convex surface add no planes. A triangle that starts behind such a plane and rises out of it
    /// (the other side of a valley) contributes the plane of its face once the centre is almost above the border of
    /// that face, because the sphere will meet the face and not the border behind the plane. `time` in [0, 1].
    void collect(const NearSurfaces& surfaces, double time, const Vec3& center, double reach) noexcept;

    [[nodiscard]] std::span<const ContactPoint> points() const noexcept { return {points_.data(), count_}; }
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
    /// Distance of the nearest point, at most `otherwise`.
    [[nodiscard]] double clearance(double otherwise) const noexcept {
        return count_ == 0 || points_[0].distance > otherwise ? otherwise : points_[0].distance;
    }

  private:
    void find(const NearSurfaces& surfaces, double time, const Vec3& center, double reach) noexcept;
    void insert(const ContactPoint& found, double same) noexcept;
    void remove_implied(const Vec3& center, double tolerance) noexcept;

    Scratch<ContactPoint, kMaxContactPoints> points_;
    std::size_t count_ = 0;
};

/// The contact points that a phase of the step found last, at the end of the step. The next phase usually begins where
/// the one before ended: pop-out, then the moves of the tool's equilibrium.
struct LastContacts {
    bool known = false;
    Vec3 center{0.0};    // m
    double reach = 0.0;  // m
    ContactPointSet contacts;
};

/// Planes through surface points, before the radius is added: dot(normal, x) >= base + radius.
class PlaneSet {
  public:
    void clear() noexcept { count_ = 0; }
    void add(const Vec3& normal, double base) noexcept {
        if (count_ < kMaxContactPoints) {
            normals_[count_] = normal;
            bases_[count_++] = base;
        }
    }
    [[nodiscard]] std::size_t size() const noexcept { return count_; }
    /// Height of x above plane k, m, without the radius.
    [[nodiscard]] double height(std::size_t k, const Vec3& x) const noexcept;

    /// Nearest point to the target at least `radius` above all planes.
    [[nodiscard]] Projection project(const Vec3& target, double radius) const noexcept;

    /// Projection with the radius that fits.
    struct Fit {
        Projection projection;
        double radius = 0.0;    // m, distance kept from all planes
        bool feasible = false;  // false: not even the smallest radius fits
    };
    /// project() with the largest radius that fits, between `min_radius` and `radius`.
    [[nodiscard]] Fit project_with_largest_radius(const Vec3& target, double radius, double min_radius) const noexcept;

  private:
    Scratch<Vec3, kMaxContactPoints> normals_;
    Scratch<double, kMaxContactPoints> bases_;
    std::size_t count_ = 0;
};

/// Corners of a triangle of a surface, at a time of the step in [0, 1] or in an array of vertices.
[[nodiscard]] TriangleCorners corners_of(const SurfaceMotion& motion, std::uint32_t triangle, double time) noexcept;
[[nodiscard]] inline TriangleCorners corners_of(std::span<const Vec3> vertices, const Triangle& triangle) noexcept {
    return {vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]};
}

/// Fraction of a straight move, at the end of the step, up to the first contact of a sphere with `radius`. A triangle
/// nearer than radius / release at the start stops the sphere once its distance falls to `release` times the initial
/// one.
[[nodiscard]] double free_fraction(const NearSurfaces& surfaces, const Vec3& from, const Vec3& displacement,
                                   double radius, double release) noexcept;

/// Contact point in the form of the simulation's results.
[[nodiscard]] SurfacePoint surface_point(const ContactPoint& touching) noexcept;

/// Displacement over the step of the material point with these barycentric weights, m.
[[nodiscard]] Vec3 displacement_of(const SurfaceMotion& motion, std::uint32_t triangle, const Vec3& weights) noexcept;

}  // namespace haptic::sim
