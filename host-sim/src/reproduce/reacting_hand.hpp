// Reacting hand: a mass on a spring and a damper to the intended path. The rendered force moves it, so that an
// unstable rendering shows as motion that nobody intended.
//
//     M x'' = F + K (x_i - x) + D (x_i' - x'),   x_i the intended position, F the force on the hand
//
// The values are those of a fingertip that presses with 2 to 20 N: K = 255 to 1255 N/m, D = 4.0 to 7.4 N s/m; the mass
// of the fingertip, 3.5 to 8.7 g, is small against that of the grip it holds. Orientations are the intended ones.
// @source A. Hajian, R. Howe, "Identification of the mechanical impedance at the human finger tip", Journal of
// Biomechanical Engineering 119, 1997
#pragma once

#include "haptic/types.hpp"

namespace haptic::sim::reproduce {

struct HandImpedance {
    double mass = 0.1;         // kg, of the grip
    double stiffness = 255.0;  // N/m, a loose hold
    double damping = 4.0;      // N s/m
};

class ReactingHand {
  public:
    /// At rest at the start of the intended path.
    ReactingHand(const HandImpedance& impedance, const Pose& start)
        : impedance_(impedance), pose_(start), intended_(start) {}

    [[nodiscard]] const Pose& pose() const noexcept { return pose_; }
    /// Moves on by dt (s) while the intended pose moves evenly to `intended` and `force` (N) acts.
    void advance(const Pose& intended, const Vec3& force, double dt) noexcept;

  private:
    HandImpedance impedance_;
    Pose pose_;
    Pose intended_;
    Vec3 velocity_{0.0};
};

}  // namespace haptic::sim::reproduce
