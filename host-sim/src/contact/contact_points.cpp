#include "contact/contact_points.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tuple>

#include "contact/swept_sphere.hpp"

namespace haptic::sim {

namespace {

constexpr int kRadiusBisections = 26;  // to 1.5e-8 of the range of radii
constexpr double kFaceShare =
    0.9999;  // min ratio of height above the face's plane to distance of the contact point, to use its normal
constexpr double kRoundingMargin = 1e-6;   // of the radius: above any rounding error
constexpr double kFirstPartRadii = 0.5;    // radii, length of the first part of a long move
constexpr double kMaxFirstFraction = 0.5;  // a first part with a larger fraction of the move saves nothing
constexpr double kSamePoint = 1e-9;        // of the reach: contact points closer together are the same

std::array<std::uint64_t, 3> bits_of(const Vec3& v) noexcept {
    return std::bit_cast<std::array<std::uint64_t, 3>>(v);
}

bool overlaps(const TriangleCorners& t, const Aabb& box) noexcept {
    return overlaps(aabb_of(t.a, t.b, t.c), box);
}

/// Whether the plane of the triangle's face keeps a sphere away from it on the whole move: both ends on one side, at
/// least a radius away. Cheap, and true for most triangles around a sphere on a convex surface.
bool plane_separates(const TriangleCorners& t, const Vec3& from, const Vec3& to, double radius) noexcept {
    const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
    const double h0 = glm::dot(n, from - t.a);
    const double h1 = glm::dot(n, to - t.a);
    const double min_squared = radius * radius * (1.0 + kRoundingMargin) * glm::dot(n, n);
    return h0 * h0 > min_squared && h1 * h1 > min_squared && (h0 > 0.0) == (h1 > 0.0);
}

/// Contact normal. For a point at the centre, which defines no direction, it is the normal of the face.
Vec3 direction(const Vec3& from, const Vec3& to, double distance, const TriangleCorners& t) noexcept {
    if (distance > 0.0) {
        return (to - from) / distance;
    }
    const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
    const double length = std::sqrt(glm::dot(n, n));
    return length > 0.0 ? n / length : Vec3(0.0, 1.0, 0.0);
}

/// Replaces the tangent plane at the triangle's border by the plane of its face, if both are equally far away.
void use_face_normal(ContactPoint& t, const Vec3& center) noexcept {
    const Vec3 n = glm::cross(t.corners.b - t.corners.a, t.corners.c - t.corners.a);
    const double length = std::sqrt(glm::dot(n, n));
    if (!(length > 0.0)) {
        return;
    }
    const Vec3 face = n * ((glm::dot(n, t.normal) < 0.0 ? -1.0 : 1.0) / length);
    // A nearer plane would force the sphere to move.
    if (glm::dot(face, center - t.point) >= kFaceShare * t.distance) {
        t.normal = face;
        t.at.feature = Feature::Face;
    }
}

}  // namespace

TriangleCorners corners_of(const SurfaceMotion& motion, std::uint32_t triangle, double time) noexcept {
    const Triangle& t = motion.triangles[triangle];
    if (time >= 1.0) {
        return corners_of(motion.end, t);
    }
    const double rest = 1.0 - time;
    return {motion.start[t[0]] * rest + motion.end[t[0]] * time, motion.start[t[1]] * rest + motion.end[t[1]] * time,
            motion.start[t[2]] * rest + motion.end[t[2]] * time};
}

Vec3 displacement_of(const SurfaceMotion& motion, std::uint32_t triangle, const Vec3& weights) noexcept {
    const Triangle& t = motion.triangles[triangle];
    return (motion.end[t[0]] - motion.start[t[0]]) * weights.x + (motion.end[t[1]] - motion.start[t[1]]) * weights.y +
           (motion.end[t[2]] - motion.start[t[2]]) * weights.z;
}

SurfacePoint surface_point(const ContactPoint& touching) noexcept {
    return {touching.object, touching.triangle, touching.at.feature, touching.at.weights};
}

ContactPointSet& ContactPointSet::operator=(const ContactPointSet& other) noexcept {
    if (this != &other) {
        count_ = other.count_;
        for (std::size_t k = 0; k < count_; ++k) {
            points_[k] = other.points_[k];
        }
    }
    return *this;
}

void ContactPointSet::collect(const NearSurfaces& surfaces, double time, const Vec3& center, double reach) noexcept {
    // During the step every query is another one.
    LastContacts* last = time >= 1.0 ? surfaces.last_contacts() : nullptr;
    if (last == nullptr) {
        find(surfaces, time, center, reach);
        return;
    }
    // The same sphere again: the phase before has found its points. Only equal bits are the same.
    const bool same = last->known && last->reach == reach && bits_of(last->center) == bits_of(center);
    if (same) {
        *this = last->contacts;
        return;
    }
    find(surfaces, time, center, reach);
    last->known = true;
    last->center = center;
    last->reach = reach;
    last->contacts = *this;
}

void ContactPointSet::find(const NearSurfaces& surfaces, double time, const Vec3& center, double reach) noexcept {
    count_ = 0;
    const SweptSphere sphere(center, center, reach);
    // Before the end of the step, the boxes swept over the whole step are needed.
    const QueryTime when = time >= 1.0 ? QueryTime::EndOfStep : QueryTime::WholeStep;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SurfaceMotion& motion = surfaces[object].motion;
        surfaces.query(object, sphere, when, [&](std::uint32_t triangle) {
            // Cull: box against box, then the plane of the face.
            const TriangleCorners corners = corners_of(motion, triangle, time);
            if (!overlaps(corners, sphere.box) || plane_separates(corners, center, center, reach)) {
                return;
            }
            // Exact closest point; keep it if it is in reach.
            ContactPoint found;
            found.at = closest_point_on_triangle(center, corners);
            found.distance = std::sqrt(found.at.squared_distance);
            if (found.distance > reach) {
                return;
            }
            // Tangent plane of the sphere at the contact: normal from the point to the centre.
            found.point = found.at.point;
            found.normal = direction(found.point, center, found.distance, corners);
            found.object = object;
            found.triangle = triangle;
            found.corners = corners;
            insert(found, kSamePoint * reach);
        });
    }
    remove_implied(center, kSamePoint * reach);
}

