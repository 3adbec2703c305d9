#include "contact/touching.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tuple>

#include "contact/swept_sphere.hpp"

namespace haptic::sim {

namespace {

constexpr int kRoomBisections = 26;    // to 1e-8 of the radius
constexpr double kFaceShare = 0.9999;  // of the distance to the border that the face must be away
constexpr double kBeside = 1e-6;       // of the radius: more than rounding can make up
constexpr double kFirstPart = 0.5;     // radii, of a long move
constexpr double kWorthParting = 0.5;  // a first part that is a larger share of the move saves nothing
constexpr double kSame = 1e-9;         // of the reach: touched points nearer to one another are the same

bool overlaps(const TriangleCorners& t, const Box& box) noexcept {
    const Vec3 low = glm::min(t.a, glm::min(t.b, t.c));
    const Vec3 high = glm::max(t.a, glm::max(t.b, t.c));
    return low.x <= box.high.x && high.x >= box.low.x && low.y <= box.high.y && high.y >= box.low.y &&
           low.z <= box.high.z && high.z >= box.low.z;
}

/// Whether a plane alone keeps a sphere off the triangle all the way: that of its face, with the sphere on one side of
/// it. Cheap, and true of most triangles round a sphere that lies on a convex surface.
bool stays_beside(const TriangleCorners& t, const Vec3& from, const Vec3& to, double radius) noexcept {
    const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
    const double h0 = glm::dot(n, from - t.a);
    const double h1 = glm::dot(n, to - t.a);
    const double least = radius * radius * (1.0 + kBeside) * glm::dot(n, n);
    return h0 * h0 > least && h1 * h1 > least && (h0 > 0.0) == (h1 > 0.0);
}

/// A touched point right at the centre has no direction: the face's own normal has to do.
Vec3 direction(const Vec3& from, const Vec3& to, double distance, const TriangleCorners& t) noexcept {
    if (distance > 0.0) {
        return (to - from) / distance;
    }
    const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
    const double length = std::sqrt(glm::dot(n, n));
    return length > 0.0 ? n / length : Vec3(0.0, 1.0, 0.0);
}

/// Lets the face bound the proxy in place of the tangent plane at its border, where the proxy is clear of both.
void take_face(Touching& t, const Vec3& center) noexcept {
    const Vec3 n = glm::cross(t.corners.b - t.corners.a, t.corners.c - t.corners.a);
    const double length = std::sqrt(glm::dot(n, n));
    if (!(length > 0.0)) {
        return;
    }
    const Vec3 up = n * ((glm::dot(n, t.normal) < 0.0 ? -1.0 : 1.0) / length);
    // As far as the sphere goes, so that the exchange never asks it to move.
    if (glm::dot(up, center - t.point) >= kFaceShare * t.distance) {
        t.normal = up;
        t.at.feature = Feature::Face;
    }
}

}  // namespace

TriangleCorners corners_of(std::span<const Vec3> vertices, const Triangle& t) noexcept {
    return {vertices[t[0]], vertices[t[1]], vertices[t[2]]};
}

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

SurfacePoint surface_point(const Touching& touching) noexcept {
    return {touching.object, touching.triangle, touching.at.feature, touching.at.weights};
}

void TouchingSet::gather(const NearSurfaces& surfaces, double time, const Vec3& center, double reach,
                         const Ignored* ignored) noexcept {
    count_ = 0;
    const SweptBall ball(center, center, reach);
    const When when = time >= 1.0 ? When::End : When::Step;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SurfaceMotion& motion = surfaces[object].motion;
        surfaces.query(object, ball, when, [&](std::uint32_t triangle) {
            const TriangleCorners corners = corners_of(motion, triangle, time);
            if (!overlaps(corners, ball.box) || stays_beside(corners, center, center, reach)) {
                return;
            }
            Touching found;
            found.at = closest_point_on_triangle(center, corners);
            found.distance = std::sqrt(found.at.squared_distance);
            if (found.distance > reach || (ignored != nullptr && ignored->has(object, triangle))) {
                return;
            }
            found.point = found.at.point;
            found.normal = direction(found.point, center, found.distance, corners);
            found.object = object;
            found.triangle = triangle;
            found.corners = corners;
            insert(found, kSame * reach);
        });
    }
    remove_implied(center, kSame * reach);
}

