#include "contact/triangle_ccd.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

namespace haptic::sim {

namespace {

constexpr double kContactTolerance = 1e-12;  // of the radius: a smaller gap is a contact
constexpr double kRounding = 8e-16;          // of the coordinates: distances are not known better
constexpr int kFineIterations = 200;         // after these, kCreepTolerance replaces kContactTolerance
constexpr int kMaxIterations = 2000;         // then the triangle counts as touching; not reached in 10^8 random queries
constexpr double kLongerThanStep = 2.0;
constexpr double kPassedCosine = 0.9;    // above this cosine the triangle has passed the centre face-on
constexpr double kOblique = 1e-3;        // of the coordinates: at a smaller distance the normal is orthogonalised first
constexpr double kPassageShare = 1e-11;  // of the triangle's extent: radius that represents a point

/// Largest norm of three vectors.
double longest(const TriangleCorners& t) HAPTIC_RT {
    return std::sqrt(std::max({glm::dot(t.a, t.a), glm::dot(t.b, t.b), glm::dot(t.c, t.c)}));
}

/// Corners at a time, from their start and their displacement over the step.
TriangleCorners moved(const TriangleCorners& from, const TriangleCorners& motion, double time) HAPTIC_RT {
    return {from.a + motion.a * time, from.b + motion.b * time, from.c + motion.c * time};
}

Vec3 lower(const Vec3& a, const Vec3& b) HAPTIC_RT {
    return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}

Vec3 upper(const Vec3& a, const Vec3& b) HAPTIC_RT {
    return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}

/// Whether the box of the whole motion is disjoint from the box of the sphere at the origin.
bool boxes_disjoint(const TriangleCorners& s, const TriangleCorners& motion, double radius) HAPTIC_RT {
    const auto misses = [radius](const Vec3& low, const Vec3& high) {
        return std::max({low.x, low.y, low.z}) > radius || std::min({high.x, high.y, high.z}) < -radius;
    };
    // Most triangles that a query passes on are near from the start.
    const Vec3 low = lower(s.a, lower(s.b, s.c));
    const Vec3 high = upper(s.a, upper(s.b, s.c));
    if (!misses(low, high)) {
        return false;
    }
    const TriangleCorners e = moved(s, motion, 1.0);
    return misses(lower(low, lower(e.a, lower(e.b, e.c))), upper(high, upper(e.a, upper(e.b, e.c))));
}

/// Makes a direction orthogonal to the touched face or edge. Any unit vector gives a safe bound. But if the closest
/// point is very near, rounding tilts its direction into the triangle, and only the orthogonal one bounds well.
[[gnu::noinline]] Vec3 orthogonalized(const Vec3& n, const ClosestPoint& at, const TriangleCorners& t) HAPTIC_RT {
    // Face: its normal, on the side of n. Edge: remove the component along it. Vertex: unchanged.
    Vec3 normal = n;
    if (at.feature == Feature::Face) {
        normal = glm::cross(t.b - t.a, t.c - t.a);
        normal = glm::dot(normal, n) < 0.0 ? -normal : normal;
    } else if (at.feature == Feature::Edge) {
        const Vec3 e = at.index == 0 ? t.b - t.a : (at.index == 1 ? t.c - t.b : t.a - t.c);
        const double ee = glm::dot(e, e);
        normal -= ee > 0.0 ? e * (glm::dot(n, e) / ee) : Vec3(0.0);
    }
    const double length = std::sqrt(glm::dot(normal, normal));
    return length > 0.0 ? normal / length : n;
}

/// Unit direction from the closest point to the origin.
inline Vec3 direction_of(const ClosestPoint& at, double distance, double min_distance,
                         const TriangleCorners& t) HAPTIC_RT {
    const Vec3 n = at.point * (-1.0 / distance);
    return distance >= min_distance ? n : orthogonalized(n, at, t);
}

/// Time for which all corners stay beyond the plane at distance `radius` from the origin that faces the closest point.
/// `n` is unit, from the closest point to the origin.
double time_to_plane(const Vec3& n, double radius, const TriangleCorners& now,
                     const TriangleCorners& motion) HAPTIC_RT {
    double first = kLongerThanStep;
    for (const auto& [x, dx] : {std::pair{now.a, motion.a}, std::pair{now.b, motion.b}, std::pair{now.c, motion.c}}) {
        const double rate = glm::dot(n, dx);
        const double gap = -glm::dot(n, x) - radius;
        if (gap < 0.0) {
            return 0.0;  // rounding of n: the plane does not separate, so it bounds nothing
        }
        if (rate > 0.0 && gap < first * rate) {
            first = gap / rate;
        }
    }
    return first;
}

/// Whether a plane whose normal rotates linearly from n0 to n1 separates triangle and sphere from `now` to `later`.
/// With c = dot(n0, n1), the length of the normal is at most the quadratic with Bernstein coefficients 1, (1 + c)/2, 1.
/// dot(n(s), x(s)) is a quadratic too, so comparing coefficients compares the functions.
bool separated(const Vec3& n0, const Vec3& n1, double radius, const TriangleCorners& now,
               const TriangleCorners& later) HAPTIC_RT {
    const double middle = radius * (1.0 + glm::dot(n0, n1));
    for (const auto& [x0, x1] : {std::pair{now.a, later.a}, std::pair{now.b, later.b}, std::pair{now.c, later.c}}) {
        if (-glm::dot(n0, x0) < radius || -glm::dot(n1, x1) < radius ||
            -(glm::dot(n0, x1) + glm::dot(n1, x0)) < middle) {
            return false;
        }
    }
    return middle > 0.0;
}

/// Zero where the plane of the triangle passes through the origin.
double determinant(const TriangleCorners& t) HAPTIC_RT {
    return glm::dot(t.a, glm::cross(t.b, t.c));
}

/// First contact with a sphere at the origin, by conservative advancement.
TriangleTouch advance(const TriangleCorners& start, const TriangleCorners& motion, double radius, double limit,
                      double release) HAPTIC_RT {
    // Initial distance. The release lets a triangle that starts close come nearer before it counts as a contact.
    TriangleTouch touch{.at = closest_point_on_triangle(Vec3(0.0), start), .iterations = 1};
    double distance = std::sqrt(touch.at.squared_distance);
    const double threshold = std::min(radius, release * distance);
    if (distance <= threshold) {
        // Touches from the start, within any tolerance.
        touch.touches = true;
        return touch;
    }
    TriangleCorners now = start;
    // Lipschitz bound of the distance, and tolerances relative to the coordinates.
    const double fastest = longest(motion);
    const double extent = longest(start) + fastest;
    const double rounding = kRounding * extent;
    const double oblique = kOblique * extent;
    double max_leap = limit;  // longest leap worth trying
    bool overshot = false;
    for (;; ++touch.iterations) {
        // Contact: the gap is within tolerance. After kFineIterations the tolerance is relaxed, so that the loop ends.
        const double gap = distance - threshold;
        const double tolerance =
            (touch.iterations <= kFineIterations ? kContactTolerance : kCreepTolerance) * threshold + rounding;
        if (gap <= tolerance || touch.iterations >= kMaxIterations) {
            touch.touches = true;
            return touch;
        }
        // Safe step: the longer of the Lipschitz bound and the time to the separating plane.
        const Vec3 n = direction_of(touch.at, distance, oblique, now);
        const double step =
            std::max(gap < fastest ? gap / fastest : kLongerThanStep, time_to_plane(n, threshold, now, motion));
        const double remaining = limit - touch.time;
        if (step > remaining) {
            return touch;
        }
        // Try a longer leap: to the end of the step, or to where Newton's method predicts the contact, less half a
        // tolerance so that rounding does not carry it past. Newton's method never overshoots a convex distance; for a
        // concave one the chord to the leap that overshot takes over.
        const double remaining_gap = gap - 0.5 * tolerance;
        const double closing_speed = glm::dot(n, blend(motion, touch.at.weights));
        const double leap =
            std::min({max_leap, remaining,
                      remaining_gap < remaining * closing_speed ? remaining_gap / closing_speed : remaining});
        if (leap > step) {
            const TriangleCorners later = moved(start, motion, touch.time + leap);
            const ClosestPoint at = closest_point_on_triangle(Vec3(0.0), later);
            const double later_distance = std::sqrt(at.squared_distance);
            // Overshot: use the chord instead.
            if (later_distance <= threshold) {
                // If the distance is convex, the chord overshoots again by nearly as much: then halve.
                const double chord = remaining_gap / (distance - later_distance);
                max_leap = leap * (overshot ? std::min(chord, 0.5) : chord);
                overshot = true;
                if (max_leap > step) {
                    continue;
                }
            } else if (separated(n, direction_of(at, later_distance, oblique, later), threshold, now, later)) {
                // A rotating plane proves that the leap passed no contact: accept it and allow a longer one next.
                if (leap >= remaining) {
                    return touch;
                }
                overshot = false;
                touch.time += leap;
                touch.at = at;
                distance = later_distance;
                now = later;
                max_leap = 4.0 * leap;
                continue;
            } else if (glm::dot(n, at.point) > kPassedCosine * later_distance) {
                // The triangle has passed the centre face-on: use the chord of the signed distance.
                max_leap = leap * std::max(0.25, remaining_gap / (distance + later_distance));
                if (max_leap > step) {
                    continue;
                }
            } else {
                // No proof: try a shorter leap after the safe step.
                max_leap = 0.25 * leap;
            }
        }
        // Take the safe step.
        overshot = false;
        touch.time += step;
        now = moved(start, motion, touch.time);
        touch.at = closest_point_on_triangle(Vec3(0.0), now);
        distance = std::sqrt(touch.at.squared_distance);
    }
}

}  // namespace

TriangleCorners corners_at(const MovingTriangle& triangle, double time) HAPTIC_RT {
    const double rest = 1.0 - time;
    return {triangle.start.a * rest + triangle.end.a * time, triangle.start.b * rest + triangle.end.b * time,
            triangle.start.c * rest + triangle.end.c * time};
}

TriangleTouch sphere_triangle_ccd(const Vec3& center, double radius, const MovingTriangle& triangle, double limit,
                                  double release) HAPTIC_RT {
    // Work in the sphere's frame: corners relative to the centre, and their displacement over the step.
    const TriangleCorners start{triangle.start.a - center, triangle.start.b - center, triangle.start.c - center};
    const TriangleCorners motion{triangle.end.a - triangle.start.a, triangle.end.b - triangle.start.b,
                                 triangle.end.c - triangle.start.c};
    if (boxes_disjoint(start, motion, radius)) {
        return {};
    }
    return advance(start, motion, radius, limit, release);
}

PointPassage point_passage(const Vec3& point, const MovingTriangle& triangle) HAPTIC_RT {
    // Conservative advancement with a vanishing radius finds the passage.
    const TriangleCorners start{triangle.start.a - point, triangle.start.b - point, triangle.start.c - point};
    const TriangleCorners motion{triangle.end.a - triangle.start.a, triangle.end.b - triangle.start.b,
                                 triangle.end.c - triangle.start.c};
    const double extent = longest(start) + longest(motion);
    const double radius = kPassageShare * extent;
    const TriangleTouch touch = sphere_triangle_ccd(point, radius, triangle);
    if (!touch.touches) {
        return {};
    }
    // Newton's method on the coplanarity cubic det(a, b, c) = 0 (thesis equation 4.5) refines the time. A candidate is
    // kept only if the triangle is nearer to the point then.
    double time = touch.time;
    double best = touch.at.squared_distance;
    double candidate = time;
    for (int k = 0; k < 6; ++k) {
        const TriangleCorners at = moved(start, motion, candidate);
        // Derivative of the determinant.
        const double slope = glm::dot(motion.a, glm::cross(at.b, at.c)) + glm::dot(at.a, glm::cross(motion.b, at.c)) +
                             glm::dot(at.a, glm::cross(at.b, motion.c));
        if (slope == 0.0) {
            break;
        }
        candidate -= determinant(at) / slope;
        if (!(candidate >= 0.0 && candidate <= 1.0)) {
            break;
        }
        // Keep the nearest candidate so far.
        const double squared = closest_point_on_triangle(Vec3(0.0), moved(start, motion, candidate)).squared_distance;
        if (squared < best) {
            best = squared;
            time = candidate;
        }
    }
    return {true, time};
}

}  // namespace haptic::sim
