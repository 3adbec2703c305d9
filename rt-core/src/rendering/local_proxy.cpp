#include "rendering/local_proxy.hpp"

#include <algorithm>
#include <cmath>

namespace haptic::rt {
namespace {

// Rounding of coordinates and offsets, relative to the largest of them and 1 m: a plane is kept to this.
constexpr double kRounding = 1e-12;

// How much further than the deepest violation the proxy may be moved. Planes that face one another and open by an angle
// of a meet at 1 / a times their overlap: below half a degree they are a slit, and not a way out.
constexpr double kLongestMove = 100.0;

// Two normals, or three, whose Gram determinant is below this are linearly dependent as far as rounding can tell.
constexpr double kDependent = 1e-14;

// m, no point of a scene is further away in the device's frame; products of lengths up to it cannot overflow.
constexpr double kFarthest = 1e6;

// Squared; normals are of unit length, up to the rounding that the reader of a frame allows.
constexpr double kLongestNormal = 1.01;

using Planes = std::span<const HalfSpace>;

/// How far a plane wants the point moved along its normal, m; negative where the point is free of it.
double violation(const HalfSpace& plane, const Vec3& point) HAPTIC_RT {
    return plane.offset - glm::dot(plane.normal, point);
}

double largest_violation(Planes planes, const Vec3& point) HAPTIC_RT {
    double largest = violation(planes[0], point);
    for (const HalfSpace& plane : planes.subspan(1)) {
        largest = std::max(largest, violation(plane, point));
    }
    return largest;
}

/// A linear equation dot(row, move) = value.
struct Equation {
    Vec3 row;
    double value;
};

/// The shortest move that fulfils two equations. False if the rows are parallel.
bool shortest_move(const Equation& a, const Equation& b, Vec3& move) HAPTIC_RT {
    // In the plane of both rows, across one and the other: the cross product keeps its accuracy where the rows are
    // nearly parallel and the determinant of their Gram matrix, formed from products, would lose it.
    const Vec3 axis = glm::cross(a.row, b.row);
    const double gram = glm::dot(axis, axis);
    if (!(gram > kDependent * glm::dot(a.row, a.row) * glm::dot(b.row, b.row))) {
        return false;
    }
    move = (a.value * glm::cross(b.row, axis) + b.value * glm::cross(axis, a.row)) * (1.0 / gram);
    return true;
}

/// The move that fulfils three equations. False if the rows are linearly dependent.
bool shortest_move(const Equation& a, const Equation& b, const Equation& c, Vec3& move) HAPTIC_RT {
    const Vec3 bc = glm::cross(b.row, c.row);
    const double volume = glm::dot(a.row, bc);
    if (!(volume * volume > kDependent)) {
        return false;
    }
    move = (a.value * bc + b.value * glm::cross(c.row, a.row) + c.value * glm::cross(a.row, b.row)) * (1.0 / volume);
    return true;
}

Equation onto(const HalfSpace& plane, const Vec3& target) HAPTIC_RT {
    return {plane.normal, violation(plane, target)};
}

/// The points at which two planes are violated alike.
Equation alike(const HalfSpace& a, const HalfSpace& b, const Vec3& target) HAPTIC_RT {
    return {a.normal - b.normal, violation(a, target) - violation(b, target)};
}

/// The nearest of the points offered that keeps all planes.
struct NearestAllowed {
    Planes planes;
    Vec3 target;
    double tolerance;
    double longest;  // m, moves beyond it are refused
    double squared = 0.0;
    Vec3 position{0.0, 0.0, 0.0};
    bool found = false;

    void offer(const Vec3& move) HAPTIC_RT {
        const double length = glm::dot(move, move);
        const Vec3 point = target + move;
        const bool allowed = length <= longest * longest && largest_violation(planes, point) <= tolerance;
        if (allowed && (!found || length < squared)) {
            found = true;
            squared = length;
            position = point;
        }
    }
};

/// The point that violates the planes least, of those offered; the nearest of equals.
struct LeastViolated {
    Planes planes;
    Vec3 target;
    double tolerance;
    double longest;
    double violated = 0.0;
    double squared = 0.0;
    Vec3 position{0.0, 0.0, 0.0};
    bool found = false;

