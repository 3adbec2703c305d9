// Ellipsoid geometry over lanes. ellipsoids.hpp declares the same for single numbers, with equations and sources.
#pragma once

#include "simd/lanes.hpp"

namespace haptic::sim {

template <class Real>
HAPTIC_LANES LaneVec<Real> product(const LaneSymmetric<Real>& m, const LaneVec<Real>& v) noexcept {
    return {m.xx * v.x + m.yx * v.y + m.zx * v.z, m.yx * v.x + m.yy * v.y + m.zy * v.z,
            m.zx * v.x + m.zy * v.y + m.zz * v.z};
}

template <class Real>
HAPTIC_LANES LaneSymmetric<Real> combined(Real a, const LaneSymmetric<Real>& s, Real b,
                                          const LaneSymmetric<Real>& t) noexcept {
    return {a * s.xx + b * t.xx, a * s.yy + b * t.yy, a * s.zz + b * t.zz,
            a * s.yx + b * t.yx, a * s.zx + b * t.zx, a * s.zy + b * t.zy};
}

/// det(m) m^-1.
template <class Real>
HAPTIC_LANES LaneSymmetric<Real> adjugate(const LaneSymmetric<Real>& m) noexcept {
    return {m.yy * m.zz - m.zy * m.zy, m.xx * m.zz - m.zx * m.zx, m.xx * m.yy - m.yx * m.yx,
            m.zx * m.zy - m.yx * m.zz, m.yx * m.zy - m.zx * m.yy, m.yx * m.zx - m.zy * m.xx};
}

/// Square root; 0 for arguments that rounding made negative.
template <class Real>
HAPTIC_LANES Real root_or_zero(Real x) noexcept {
    return square_root(select(x > 0.0, x, Real{}));
}

/// Shape matrix R diag(a^2) R^T, with R by columns.
template <class Real>
HAPTIC_LANES LaneSymmetric<Real> lane_shape(const LaneVec<Real>& semi_axes, const LaneMat<Real>& r) noexcept {
    const LaneVec<Real> x = semi_axes.x * r.x;
    const LaneVec<Real> y = semi_axes.y * r.y;
    const LaneVec<Real> z = semi_axes.z * r.z;
    return {x.x * x.x + y.x * y.x + z.x * z.x, x.y * x.y + y.y * y.y + z.y * z.y, x.z * x.z + y.z * y.z + z.z * z.z,
            x.y * x.x + y.y * y.x + z.y * z.x, x.z * x.x + y.z * y.x + z.z * z.x, x.z * x.y + y.z * y.y + z.z * z.y};
}

/// Support distance along a unit normal, h(n) = sqrt(n^T S n).
template <class Real>
HAPTIC_LANES Real lane_reach(const LaneSymmetric<Real>& shape, const LaneVec<Real>& normal) noexcept {
    return root_or_zero(dot(normal, product(shape, normal)));
}

/// Two shapes, the ratio of their sizes p, and the first centre relative to the second at t = 0 and t = 1, m.
template <class Real>
struct LaneSweep {
    LaneSymmetric<Real> first, second;
    Real size_ratio;
    LaneVec<Real> from, to;
};

/// Time in [0, 1] at which the path enters the ellipsoid M, or is nearest to it: the smaller root of
/// v.v t^2 + 2 (p.v) t + (p.p - 1) = 0 in the metric of M^-1. All arguments are scaled by det M.
template <class Real>
HAPTIC_LANES Real lane_time_of_contact(Real speed_squared, Real along, Real outside) noexcept {
    const Real half_chord = root_or_zero(along * along - speed_squared * outside);
    const Real time = (-along - half_chord) / speed_squared;  // not a number without displacement: not selected
    const Real clamped = select(time < 1.0, time, broadcast<Real>(1.0));
    return select(along < 0.0, select(outside > 0.0, clamped, Real{}), Real{});
}

/// Unit normal toward the first, at which it enters M or passes nearest to it.
template <class Real>
HAPTIC_LANES LaneVec<Real> lane_separating_normal(const LaneSweep<Real>& sweep) noexcept {
    // Ellipsoid M that contains the Minkowski sum of both shapes, for the ratio of their sizes.
    const Real p = sweep.size_ratio;
    const LaneSymmetric<Real> m = combined(1.0 + p, sweep.first, 1.0 + 1.0 / p, sweep.second);
    const LaneSymmetric<Real> inverse = adjugate(m);  // times det M
    const Real det = m.xx * inverse.xx + m.yx * inverse.yx + m.zx * inverse.zx;
    // Position and displacement multiplied by M^-1 det M; the normal is the gradient of M's quadric at the contact.
    const LaneVec<Real> displacement = sweep.to - sweep.from;
    const LaneVec<Real> from = product(inverse, sweep.from);
    const LaneVec<Real> velocity = product(inverse, displacement);
    const Real time =
        lane_time_of_contact(dot(displacement, velocity), dot(sweep.from, velocity), dot(sweep.from, from) - det);
    const LaneVec<Real> normal = from + time * velocity;
    const Real length_squared = dot(normal, normal);
    const Real scale = 1.0 / square_root(length_squared);
    // Coincident centres have no direction: separate them vertically.
    const LaneVec<Real> upward{Real{}, broadcast<Real>(1.0), Real{}};
    return select(length_squared > 0.0, scale * normal, upward);
}

}  // namespace haptic::sim
