// Rotations over lanes. dynamics/rotation.hpp declares the same for single numbers, with equations and sources.
#pragma once

#include "simd/lanes.hpp"

namespace haptic::sim {

// A half turn has no finite Cayley vector: the cosine of half the angle is kept above this.
inline constexpr double kMinCosine = 1e-6;
// Added to the inertia, relative to it: far below the rounding of a determined direction, above what rounding leaves in
// an undetermined one.
template <class Number>
inline constexpr Number kRegularisation = static_cast<Number>(sizeof(Number) == sizeof(double) ? 1e-13 : 1e-6);
// Smallest trace of a scatter matrix; below, the points count as coincident. Keeps inverse pivots finite.
template <class Number>
inline constexpr Number kMinScatter = static_cast<Number>(sizeof(Number) == sizeof(double) ? 1e-280 : 1e-30);

template <class Real>
HAPTIC_LANES LaneMat<Real> lane_matrix(const LaneQuat<Real>& q) noexcept {
    const Real x = q.x + q.x;
    const Real y = q.y + q.y;
    const Real z = q.z + q.z;
    const Real xx = x * q.x;
    const Real yy = y * q.y;
    const Real zz = z * q.z;
    const Real xy = x * q.y;
    const Real xz = x * q.z;
    const Real yz = y * q.z;
    const Real wx = x * q.w;
    const Real wy = y * q.w;
    const Real wz = z * q.w;
    const NumberOf<Real> one(1);
    return {{one - yy - zz, xy + wz, xz - wy}, {xy - wz, one - xx - zz, yz + wx}, {xz + wy, yz - wx, one - xx - yy}};
}

template <class Real>
HAPTIC_LANES Real dot(const LaneQuat<Real>& a, const LaneQuat<Real>& b) noexcept {
    return (a.w * b.w + a.x * b.x) + (a.y * b.y + a.z * b.z);
}

template <class Real>
HAPTIC_LANES LaneQuat<Real> normalised(const LaneQuat<Real>& q) noexcept {
    const Real scale = NumberOf<Real>(1) / square_root(dot(q, q));
    return {q.w * scale, q.x * scale, q.y * scale, q.z * scale};
}

template <class Real>
HAPTIC_LANES LaneQuat<Real> lane_rotated(const LaneQuat<Real>& q, const LaneVec<Real>& rotation) noexcept {
    // Cayley map: (1, rotation / 2), normalised.
    const NumberOf<Real> half(0.5);
    return normalised(
        LaneQuat<Real>{broadcast<Real>(NumberOf<Real>(1)), half * rotation.x, half * rotation.y, half * rotation.z} *
        q);
}

template <class Real>
HAPTIC_LANES LaneVec<Real> lane_rotation_between(const LaneQuat<Real>& from, const LaneQuat<Real>& to) noexcept {
    // Vector part over scalar part of to * conj(from), times 2. Dividing by the signed scalar takes the shorter
    // rotation.
    const LaneQuat<Real> r = to * LaneQuat<Real>{from.w, -from.x, -from.y, -from.z};
    const NumberOf<Real> min_cosine(kMinCosine);
    const Real limited = copy_sign(broadcast<Real>(min_cosine), r.w);
    const Real w = select(absolute(r.w) < min_cosine, limited, r.w);
    return (NumberOf<Real>(2) / w) * LaneVec<Real>{r.x, r.y, r.z};
}

/// Horn's symmetric matrix K of A, with tr(R(q)^T A) = q^T K q.
template <class Real>
struct LaneOverlap {
    Real ww, xx, yy, zz, wx, wy, wz, xy, xz, yz;
};

template <class Real>
HAPTIC_LANES LaneOverlap<Real> operator+(const LaneOverlap<Real>& a, const LaneOverlap<Real>& b) noexcept {
    return {a.ww + b.ww, a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.wx + b.wx,
            a.wy + b.wy, a.wz + b.wz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
}
template <class Real>
HAPTIC_LANES LaneOverlap<Real> operator*(Real s, const LaneOverlap<Real>& a) noexcept {
    return {s * a.ww, s * a.xx, s * a.yy, s * a.zz, s * a.wx, s * a.wy, s * a.wz, s * a.xy, s * a.xz, s * a.yz};
}

template <class Real>
HAPTIC_LANES LaneOverlap<Real> overlap_of(const LaneMat<Real>& a) noexcept {
    const Real sum = a.y.y + a.z.z;
    const Real difference = a.y.y - a.z.z;
    return {.ww = a.x.x + sum,
            .xx = a.x.x - sum,
            .yy = difference - a.x.x,
            .zz = -difference - a.x.x,
            .wx = a.y.z - a.z.y,
            .wy = a.z.x - a.x.z,
            .wz = a.x.y - a.y.x,
            .xy = a.y.x + a.x.y,
            .xz = a.z.x + a.x.z,
            .yz = a.z.y + a.y.z};
}

template <class Real>
HAPTIC_LANES LaneQuat<Real> operator*(const LaneOverlap<Real>& k, const LaneQuat<Real>& q) noexcept {
    return {
        (k.ww * q.w + k.wx * q.x) + (k.wy * q.y + k.wz * q.z), (k.wx * q.w + k.xx * q.x) + (k.xy * q.y + k.xz * q.z),
        (k.wy * q.w + k.xy * q.x) + (k.yy * q.y + k.yz * q.z), (k.wz * q.w + k.xz * q.x) + (k.yz * q.y + k.zz * q.z)};
}

template <class Real>
HAPTIC_LANES LaneQuat<Real> lane_greatest_overlap(const LaneOverlap<Real>& k, const LaneQuat<Real>& guess,
                                                  int iterations) noexcept {
    // Power iteration toward the eigenvector of K with the largest eigenvalue, q <- normalise((K + shift) q). With
    // o = q^T K q the shift 2 |o| - o makes it a descent for any sign of o.
    LaneQuat<Real> q = guess;
    for (int i = 0; i < iterations; ++i) {
        const LaneQuat<Real> g = k * q;
        const Real overlap = dot(q, g);
        const Real magnitude = absolute(overlap);
        const Real shift = (magnitude - overlap) + magnitude;
        const LaneQuat<Real> next{g.w + shift * q.w, g.x + shift * q.x, g.y + shift * q.y, g.z + shift * q.z};
        const Real square = dot(next, next);
        const Real scale = NumberOf<Real>(1) / square_root(square);
        // A square of 0 means that K determines nothing: keep q instead of 0 / 0.
        q = select(square > NumberOf<Real>(0),
                   LaneQuat<Real>{next.w * scale, next.x * scale, next.y * scale, next.z * scale}, q);
    }
    return q;
}

template <class Real>
HAPTIC_LANES LaneQuat<Real> lane_extract_rotation(const LaneMat<Real>& matrix, const LaneQuat<Real>& guess,
                                                  int iterations) noexcept {
    return lane_greatest_overlap(overlap_of(matrix), guess, iterations);
}

/// Cholesky factors L D L^T of an inertia tensor.
template <class Real>
struct LaneInertia {
    Real inverse_d0, inverse_d1, inverse_d2, l10, l20, l21;
};

/// Factors of trace(S) 1 - S, with S the scatter matrix; all 0 where all points coincide.
template <class Real>
HAPTIC_LANES LaneInertia<Real> lane_inertia(const LaneSymmetric<Real>& scatter) noexcept {
    using Number = NumberOf<Real>;
    const Number one(1);
    // Tensor (a d e; d b f; e f c) with a slightly raised diagonal, so that it is not singular for collinear points.
    const Real trace = scatter.xx + scatter.yy + scatter.zz;
    const Real diagonal = trace * (one + kRegularisation<Number>);
    const Real b = diagonal - scatter.yy;
    const Real c = diagonal - scatter.zz;
    const Real d = -scatter.yx;
    const Real e = -scatter.zx;
    const Real f = -scatter.zy;
    // LDL^T by columns. Every pivot is at least trace * kRegularisation.
    const Real min_pivot = trace * kRegularisation<Number>;
    const Real a = diagonal - scatter.xx;
    const Real i0 = one / select(a > min_pivot, a, min_pivot);
    const Real l10 = d * i0;
    const Real l20 = e * i0;
    const Real p1 = b - l10 * d;
    const Real i1 = one / select(p1 > min_pivot, p1, min_pivot);
    const Real g = f - l20 * d;
    const Real l21 = g * i1;
    const Real p2 = c - l20 * e - l21 * g;
    const Real i2 = one / select(p2 > min_pivot, p2, min_pivot);
    // Coincident points: all factors 0, so that solving gives 0.
    const auto spread = trace > kMinScatter<Number>;
    const Real zero{};
    return {select(spread, i0, zero),  select(spread, i1, zero),  select(spread, i2, zero),
            select(spread, l10, zero), select(spread, l20, zero), select(spread, l21, zero)};
}

/// Angular velocity of this angular momentum: forward and back substitution with L D L^T.
template <class Real>
HAPTIC_LANES LaneVec<Real> operator/(const LaneVec<Real>& momentum, const LaneInertia<Real>& inertia) noexcept {
    const Real y1 = momentum.y - inertia.l10 * momentum.x;
    const Real y2 = momentum.z - inertia.l20 * momentum.x - inertia.l21 * y1;
    const Real x2 = y2 * inertia.inverse_d2;
    const Real x1 = y1 * inertia.inverse_d1 - inertia.l21 * x2;
    const Real x0 = momentum.x * inertia.inverse_d0 - inertia.l10 * x1 - inertia.l20 * x2;
    return {x0, x1, x2};
}

}  // namespace haptic::sim
