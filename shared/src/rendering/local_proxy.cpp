#include "rendering/local_proxy.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>

namespace haptic {
namespace {

// Relative to the largest coordinate or offset and 1 m: tolerance for lying on a plane.
constexpr double kRounding = 1e-12;

// Longest displacement of the proxy, in units of the deepest violation. Planes that open by an angle a meet at 1 / a
// times their overlap: below half a degree they are treated as a slit, not as an edge to move to.
constexpr double kMaxMove = 100.0;

// Gram determinant below which two or three normals count as linearly dependent.
constexpr double kDependent = 1e-14;

// m, bound on coordinates in the device frame: products of such lengths cannot overflow.
constexpr double kMaxCoordinate = 1e6;

// Squared length; normals are unit vectors up to the rounding that the contact frame's check allows.
constexpr double kMaxNormalSquared = 1.01;

using Planes = std::span<const HalfSpace>;

/// m, depth of the point behind the plane; negative in front of it.
double violation(const HalfSpace& plane, const Vec3& point) HAPTIC_RT {
    return plane.offset - glm::dot(plane.normal, point);
}

double max_violation(Planes planes, const Vec3& point) HAPTIC_RT {
    double worst = violation(planes[0], point);
    for (const HalfSpace& plane : planes.subspan(1)) {
        worst = std::max(worst, violation(plane, point));
    }
    return worst;
}

/// Linear equation dot(row, move) = value for a displacement of the target.
struct Equation {
    Vec3 row;
    double value;
};

/// A displacement of the target: move = sum multiplier[i] * row of equation i.
struct Displacement {
    Vec3 move{0.0, 0.0, 0.0};
    std::array<double, kMaxPlanes> multiplier{};
};

/// The shortest displacement that satisfies two equations. False if the rows are parallel.
bool shortest_move(const Equation& a, const Equation& b, Displacement& shortest) HAPTIC_RT {
    // The minimum-norm solution lies in the plane of both rows, as a combination of their perpendiculars there. The
    // cross product stays accurate for nearly parallel rows, where the determinant of the Gram matrix cancels.
    const Vec3 axis = glm::cross(a.row, b.row);
    const double gram = glm::dot(axis, axis);
    if (!(gram > kDependent * glm::dot(a.row, a.row) * glm::dot(b.row, b.row))) {
        return false;
    }
    const Vec3 dual_a = glm::cross(b.row, axis);
    const Vec3 dual_b = glm::cross(axis, a.row);
    shortest.move = (a.value * dual_a + b.value * dual_b) * (1.0 / gram);
    // The dual vectors extract the multipliers: dual_a . a = gram, dual_a . b = 0.
    shortest.multiplier = {glm::dot(shortest.move, dual_a) / gram, glm::dot(shortest.move, dual_b) / gram};
    return true;
}

/// The displacement that satisfies three equations, by Cramer's rule. False if the rows are linearly dependent.
bool shortest_move(const Equation& a, const Equation& b, const Equation& c, Displacement& shortest) HAPTIC_RT {
    // Determinant of the three rows: the volume that they span. The dual vectors are the cross products of two rows.
    const Vec3 bc = glm::cross(b.row, c.row);
    const Vec3 ca = glm::cross(c.row, a.row);
    const Vec3 ab = glm::cross(a.row, b.row);
    const double volume = glm::dot(a.row, bc);
    if (!(volume * volume > kDependent)) {
        return false;
    }
    shortest.move = (a.value * bc + b.value * ca + c.value * ab) * (1.0 / volume);
    shortest.multiplier = {glm::dot(shortest.move, bc) / volume, glm::dot(shortest.move, ca) / volume,
                           glm::dot(shortest.move, ab) / volume};
    return true;
}

/// The displaced target lies on the plane.
Equation on_plane(const HalfSpace& plane, const Vec3& target) HAPTIC_RT {
    return {plane.normal, violation(plane, target)};
}

/// The displaced target violates both planes by the same amount.
Equation equally_violated(const HalfSpace& a, const HalfSpace& b, const Vec3& target) HAPTIC_RT {
    return {a.normal - b.normal, violation(a, target) - violation(b, target)};
}

/// Keeps the nearest of the candidate points that satisfies all planes.
struct NearestFeasible {
    Planes planes;
    Vec3 target;
    double tolerance;  // m
    double max_move;   // m, longer displacements are rejected
    double squared = 0.0;
    Vec3 position{0.0, 0.0, 0.0};
    std::array<double, kMaxPlanes> multiplier{};
    bool found = false;

    /// `index`: the planes that the multipliers of the displacement belong to.
    void consider(const Displacement& displacement, std::initializer_list<std::size_t> index) HAPTIC_RT {
        // Feasible within the tolerance, near enough, and nearer than the best so far.
        const double length = glm::dot(displacement.move, displacement.move);
        const Vec3 point = target + displacement.move;
        const bool allowed = length <= max_move * max_move && max_violation(planes, point) <= tolerance;
        if (allowed && (!found || length < squared)) {
            found = true;
            squared = length;
            position = point;
            // Rounding can make a multiplier negative; planes only push.
            multiplier = {};
            std::size_t i = 0;
            for (const std::size_t k : index) {
                multiplier[k] = std::max(displacement.multiplier[i++], 0.0);
            }
        }
    }
};

/// Keeps the candidate point with the smallest largest violation; among equals, the nearest.
struct LeastViolated {
    Planes planes;
    Vec3 target;
    double tolerance;  // m
    double max_move;   // m, longer displacements are rejected
    double violated = 0.0;
    double squared = 0.0;
    Vec3 position{0.0, 0.0, 0.0};
    bool found = false;

