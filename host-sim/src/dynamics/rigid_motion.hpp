// Rigid motions of all points over a step.
//
// They close no gap: on the straight paths that lead from start to end all points are mapped affinely at each moment,
// by 1 + t (R - 1), which has an inverse as long as R turns by less than half a turn.
#pragma once

#include "dynamics/rotation.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class RigidMotion {
  public:
    /// None: it leaves points where they are.
    RigidMotion() = default;
    [[nodiscard]] static RigidMotion by(const Vec3& way) noexcept { return {Vec3(0.0), Vec3(0.0), way}; }
    /// By a rotation vector about a centre, rad, with the Cayley map as turned() does, and then by a way, m.
    RigidMotion(const Vec3& centre, const Vec3& rotation, const Vec3& way) noexcept
        : centre_(centre),
          way_(way),
          rotation_(rotation),
          turn_less_one_(rotation == Vec3(0.0) ? Mat3(0.0)
                                               : to_matrix(turned(Quat(1.0, 0.0, 0.0, 0.0), rotation)) - Mat3(1.0)) {}

    [[nodiscard]] Vec3 operator()(const Vec3& point) const noexcept {
        return point + (way_ + turn_less_one_ * (point - centre_));
    }
    [[nodiscard]] Quat operator()(const Quat& orientation) const noexcept {
        return rotation_ == Vec3(0.0) ? orientation : turned(orientation, rotation_);
    }
    /// m, of the centre.
    [[nodiscard]] const Vec3& way() const noexcept { return way_; }

  private:
    Vec3 centre_{0.0};
    Vec3 way_{0.0};
    Vec3 rotation_{0.0};
    Mat3 turn_less_one_{0.0};
};

}  // namespace haptic::sim
