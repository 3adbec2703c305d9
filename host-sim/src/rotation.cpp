#include "haptic/sim/rotation.hpp"

#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::sim {
namespace {

// Half a turn has no finite Cayley vector: it is cut off just before.
constexpr double kLeastCosine = 1e-6;
// Of the overlap of matrix and rotation, relative to the matrix, so that the result does not depend on units.
constexpr double kLeastOverlap = 1e-9;
// Far below rounding of the determined part, far above what rounding leaves in the undetermined one.
constexpr double kRegularisation = 1e-13;

Quat product(const Quat& a, const Quat& b) noexcept {
    return Quat(a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z, a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x);
}

double frobenius_squared(const Mat3& m) noexcept {
    return glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]);
}

}  // namespace

Mat3 to_matrix(const Quat& q) noexcept {
    const double xx = 2.0 * q.x * q.x;
    const double yy = 2.0 * q.y * q.y;
    const double zz = 2.0 * q.z * q.z;
    const double xy = 2.0 * q.x * q.y;
    const double xz = 2.0 * q.x * q.z;
    const double yz = 2.0 * q.y * q.z;
    const double wx = 2.0 * q.w * q.x;
    const double wy = 2.0 * q.w * q.y;
    const double wz = 2.0 * q.w * q.z;
    return Mat3(1.0 - yy - zz, xy + wz, xz - wy, xy - wz, 1.0 - xx - zz, yz + wx, xz + wy, yz - wx, 1.0 - xx - yy);
}

Quat turned(const Quat& q, const Vec3& turn) noexcept {
    const Quat r = product(Quat(1.0, 0.5 * turn.x, 0.5 * turn.y, 0.5 * turn.z), q);
    const double scale = 1.0 / std::sqrt(r.w * r.w + r.x * r.x + r.y * r.y + r.z * r.z);
    return Quat(r.w * scale, r.x * scale, r.y * scale, r.z * scale);
}

Vec3 turn_between(const Quat& from, const Quat& to) noexcept {
    const Quat r = product(to, Quat(from.w, -from.x, -from.y, -from.z));
    const double w = std::fabs(r.w) < kLeastCosine ? std::copysign(kLeastCosine, r.w) : r.w;
    return Vec3(r.x, r.y, r.z) * (2.0 / w);
}

Quat extract_rotation(const Mat3& matrix, const Quat& guess, int iterations) noexcept {
    const double size = std::sqrt(frobenius_squared(matrix));
    if (!(size > 0.0)) {
        return guess;
    }
    Quat q = guess;
    for (int i = 0; i < iterations; ++i) {
        const Mat3 r = to_matrix(q);
        const Vec3 torque = glm::cross(r[0], matrix[0]) + glm::cross(r[1], matrix[1]) + glm::cross(r[2], matrix[2]);
        const double overlap = glm::dot(r[0], matrix[0]) + glm::dot(r[1], matrix[1]) + glm::dot(r[2], matrix[2]);
        q = turned(q, torque / (std::fabs(overlap) + kLeastOverlap * size));
    }
    return q;
}

Vec3 solve_inertia(const Mat3& scatter, const Vec3& momentum) noexcept {
    const double trace = scatter[0][0] + scatter[1][1] + scatter[2][2];
    if (!(trace > 0.0)) {
        return Vec3(0.0);
    }
    const double diagonal = trace * (1.0 + kRegularisation);
    const double a = diagonal - scatter[0][0];
    const double b = diagonal - scatter[1][1];
    const double c = diagonal - scatter[2][2];
    const double d = -scatter[1][0];
    const double e = -scatter[2][0];
    const double f = -scatter[2][1];
    // Cholesky factors of the symmetric tensor (a d e; d b f; e f c); every pivot is at least trace * kRegularisation.
    const double least = trace * kRegularisation;
    const double d0 = a > least ? a : least;
    const double l10 = d / d0;
    const double l20 = e / d0;
    const double p1 = b - l10 * d;
    const double d1 = p1 > least ? p1 : least;
    const double g = f - l20 * d;
    const double l21 = g / d1;
    const double p2 = c - l20 * e - l21 * g;
    const double d2 = p2 > least ? p2 : least;
    const double y0 = momentum.x;
    const double y1 = momentum.y - l10 * y0;
    const double y2 = momentum.z - l20 * y0 - l21 * y1;
    const double x2 = y2 / d2;
    const double x1 = y1 / d1 - l21 * x2;
    const double x0 = y0 / d0 - l10 * x1 - l20 * x2;
    return {x0, x1, x2};
}

}  // namespace haptic::sim