void ContactPointSet::insert(const ContactPoint& found, double same) noexcept {
    // Ordered by distance, then by index, so that the result does not depend on the order of the query.
    const auto rank = [](const ContactPoint& t) { return std::tuple{t.distance, t.object, t.triangle}; };
    // A point shared by several triangles (an edge or a vertex) is kept once, with the lowest index.
    for (std::size_t k = 0; k < count_; ++k) {
        const Vec3 separation = points_[k].point - found.point;
        if (glm::dot(separation, separation) <= same * same) {
            if (std::tuple{found.object, found.triangle} < std::tuple{points_[k].object, points_[k].triangle}) {
                points_[k].object = found.object;
                points_[k].triangle = found.triangle;
                points_[k].at = found.at;
                points_[k].corners = found.corners;
            }
            return;
        }
    }
    // Full: drop the farthest.
    if (count_ == kMaxContactPoints) {
        if (rank(points_[count_ - 1]) <= rank(found)) {
            return;
        }
        --count_;
    }
    // Insertion sort.
    std::size_t k = count_++;
    for (; k > 0 && rank(found) < rank(points_[k - 1]); --k) {
        points_[k] = points_[k - 1];
    }
    points_[k] = found;
}

void ContactPointSet::remove_implied(const Vec3& center, double tolerance) noexcept {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < count_; ++k) {
        bool implied = false;
        bool rises = false;
        // Compare with the tangent planes of all nearer points that are kept.
        for (std::size_t i = 0; i < kept && !implied; ++i) {
            const auto above = [&](const Vec3& x) { return glm::dot(points_[i].normal, x - points_[i].point); };
            const TriangleCorners& t = points_[k].corners;
            // Point behind such a plane: the triangle is implied if all of it is behind, and rises out of it if not.
            if (above(points_[k].point) <= tolerance) {
                implied = std::max({above(t.a), above(t.b), above(t.c)}) <= tolerance;
                rises = true;
            }
        }
        if (implied) {
            continue;
        }
        // The other side of a valley: the sphere will meet its face, not the border behind the plane.
        if (rises && points_[k].at.feature != Feature::Face) {
            use_face_normal(points_[k], center);
        }
        points_[kept++] = points_[k];
    }
    count_ = kept;
}

