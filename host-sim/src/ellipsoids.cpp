#include "ellipsoids.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "haptic/sim/rotation.hpp"

namespace haptic::sim {
namespace {

Vec3 product(const EllipsoidShape& m, const Vec3& v) noexcept {
    return {m.xx * v.x + m.yx * v.y + m.zx * v.z, m.yx * v.x + m.yy * v.y + m.zy * v.z,
            m.zx * v.x + m.zy * v.y + m.zz * v.z};
}

EllipsoidShape combined(double a, const EllipsoidShape& s, double b, const EllipsoidShape& t) noexcept {
    return {a * s.xx + b * t.xx, a * s.yy + b * t.yy, a * s.zz + b * t.zz,
            a * s.yx + b * t.yx, a * s.zx + b * t.zx, a * s.zy + b * t.zy};
}

/// det(m) m^-1.
EllipsoidShape adjugate(const EllipsoidShape& m) noexcept {
    return {m.yy * m.zz - m.zy * m.zy, m.xx * m.zz - m.zx * m.zx, m.xx * m.yy - m.yx * m.yx,
            m.zx * m.zy - m.yx * m.zz, m.yx * m.zy - m.zx * m.yy, m.yx * m.zx - m.zy * m.xx};
}

/// When the way enters M, or is nearest to it; all arguments are scaled by det M.
double time_of_contact(double speed_squared, double along, double outside) noexcept {
    if (!(along < 0.0) || outside <= 0.0) {
        return 0.0;
    }
    const double inside_squared = along * along - speed_squared * outside;
    const double before_nearest = inside_squared > 0.0 ? std::sqrt(inside_squared) : 0.0;
    const double time = (-along - before_nearest) / speed_squared;
    return time < 1.0 ? time : 1.0;
}

}  // namespace

EllipsoidShape shape_of(const Vec3& semi_axes, const Quat& turn) noexcept {
    const Mat3 r = to_matrix(turn);
    const Vec3 x = semi_axes.x * r[0];
    const Vec3 y = semi_axes.y * r[1];
    const Vec3 z = semi_axes.z * r[2];
    return {x.x * x.x + y.x * y.x + z.x * z.x, x.y * x.y + y.y * y.y + z.y * z.y, x.z * x.z + y.z * y.z + z.z * z.z,
            x.y * x.x + y.y * y.x + z.y * z.x, x.z * x.x + y.z * y.x + z.z * z.x, x.z * x.y + y.z * y.y + z.z * z.y};
}

double reach_of(const EllipsoidShape& shape, const Vec3& normal) noexcept {
    const double squared = glm::dot(normal, product(shape, normal));
    return squared > 0.0 ? std::sqrt(squared) : 0.0;
}

double reach_up(const Vec3& semi_axes, const Quat& q) noexcept {
    // The middle row of the rotation matrix.
    const Vec3 row(2.0 * (q.x * q.y + q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z - q.w * q.x));
    return glm::length(semi_axes * row);
}

Vec3 parting_normal(const EllipsoidPassage& passage) noexcept {
    const double p = passage.size_ratio;
    const EllipsoidShape m = combined(1.0 + p, passage.first, 1.0 + 1.0 / p, passage.second);
    const EllipsoidShape inverse = adjugate(m);  // times det M
    const double det = m.xx * inverse.xx + m.yx * inverse.yx + m.zx * inverse.zx;
    const Vec3 from = product(inverse, passage.from);
    const Vec3 going = product(inverse, passage.to - passage.from);
    const Vec3 way = passage.to - passage.from;
    const double time =
        time_of_contact(glm::dot(way, going), glm::dot(passage.from, going), glm::dot(passage.from, from) - det);
    const Vec3 normal = from + time * going;
    const double length_squared = glm::dot(normal, normal);
    if (!(length_squared > 0.0)) {
        return {0.0, 1.0, 0.0};  // centres in one place have no direction in which to part
    }
    return normal / std::sqrt(length_squared);
}

}  // namespace haptic::sim
