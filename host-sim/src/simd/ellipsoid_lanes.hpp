// What ellipsoids.hpp declares, over lanes; the equations and their sources are there.
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

/// 0 for what rounding has made negative.
template <class Real>
HAPTIC_LANES Real root_of_positive(Real x) noexcept {
    return square_root(select(x > 0.0, x, Real{}));
}

/// See shape_of(); the columns of the rotation.
template <class Real>
HAPTIC_LANES LaneSymmetric<Real> lane_shape(const LaneVec<Real>& semi_axes, const LaneMat<Real>& r) noexcept {
    const LaneVec<Real> x = semi_axes.x * r.x;
    const LaneVec<Real> y = semi_axes.y * r.y;
    const LaneVec<Real> z = semi_axes.z * r.z;
    return {x.x * x.x + y.x * y.x + z.x * z.x, x.y * x.y + y.y * y.y + z.y * z.y, x.z * x.z + y.z * y.z + z.z * z.z,
            x.y * x.x + y.y * y.x + z.y * z.x, x.z * x.x + y.z * y.x + z.z * z.x, x.z * x.y + y.z * y.y + z.z * z.y};
}

/// See reach_of().
template <class Real>
HAPTIC_LANES Real lane_reach(const LaneSymmetric<Real>& shape, const LaneVec<Real>& normal) noexcept {
    return root_of_positive(dot(normal, product(shape, normal)));
}

/// See EllipsoidPassage.
template <class Real>
struct LanePassage {
    LaneSymmetric<Real> first, second;
    Real size_ratio;
    LaneVec<Real> from, to;
};

/// When the way enters M, or is nearest to it; all arguments are scaled by det M.
template <class Real>
HAPTIC_LANES Real lane_time_of_contact(Real speed_squared, Real along, Real outside) noexcept {
    const Real before_nearest = root_of_positive(along * along - speed_squared * outside);
    const Real time = (-along - before_nearest) / speed_squared;  // of one that does not move: not used
    const Real at_most_1 = select(time < 1.0, time, broadcast<Real>(1.0));
    return select(along < 0.0, select(outside > 0.0, at_most_1, Real{}), Real{});
}

/// See parting_normal().
template <class Real>
HAPTIC_LANES LaneVec<Real> lane_parting_normal(const LanePassage<Real>& passage) noexcept {
    const Real p = passage.size_ratio;
    const LaneSymmetric<Real> m = combined(1.0 + p, passage.first, 1.0 + 1.0 / p, passage.second);
    const LaneSymmetric<Real> inverse = adjugate(m);  // times det M
    const Real det = m.xx * inverse.xx + m.yx * inverse.yx + m.zx * inverse.zx;
    const LaneVec<Real> way = passage.to - passage.from;
    const LaneVec<Real> from = product(inverse, passage.from);
    const LaneVec<Real> going = product(inverse, way);
    const Real time = lane_time_of_contact(dot(way, going), dot(passage.from, going), dot(passage.from, from) - det);
    const LaneVec<Real> normal = from + time * going;
    const Real length_squared = dot(normal, normal);
    const Real scale = 1.0 / square_root(length_squared);
    // Centres in one place have no direction in which to part.
    const LaneVec<Real> upward{Real{}, broadcast<Real>(1.0), Real{}};
    return select(length_squared > 0.0, scale * normal, upward);
}

}  // namespace haptic::sim