double PlaneSet::height(std::size_t k, const Vec3& x) const noexcept {
    return glm::dot(normals_[k], x) - bases_[k];
}

Projection PlaneSet::project(const Vec3& target, double radius) const noexcept {
    Scratch<HalfSpace, kMaxContactPoints> half_spaces;
    for (std::size_t k = 0; k < count_; ++k) {
        half_spaces[k] = {normals_[k], bases_[k] + radius};
    }
    return project_onto({half_spaces.data(), count_}, target, kPlaneTolerance * radius);
}

PlaneSet::Fit PlaneSet::project_with_largest_radius(const Vec3& target, double radius,
                                                    double min_radius) const noexcept {
    Fit fit;
    // The full radius, if it fits.
    fit.projection = project(target, radius);
    fit.radius = radius;
    fit.feasible = fit.projection.feasible;
    if (fit.feasible) {
        return fit;
    }
    // Otherwise the smallest radius, then bisection up to the largest that fits.
    fit.radius = min_radius;
    fit.projection = project(target, min_radius);
    fit.feasible = fit.projection.feasible;
    double max_radius = radius;
    for (int k = 0; k < kRadiusBisections && fit.feasible; ++k) {
        // Invariant: fit.radius fits, max_radius does not.
        const double middle = 0.5 * (fit.radius + max_radius);
        const Projection at = project(target, middle);
        if (at.feasible) {
            fit.radius = middle;
            fit.projection = at;
        } else {
            max_radius = middle;
        }
    }
    return fit;
}

double free_fraction(const NearSurfaces& surfaces, const Vec3& from, const Vec3& displacement, double radius,
                     double release) noexcept {
    const SweptSphere whole_move(from, from + displacement, radius);
    const double length = std::sqrt(glm::dot(displacement, displacement));
    // Bounds of the move up to the first contact so far: a triangle beyond them can only be met later.
    double fraction = 1.0;
    Vec3 end = from + displacement;
    Aabb box = whole_move.box;
    double max_distance = (radius + length) * (1.0 + kRoundingMargin);
    const auto shorten = [&](double first) {
        fraction = first;
        end = from + displacement * first;
        box = aabb_of_segment(from, end, radius * (1.0 + kRoundingMargin));
        max_distance = (radius + length * first) * (1.0 + kRoundingMargin);
    };
    const auto sweep = [&](const SweptSphere& sphere) {
        for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
            const SurfaceMotion& motion = surfaces[object].motion;
            surfaces.query(object, sphere, QueryTime::EndOfStep, [&](std::uint32_t triangle) {
                // Cull: box, plane of the face, distance.
                const TriangleCorners corners = corners_of(motion.end, motion.triangles[triangle]);
                if (!overlaps(corners, box) || plane_separates(corners, from, end, radius)) {
                    return;
                }
                const double distance = std::sqrt(closest_point_on_triangle(from, corners).squared_distance);
                if (distance > max_distance) {
                    return;
                }
                // Exact sweep; a triangle that starts close may be approached to `release` times its distance.
                const SphereHit hit =
                    sweep_sphere(from, displacement, std::min(radius, release * distance), distance, corners);
                if (hit.hits && hit.fraction < fraction) {
                    shorten(hit.fraction);
                }
            });
        }
    };
    // Long moves in narrow places usually end early. So sweep the first half radius alone: a contact there is the first
    // of the whole move.
    const double first_fraction = kFirstPartRadii * radius / length;
    if (first_fraction < kMaxFirstFraction) {
        sweep(SweptSphere(from, from + displacement * first_fraction, radius * (1.0 + kRoundingMargin)));
        if (fraction < first_fraction * (1.0 - kRoundingMargin)) {
            return fraction;
        }
    }
    sweep(whole_move);
    return fraction;
}

}  // namespace haptic::sim
