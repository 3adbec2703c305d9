#include <haptic/rt/surface_grip.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <haptic/rt/finite.hpp>

namespace haptic::rt {
namespace {

// Determinant of the Gram matrix below which active planes are nearly parallel: their forces then add up to the
// resultant.
constexpr double kParallel = 1e-9;
constexpr double kRounding = 1e-9;  // of the limit: what sticks exactly at it does not slide

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

/// sum lambda_k for a push = sum lambda_k n_k.
double normal_load(const Normals& normals, const Vec3& push) HAPTIC_RT {
    const double resultant = glm::length(push);
    if (normals.count < 2) {
        return resultant;
    }
    Mat3 gram(1.0);
    Vec3 along(0.0);
    for (int i = 0; i < normals.count; ++i) {
        const Vec3& ni = normals.n[static_cast<std::size_t>(i)];
        along[i] = glm::dot(ni, push);
        for (int j = 0; j < i; ++j) {
            gram[i][j] = gram[j][i] = glm::dot(ni, normals.n[static_cast<std::size_t>(j)]);
        }
    }
    if (std::fabs(glm::determinant(gram)) < kParallel) {
        return resultant;
    }
    const Vec3 loads = glm::inverse(gram) * along;
    return std::max(loads.x, 0.0) + std::max(loads.y, 0.0) + std::max(loads.z, 0.0);
}

/// The part of v that lies in all planes.
Vec3 within(const Normals& normals, Vec3 v) HAPTIC_RT {
    std::array<Vec3, kMaxPlanes> across{};
    for (std::size_t k = 0; k < static_cast<std::size_t>(normals.count); ++k) {
        Vec3 n = normals.n[k];
        for (std::size_t i = 0; i < k; ++i) {
            n -= across[i] * glm::dot(across[i], n);
        }
        const double left = glm::dot(n, n);
        if (left > kParallel) {
            across[k] = n / std::sqrt(left);
            v -= across[k] * glm::dot(across[k], v);
        }
    }
    return v;
}

/// A plane that does not hold x0 may be in the way of what sticks beside it: the nearest place that all allow, or,
/// where project() sees none near enough, what of the way from x0 there is free.
Vec3 beyond_all(const LocalProxy& proxy, const Vec3& offset, std::span<const HalfSpace> planes) HAPTIC_RT {
    const LocalProxy beside = project(proxy.position + offset, planes);
    if (beside.feasible) {
        return beside.position - proxy.position;
    }
    double free = 1.0;
    for (const HalfSpace& plane : planes) {
        const double drop = -glm::dot(plane.normal, offset);
        const double room = std::max(0.0, glm::dot(plane.normal, proxy.position) - plane.offset);
        free = drop * free > room ? room / drop : free;
    }
    return free * offset;
}

}  // namespace

Vec3 hold(const LocalProxy& proxy, const Vec3& target, std::span<const HalfSpace> planes, const Friction& friction,
          const Vec3& carried, SurfaceGrip& grip) HAPTIC_RT {
    if (!friction.any() || proxy.active == 0) {
        grip = SurfaceGrip{};
        return Vec3(0.0);
    }
    const Normals normals = active_normals(proxy, planes);
    Vec3 offset(0.0);
    if (grip.held) {
        offset = within(normals, grip.at + carried - proxy.position);
        offset = beyond_all(proxy, offset, planes);
    }
    const double load = normal_load(normals, proxy.position - target);
    const double limit = (grip.slides ? friction.sliding : friction.at_rest) * load;
    const double length = glm::length(offset);
    grip.slides = length > limit * (1.0 + kRounding);
    if (grip.slides) {
        offset *= std::min(1.0, friction.sliding * load / length);
    }
    grip.held = true;
    grip.at = proxy.position + offset;
    if (!finite(grip.at)) {
        grip = SurfaceGrip{};
        return Vec3(0.0);
    }
    return offset;
}

}  // namespace haptic::rt
