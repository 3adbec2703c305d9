// What haptic/sim/rotation.hpp declares, over lanes; the equations and their sources are there.
#pragma once

#include "lanes.hpp"

namespace haptic::sim {

// Half a turn has no finite Cayley vector: it is cut off just before.
inline constexpr double kLeastCosine = 1e-6;
// Of the overlap of matrix and rotation, relative to the matrix, so that the result does not depend on units.
inline constexpr double kLeastOverlap = 1e-9;
// Far below rounding of the determined part, far above what rounding leaves in the undetermined one.
inline constexpr double kRegularisation = 1e-13;

template <class Real>
HAPTIC_LANES LaneMat<Real> lane_matrix(const LaneQuat<Real>& q) noexcept {
    const Real xx = 2.0 * q.x * q.x;
    const Real yy = 2.0 * q.y * q.y;
    const Real zz = 2.0 * q.z * q.z;
    const Real xy = 2.0 * q.x * q.y;
    const Real xz = 2.0 * q.x * q.z;
    const Real yz = 2.0 * q.y * q.z;
    const Real wx = 2.0 * q.w * q.x;
    const Real wy = 2.0 * q.w * q.y;
    const Real wz = 2.0 * q.w * q.z;
    return {{1.0 - yy - zz, xy + wz, xz - wy}, {xy - wz, 1.0 - xx - zz, yz + wx}, {xz + wy, yz - wx, 1.0 - xx - yy}};
}

template <class Real>
HAPTIC_LANES LaneQuat<Real> lane_turned(const LaneQuat<Real>& q, const LaneVec<Real>& turn) noexcept {
    const LaneQuat<Real> r = LaneQuat<Real>{broadcast<Real>(1.0), 0.5 * turn.x, 0.5 * turn.y, 0.5 * turn.z} * q;
    const Real scale = 1.0 / square_root(r.w * r.w + r.x * r.x + r.y * r.y + r.z * r.z);
    return {r.w * scale, r.x * scale, r.y * scale, r.z * scale};
}

template <class Real>
HAPTIC_LANES LaneVec<Real> lane_turn_between(const LaneQuat<Real>& from, const LaneQuat<Real>& to) noexcept {
    const LaneQuat<Real> r = to * LaneQuat<Real>{from.w, -from.x, -from.y, -from.z};
    const Real cut_off = copy_sign(broadcast<Real>(kLeastCosine), r.w);
    const Real w = select(absolute(r.w) < kLeastCosine, cut_off, r.w);
    return (2.0 / w) * LaneVec<Real>{r.x, r.y, r.z};
}

template <class Real>
HAPTIC_LANES LaneQuat<Real> lane_extract_rotation(const LaneMat<Real>& matrix, const LaneQuat<Real>& guess,
                                                  int iterations) noexcept {
    const Real size = square_root(dot(matrix.x, matrix.x) + dot(matrix.y, matrix.y) + dot(matrix.z, matrix.z));
    LaneQuat<Real> q = guess;
    for (int i = 0; i < iterations; ++i) {
        const LaneMat<Real> r = lane_matrix(q);
        const LaneVec<Real> torque = cross(r.x, matrix.x) + cross(r.y, matrix.y) + cross(r.z, matrix.z);
        const Real overlap = dot(r.x, matrix.x) + dot(r.y, matrix.y) + dot(r.z, matrix.z);
        q = lane_turned(q, torque / (absolute(overlap) + kLeastOverlap * size));
    }
    return select(size > 0.0, q, guess);  // zero by zero has been divided where the size is 0
}

template <class Real>
HAPTIC_LANES LaneVec<Real> lane_solve_inertia(const LaneSymmetric<Real>& scatter,
                                              const LaneVec<Real>& momentum) noexcept {
    const Real trace = scatter.xx + scatter.yy + scatter.zz;
    const Real diagonal = trace * (1.0 + kRegularisation);
    const Real a = diagonal - scatter.xx;
    const Real b = diagonal - scatter.yy;
    const Real c = diagonal - scatter.zz;
    const Real d = -scatter.yx;
    const Real e = -scatter.zx;
    const Real f = -scatter.zy;
    // Cholesky factors of the symmetric tensor (a d e; d b f; e f c); every pivot is at least trace * kRegularisation.
    const Real least = trace * kRegularisation;
    const Real d0 = select(a > least, a, least);
    const Real l10 = d / d0;
    const Real l20 = e / d0;
    const Real p1 = b - l10 * d;
    const Real d1 = select(p1 > least, p1, least);
    const Real g = f - l20 * d;
    const Real l21 = g / d1;
    const Real p2 = c - l20 * e - l21 * g;
    const Real d2 = select(p2 > least, p2, least);
    const Real y0 = momentum.x;
    const Real y1 = momentum.y - l10 * y0;
    const Real y2 = momentum.z - l20 * y0 - l21 * y1;
    const Real x2 = y2 / d2;
    const Real x1 = y1 / d1 - l21 * x2;
    const Real x0 = y0 / d0 - l10 * x1 - l20 * x2;
    return select(trace > 0.0, LaneVec<Real>{x0, x1, x2}, LaneVec<Real>{});
}

}  // namespace haptic::sim