    void consider(const Vec3& move) HAPTIC_RT {
        // Near enough, and less violated than the best so far, or equally and nearer.
        const double length = glm::dot(move, move);
        if (!(length <= max_move * max_move)) {
            return;
        }
        const Vec3 point = target + move;
        const double worst = max_violation(planes, point);
        if (!found || worst < violated - tolerance || (worst <= violated + tolerance && length < squared)) {
            found = true;
            violated = worst;
            squared = length;
            position = point;
        }
    }
};

/// Projection onto the feasible set: tries all active sets of one, two and three planes.
NearestFeasible nearest_feasible(Planes planes, const Vec3& target, double tolerance, double max_move) HAPTIC_RT {
    NearestFeasible nearest{planes, target, tolerance, max_move};
    // One active plane. No feasible point is nearer than the deepest violation, so a feasible point on one violated
    // plane is the minimum, and no larger active set can be better.
    for (std::size_t i = 0; i < planes.size(); ++i) {
        if (const Equation on = on_plane(planes[i], target); on.value > 0.0) {
            nearest.consider({on.row * on.value, {on.value}}, {i});
        }
    }
    if (nearest.found || planes.size() == 1) {
        return nearest;
    }
    // Two active planes: the nearest point of their edge.
    Displacement shortest;
    for (std::size_t i = 0; i < planes.size(); ++i) {
        const Equation on_i = on_plane(planes[i], target);
        for (std::size_t j = i + 1; j < planes.size(); ++j) {
            if (shortest_move(on_i, on_plane(planes[j], target), shortest)) {
                nearest.consider(shortest, {i, j});
            }
        }
    }
    // Three active planes: their corner.
    if (planes.size() == kMaxPlanes && shortest_move(on_plane(planes[0], target), on_plane(planes[1], target),
                                                     on_plane(planes[2], target), shortest)) {
        nearest.consider(shortest, {0, 1, 2});
    }
    return nearest;
}

/// Minimises the largest violation where the half-spaces have no common point. A positive combination of the normals
/// then vanishes, and at the minimum two opposing planes, or all three, are violated equally.
LeastViolated least_violated(Planes planes, const Vec3& target, double tolerance, double max_move) HAPTIC_RT {
    LeastViolated best{planes, target, tolerance, max_move};
    // The target itself, then two equally violated planes.
    best.consider(Vec3(0.0));
    for (std::size_t i = 0; i < planes.size(); ++i) {
        for (std::size_t j = i + 1; j < planes.size(); ++j) {
            const Equation both = equally_violated(planes[i], planes[j], target);
            const double squared = glm::dot(both.row, both.row);
            if (squared > kDependent) {
                best.consider(both.row * (both.value / squared));
            }
        }
    }
    // Three equally violated planes: two equations make three violations equal.
    Displacement shortest;
    if (planes.size() == kMaxPlanes && shortest_move(equally_violated(planes[0], planes[1], target),
                                                     equally_violated(planes[0], planes[2], target), shortest)) {
        best.consider(shortest.move);
    }
    return best;
}

}  // namespace

LocalProxy project(const Vec3& target, std::span<const HalfSpace> all_planes) HAPTIC_RT {
    LocalProxy proxy;
    const Planes planes = all_planes.first(std::min(all_planes.size(), kMaxPlanes));
    // Reject input that is not finite or too large; `scale` is the magnitude that rounding is relative to.
    double scale = 1.0;
    bool usable = true;
    for (const double coordinate : {target.x, target.y, target.z}) {
        usable = usable && std::abs(coordinate) < kMaxCoordinate;
        scale = std::max(scale, std::abs(coordinate));
    }
    // Unusable coordinates must not be published: use the origin instead.
    proxy.position = usable ? target : Vec3{0.0, 0.0, 0.0};
    for (const HalfSpace& plane : planes) {
        usable = usable && std::abs(plane.offset) < kMaxCoordinate &&
                 glm::dot(plane.normal, plane.normal) < kMaxNormalSquared;
        scale = std::max(scale, std::abs(plane.offset));
    }
    proxy.feasible = usable;
    if (!usable || planes.empty()) {
        return proxy;
    }
    // Free motion: the proxy is the target.
    const double deepest = max_violation(planes, target);
    if (!(deepest > 0.0)) {
        return proxy;
    }
    // Bounds of the search: rounding, and the longest accepted displacement.
    const double tolerance = kRounding * scale;
    const double max_move = kMaxMove * deepest + tolerance;

    // Projection, or the least violated point if there is no feasible one near enough.
    const NearestFeasible nearest = nearest_feasible(planes, target, tolerance, max_move);
    double active_violation = 0.0;  // m, violation of the active planes
    if (nearest.found) {
        proxy.position = nearest.position;
        proxy.multiplier = nearest.multiplier;
    } else {
        const LeastViolated best = least_violated(planes, target, tolerance, max_move);
        proxy.position = best.position;
        proxy.feasible = false;
        active_violation = best.violated;
    }
    // Active planes: those that the proxy lies on, or, if infeasible, violates as much as the worst.
    for (std::size_t k = 0; k < planes.size(); ++k) {
        if (violation(planes[k], proxy.position) >= active_violation - 2.0 * tolerance) {
            proxy.active = static_cast<std::uint8_t>(proxy.active | (1U << k));
        }
    }
    return proxy;
}

}  // namespace haptic