    void offer(const Vec3& move) HAPTIC_RT {
        const double length = glm::dot(move, move);
        if (!(length <= longest * longest)) {
            return;
        }
        const Vec3 point = target + move;
        const double most = largest_violation(planes, point);
        if (!found || most < violated - tolerance || (most <= violated + tolerance && length < squared)) {
            found = true;
            violated = most;
            squared = length;
            position = point;
        }
    }
};

NearestAllowed nearest_allowed(Planes planes, const Vec3& target, double tolerance, double longest) HAPTIC_RT {
    NearestAllowed nearest{planes, target, tolerance, longest};
    // First each violated plane by itself: no allowed point is nearer than a violation is deep, so where the move onto
    // its plane is allowed, nothing more need be looked at.
    for (const HalfSpace& plane : planes) {
        if (const Equation on = onto(plane, target); on.value > 0.0) {
            nearest.offer(on.row * on.value);
        }
    }
    if (nearest.found || planes.size() == 1) {
        return nearest;
    }
    Vec3 move{0.0, 0.0, 0.0};
    for (std::size_t i = 0; i < planes.size(); ++i) {
        const Equation on_i = onto(planes[i], target);
        for (std::size_t j = i + 1; j < planes.size(); ++j) {
            if (shortest_move(on_i, onto(planes[j], target), move)) {
                nearest.offer(move);
            }
        }
    }
    if (planes.size() == kMaxPlanes &&
        shortest_move(onto(planes[0], target), onto(planes[1], target), onto(planes[2], target), move)) {
        nearest.offer(move);
    }
    return nearest;
}

/// Where half-spaces leave no point, their normals depend on one another with positive weights, and the smallest
/// largest violation is found where two that oppose, or all three, are violated alike.
LeastViolated least_violated(Planes planes, const Vec3& target, double tolerance, double longest) HAPTIC_RT {
    LeastViolated least{planes, target, tolerance, longest};
    Vec3 move{0.0, 0.0, 0.0};
    least.offer(move);
    for (std::size_t i = 0; i < planes.size(); ++i) {
        for (std::size_t j = i + 1; j < planes.size(); ++j) {
            const Equation both = alike(planes[i], planes[j], target);
            const double squared = glm::dot(both.row, both.row);
            if (squared > kDependent) {
                least.offer(both.row * (both.value / squared));
            }
        }
    }
    if (planes.size() == kMaxPlanes &&
        shortest_move(alike(planes[0], planes[1], target), alike(planes[0], planes[2], target), move)) {
        least.offer(move);
    }
    return least;
}

}  // namespace

LocalProxy project(const Vec3& target, std::span<const HalfSpace> all_planes) HAPTIC_RT {
    LocalProxy proxy;
    const Planes planes = all_planes.first(std::min(all_planes.size(), kMaxPlanes));
    double scale = 1.0;
    bool usable = true;
    for (const double coordinate : {target.x, target.y, target.z}) {
        usable = usable && std::abs(coordinate) < kFarthest;
        scale = std::max(scale, std::abs(coordinate));
    }
    proxy.position = usable ? target : Vec3{0.0, 0.0, 0.0};
    for (const HalfSpace& plane : planes) {
        usable = usable && std::abs(plane.offset) < kFarthest && glm::dot(plane.normal, plane.normal) < kLongestNormal;
        scale = std::max(scale, std::abs(plane.offset));
    }
    proxy.feasible = usable;
    if (!usable || planes.empty()) {
        return proxy;
    }
    const double deepest = largest_violation(planes, target);
    if (!(deepest > 0.0)) {
        return proxy;
    }
    const double tolerance = kRounding * scale;
    const double longest = kLongestMove * deepest + tolerance;

    const NearestAllowed nearest = nearest_allowed(planes, target, tolerance, longest);
    double held_at = 0.0;  // m, the violation at which a plane holds the proxy
    if (nearest.found) {
        proxy.position = nearest.position;
    } else {
        const LeastViolated least = least_violated(planes, target, tolerance, longest);
        proxy.position = least.position;
        proxy.feasible = false;
        held_at = least.violated;
    }
    for (std::size_t k = 0; k < planes.size(); ++k) {
        if (violation(planes[k], proxy.position) >= held_at - 2.0 * tolerance) {
            proxy.active = static_cast<std::uint8_t>(proxy.active | (1U << k));
        }
    }
    return proxy;
}

HalfSpace plane_at(const ContactPlane& plane, std::int64_t plane_time_ns, std::int64_t time_ns,
                   std::int64_t horizon_ns) HAPTIC_RT {
    // Times come from another process: their difference may not fit.
    std::int64_t age_ns = 0;
    if (time_ns > plane_time_ns && __builtin_sub_overflow(time_ns, plane_time_ns, &age_ns)) {
        age_ns = horizon_ns;
    }
    age_ns = std::max<std::int64_t>(std::min(age_ns, horizon_ns), 0);
    return {to_vec3(plane.normal), plane.offset + plane.velocity * seconds(age_ns)};
}

}  // namespace haptic::rt