void TouchingSet::insert(const Touching& found, double same) noexcept {
    const auto id = [](const Touching& t) { return std::tuple{t.distance, t.object, t.triangle}; };
    for (std::size_t k = 0; k < count_; ++k) {
        const Vec3 apart = points_[k].point - found.point;
        if (glm::dot(apart, apart) <= same * same) {
            if (std::tuple{found.object, found.triangle} < std::tuple{points_[k].object, points_[k].triangle}) {
                points_[k].object = found.object;
                points_[k].triangle = found.triangle;
                points_[k].at = found.at;
                points_[k].corners = found.corners;
            }
            return;
        }
    }
    if (count_ == kMaxTouching) {
        if (id(points_[count_ - 1]) <= id(found)) {
            return;
        }
        --count_;
    }
    std::size_t k = count_++;
    for (; k > 0 && id(found) < id(points_[k - 1]); --k) {
        points_[k] = points_[k - 1];
    }
    points_[k] = found;
}

void TouchingSet::remove_implied(const Vec3& center, double tolerance) noexcept {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < count_; ++k) {
        bool implied = false;
        bool rises = false;
        for (std::size_t i = 0; i < kept && !implied; ++i) {
            const auto above = [&](const Vec3& x) { return glm::dot(points_[i].normal, x - points_[i].point); };
            const TriangleCorners& t = points_[k].corners;
            if (above(points_[k].point) <= tolerance) {
                implied = std::max({above(t.a), above(t.b), above(t.c)}) <= tolerance;
                rises = true;
            }
        }
        if (implied) {
            continue;
        }
        if (rises && points_[k].at.feature != Feature::Face) {
            take_face(points_[k], center);
        }
        points_[kept++] = points_[k];
    }
    count_ = kept;
}

double PlaneSet::height(std::size_t k, const Vec3& x) const noexcept {
    return glm::dot(normals_[k], x) - bases_[k];
}

Projection PlaneSet::project(const Vec3& target, double radius) const noexcept {
    Scratch<HalfSpace, kMaxTouching> half_spaces;
    for (std::size_t k = 0; k < count_; ++k) {
        half_spaces[k] = {normals_[k], bases_[k] + radius};
    }
    return project_onto({half_spaces.data(), count_}, target, kPlaneTolerance * radius);
}

PlaneSet::Room PlaneSet::project_with_room(const Vec3& target, double radius, double least) const noexcept {
    Room room;
    room.at = project(target, radius);
    room.radius = radius;
    room.any = room.at.feasible;
    if (room.any) {
        return room;
    }
    room.radius = least;
    room.at = project(target, least);
    room.any = room.at.feasible;
    double most = radius;
    for (int k = 0; k < kRoomBisections && room.any; ++k) {
        const double middle = 0.5 * (room.radius + most);
        const Projection at = project(target, middle);
        if (at.feasible) {
            room.radius = middle;
            room.at = at;
        } else {
            most = middle;
        }
    }
    return room;
}

double free_fraction(const NearSurfaces& surfaces, const Vec3& from, const Vec3& displacement, double radius,
                     double release) noexcept {
    double fraction = 1.0;
    const Vec3 to = from + displacement;
    const SweptBall all(from, to, radius);
    const double length = std::sqrt(glm::dot(displacement, displacement));
    const double farthest = (radius + length) * (1.0 + kBeside);
    const auto sweep = [&](const SweptBall& ball) {
        for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
            const SurfaceMotion& motion = surfaces[object].motion;
            surfaces.query(object, ball, When::End, [&](std::uint32_t triangle) {
                const TriangleCorners corners = corners_of(motion.end, motion.triangles[triangle]);
                if (!overlaps(corners, all.box) || stays_beside(corners, from, to, radius)) {
                    return;
                }
                const double distance = std::sqrt(closest_point_on_triangle(from, corners).squared_distance);
                if (distance > farthest) {
                    return;
                }
                const SphereHit hit =
                    sweep_sphere(from, displacement, std::min(radius, release * distance), distance, corners);
                if (hit.hits) {
                    fraction = std::min(fraction, hit.fraction);
                }
            });
        }
    };
    // Most long moves in narrow places end soon: what is first on the first part is first on the whole way.
    const double share = kFirstPart * radius / length;
    if (share < kWorthParting) {
        sweep(SweptBall(from, from + displacement * share, radius * (1.0 + kBeside)));
        if (fraction < share * (1.0 - kBeside)) {
            return fraction;
        }
    }
    sweep(all);
    return fraction;
}

}  // namespace haptic::sim
