#include "contact/triangle_ccd.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

namespace haptic::sim {

namespace {

constexpr double kFine = 1e-12;          // of the radius: closer than this is a touch
constexpr double kRounding = 8e-16;      // of the coordinates: no distance is known better
constexpr int kFineAdvances = 200;       // then kCreepTolerance takes the place of kFine
constexpr int kMaxAdvances = 2000;       // then the triangle counts as touching; not met in 10^8 random queries
constexpr double kNever = 2.0;           // longer than any step
constexpr double kPassed = 0.9;          // cosine: a touched point straight across was passed, not left aside
constexpr double kOblique = 1e-3;        // of the coordinates: the direction from a nearer point is made square first
constexpr double kPassageShare = 1e-11;  // radius of a point, as a share of the triangle's extent

double longest(const TriangleCorners& t) HAPTIC_RT {
    return std::sqrt(std::max({glm::dot(t.a, t.a), glm::dot(t.b, t.b), glm::dot(t.c, t.c)}));
}

TriangleCorners moved(const TriangleCorners& from, const TriangleCorners& by, double time) HAPTIC_RT {
    return {from.a + by.a * time, from.b + by.b * time, from.c + by.c * time};
}

/// Whether the box about the whole motion misses that about the sphere.
bool stays_outside(const TriangleCorners& s, const TriangleCorners& by, double radius) HAPTIC_RT {
    const TriangleCorners e = moved(s, by, 1.0);
    const double low = std::max({std::min({s.a.x, s.b.x, s.c.x, e.a.x, e.b.x, e.c.x}),
                                 std::min({s.a.y, s.b.y, s.c.y, e.a.y, e.b.y, e.c.y}),
                                 std::min({s.a.z, s.b.z, s.c.z, e.a.z, e.b.z, e.c.z})});
    const double high = std::min({std::max({s.a.x, s.b.x, s.c.x, e.a.x, e.b.x, e.c.x}),
                                  std::max({s.a.y, s.b.y, s.c.y, e.a.y, e.b.y, e.c.y}),
                                  std::max({s.a.z, s.b.z, s.c.z, e.a.z, e.b.z, e.c.z})});
    return low > radius || high < -radius;
}

/// A direction made square to the touched face or edge. Any unit vector is safe to use for a plane, only this one is
/// good where the nearest point is so near that the rounding of its difference from the centre tilts it into the
/// triangle.
[[gnu::noinline]] Vec3 squared_up(const Vec3& n, const ClosestPoint& at, const TriangleCorners& t) HAPTIC_RT {
    Vec3 square = n;
    if (at.feature == Feature::Face) {
        square = glm::cross(t.b - t.a, t.c - t.a);
        square = glm::dot(square, n) < 0.0 ? -square : square;
    } else if (at.feature == Feature::Edge) {
        const Vec3 e = at.index == 0 ? t.b - t.a : (at.index == 1 ? t.c - t.b : t.a - t.c);
        const double ee = glm::dot(e, e);
        square -= ee > 0.0 ? e * (glm::dot(n, e) / ee) : Vec3(0.0);
    }
    const double length = std::sqrt(glm::dot(square, square));
    return length > 0.0 ? square / length : n;
}

/// From the nearest point to the origin, unit.
inline Vec3 direction_of(const ClosestPoint& at, double distance, double least, const TriangleCorners& t) HAPTIC_RT {
    const Vec3 n = at.point * (-1.0 / distance);
    return distance >= least ? n : squared_up(n, at, t);
}

/// How far ahead the corners stay beyond the plane that is `radius` from the origin and faces the nearest point.
/// `n` is unit, from the nearest point to the origin.
double time_to_plane(const Vec3& n, double radius, const TriangleCorners& now, const TriangleCorners& by) HAPTIC_RT {
    double least = kNever;
    for (const auto& [x, dx] : {std::pair{now.a, by.a}, std::pair{now.b, by.b}, std::pair{now.c, by.c}}) {
        const double rate = glm::dot(n, dx);
        const double gap = -glm::dot(n, x) - radius;
        if (gap < 0.0) {
            return 0.0;  // by rounding of n the plane does not separate, so it bounds nothing
        }
        if (rate > 0.0 && gap < least * rate) {
            least = gap / rate;
        }
    }
    return least;
}

/// Whether a plane whose normal turns linearly from n0 to n1 keeps the triangle out of the sphere from `now` to `then`.
/// With c = dot(n0, n1), the normal's length is at most that of the quadratic with Bernstein coefficients 1, (1 + c)/2,
/// 1, and dot(n(s), x(s)) is a quadratic too; comparing coefficients compares the functions.
bool separated(const Vec3& n0, const Vec3& n1, double radius, const TriangleCorners& now,
               const TriangleCorners& then) HAPTIC_RT {
    const double middle = radius * (1.0 + glm::dot(n0, n1));
    for (const auto& [x0, x1] : {std::pair{now.a, then.a}, std::pair{now.b, then.b}, std::pair{now.c, then.c}}) {
        if (-glm::dot(n0, x0) < radius || -glm::dot(n1, x1) < radius ||
            -(glm::dot(n0, x1) + glm::dot(n1, x0)) < middle) {
            return false;
        }
    }
    return middle > 0.0;
}

double determinant(const TriangleCorners& t) HAPTIC_RT {
    return glm::dot(t.a, glm::cross(t.b, t.c));
}

}  // namespace

TriangleCorners corners_at(const MovingTriangle& triangle, double time) HAPTIC_RT {
    const double rest = 1.0 - time;
    return {triangle.start.a * rest + triangle.end.a * time, triangle.start.b * rest + triangle.end.b * time,
            triangle.start.c * rest + triangle.end.c * time};
}

TriangleTouch sphere_triangle_ccd(const Vec3& center, double radius, const MovingTriangle& triangle, double limit,
                                  double release) HAPTIC_RT {
    const TriangleCorners start{triangle.start.a - center, triangle.start.b - center, triangle.start.c - center};
    const TriangleCorners by{triangle.end.a - triangle.start.a, triangle.end.b - triangle.start.b,
                             triangle.end.c - triangle.start.c};
    TriangleTouch touch;
    if (stays_outside(start, by, radius)) {
        return touch;
    }
    const double fastest = longest(by);
    const double extent = longest(start) + fastest;
    const double rounding = kRounding * extent;
    const double oblique = kOblique * extent;
    double ahead = limit;  // longest leap worth trying
    bool went_too_far = false;
    TriangleCorners now = start;
    touch.at = closest_point_on_triangle(Vec3(0.0), now);
    double distance = std::sqrt(touch.at.squared_distance);
    const double threshold = std::min(radius, release * distance);
    for (touch.iterations = 1;; ++touch.iterations) {
        const double gap = distance - threshold;
        const double tolerance = (touch.iterations <= kFineAdvances ? kFine : kCreepTolerance) * threshold + rounding;
        if (gap <= tolerance || touch.iterations >= kMaxAdvances) {
            touch.touches = true;
            return touch;
        }
        const Vec3 n = direction_of(touch.at, distance, oblique, now);
        const double step = std::max(gap < fastest ? gap / fastest : kNever, time_to_plane(n, threshold, now, by));
        const double rest = limit - touch.time;
        if (step > rest) {
            return touch;
        }
        // A leap: to the end of the step, or to where Newton's method sees the touch (just before it, so that it is met
        // from outside in spite of rounding). A convex distance is met from above by Newton's method, a concave one by
        // the chord to the leap that went too far.
        const double to_close = gap - 0.5 * tolerance;
        const double closing = glm::dot(n, blend(by, touch.at.weights));
        const double leap = std::min({ahead, rest, to_close < rest * closing ? to_close / closing : rest});
        if (leap > step) {
            const TriangleCorners then = moved(start, by, touch.time + leap);
            const ClosestPoint at = closest_point_on_triangle(Vec3(0.0), then);
            const double far = std::sqrt(at.squared_distance);
            if (far <= threshold) {
                // Where the distance is convex the chord goes too far as well, and again by nearly as much: not twice.
                const double chord = to_close / (distance - far);
                ahead = leap * (went_too_far ? std::min(chord, 0.5) : chord);
                went_too_far = true;
                if (ahead > step) {
                    continue;
                }
            } else if (separated(n, direction_of(at, far, oblique, then), threshold, now, then)) {
                if (leap >= rest) {
                    return touch;
                }
                went_too_far = false;
                touch.time += leap;
                touch.at = at;
                distance = far;
                now = then;
                ahead = 4.0 * leap;
                continue;
            } else if (glm::dot(n, at.point) > kPassed * far) {
                // The triangle has just passed, flat: the chord of the signed distance.
                ahead = leap * std::max(0.25, to_close / (distance + far));
                if (ahead > step) {
                    continue;
                }
            } else {
                ahead = 0.25 * leap;
            }
        }
        went_too_far = false;
        touch.time += step;
        now = moved(start, by, touch.time);
        touch.at = closest_point_on_triangle(Vec3(0.0), now);
        distance = std::sqrt(touch.at.squared_distance);
    }
}

PointPassage point_passage(const Vec3& point, const MovingTriangle& triangle) HAPTIC_RT {
    const TriangleCorners start{triangle.start.a - point, triangle.start.b - point, triangle.start.c - point};
    const TriangleCorners by{triangle.end.a - triangle.start.a, triangle.end.b - triangle.start.b,
                             triangle.end.c - triangle.start.c};
    const double extent = longest(start) + longest(by);
    const double radius = kPassageShare * extent;
    const TriangleTouch touch = sphere_triangle_ccd(point, radius, triangle);
    if (!touch.touches) {
        return {};
    }
    // Newton on the coplanarity cubic, kept only where it brings the triangle nearer to the point.
    double time = touch.time;
    double best = touch.at.squared_distance;
    double candidate = time;
    for (int k = 0; k < 6; ++k) {
        const TriangleCorners at = moved(start, by, candidate);
        const double slope = glm::dot(by.a, glm::cross(at.b, at.c)) + glm::dot(at.a, glm::cross(by.b, at.c)) +
                             glm::dot(at.a, glm::cross(at.b, by.c));
        if (slope == 0.0) {
            break;
        }
        candidate -= determinant(at) / slope;
        if (!(candidate >= 0.0 && candidate <= 1.0)) {
            break;
        }
        const double squared = closest_point_on_triangle(Vec3(0.0), moved(start, by, candidate)).squared_distance;
        if (squared < best) {
            best = squared;
            time = candidate;
        }
    }
    return {true, time};
}

}  // namespace haptic::sim
