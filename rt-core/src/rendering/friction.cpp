#include "rendering/friction.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

// Squared length of a normal's component that is orthogonal to the others, below which it counts as dependent on them.
constexpr double kDependent = 1e-9;
// Relative to the limit: a particle exactly at the friction limit does not slide.
constexpr double kRounding = 1e-9;

/// The active planes' normals, in the order of the planes.
struct Normals {
    std::array<Vec3, kMaxPlanes> n{};
    int count = 0;
};

Normals active_normals(const LocalProxy& proxy, std::span<const HalfSpace> planes) HAPTIC_RT {
    Normals normals;
    for (std::size_t k = 0; k < std::min(planes.size(), kMaxPlanes); ++k) {
        if ((proxy.active & (1U << k)) != 0) {
            normals.n[static_cast<std::size_t>(normals.count++)] = planes[k].normal;
        }
    }
    return normals;
}

/// m, total normal load sum lambda_k. Where no point satisfies all planes there are no multipliers, and the load is the
/// resultant.
double normal_load(const LocalProxy& proxy, const Vec3& target) HAPTIC_RT {
    if (!proxy.feasible) {
        return glm::length(proxy.position - target);
    }
    return proxy.multiplier[0] + proxy.multiplier[1] + proxy.multiplier[2];
}

/// The component of v that is tangential to all active planes, by Gram-Schmidt on their normals.
Vec3 tangential(const Normals& normals, Vec3 v) HAPTIC_RT {
    std::array<Vec3, kMaxPlanes> basis{};
    for (std::size_t k = 0; k < static_cast<std::size_t>(normals.count); ++k) {
        // Part of this normal that is orthogonal to the ones before.
        Vec3 n = normals.n[k];
        for (std::size_t i = 0; i < k; ++i) {
            n -= basis[i] * glm::dot(basis[i], n);
        }
        // Remove its component from v, unless the normal depends on the others.
        const double squared_length = glm::dot(n, n);
        if (squared_length > kDependent) {
            basis[k] = n / std::sqrt(squared_length);
            v -= basis[k] * glm::dot(basis[k], v);
        }
    }
    return v;
}

/// Keeps the offset feasible: a plane that is inactive at x0 may still block x0 + offset. Returns the offset to the
/// nearest feasible point, or, where project() finds none near enough, the part of the offset that is free.
Vec3 feasible_offset(const LocalProxy& proxy, const Vec3& offset, std::span<const HalfSpace> planes) HAPTIC_RT {
    const LocalProxy moved = project(proxy.position + offset, planes);
    if (moved.feasible) {
        return moved.position - proxy.position;
    }
    // Largest fraction of the offset before some plane is crossed.
    double free = 1.0;
    for (const HalfSpace& plane : planes) {
        // Approach of the offset to the plane, and the distance that is free.
        const double approach = -glm::dot(plane.normal, offset);
        const double clearance = std::max(0.0, glm::dot(plane.normal, proxy.position) - plane.offset);
        free = approach * free > clearance ? clearance / approach : free;
    }
    return free * offset;
}

}  // namespace

Vec3 apply_friction(const LocalProxy& proxy, const Vec3& target, std::span<const HalfSpace> planes,
                    const Friction& friction, const Vec3& surface_displacement, FrictionState& state) HAPTIC_RT {
    // No friction or no contact: forget where the particle stuck.
    if (!friction.any() || proxy.active == 0) {
        state = FrictionState{};
        return Vec3(0.0);
    }
    // Candidate: the particle stays where it was on the surface, which has moved.
    const Normals normals = active_normals(proxy, planes);
    Vec3 offset(0.0);
    if (state.in_contact) {
        offset = tangential(normals, state.position + surface_displacement - proxy.position);
        offset = feasible_offset(proxy, offset, planes);
    }
    // Friction cone: |x - x0| <= mu sum lambda. Outside it the particle slides to mu_d sum lambda.
    const double load = normal_load(proxy, target);
    const double limit = (state.sliding ? friction.mu_dynamic : friction.mu_static) * load;
    const double length = glm::length(offset);
    // A particle exactly at the limit, up to rounding, still sticks.
    state.sliding = length > limit * (1.0 + kRounding);
    if (state.sliding) {
        offset *= std::min(1.0, friction.mu_dynamic * load / length);
    }
    // New sticking position, in contact with the surface.
    state.in_contact = true;
    state.position = proxy.position + offset;
    if (!is_finite(state.position)) {
        state = FrictionState{};
        return Vec3(0.0);
    }
    return offset;
}

}  // namespace haptic::rt
