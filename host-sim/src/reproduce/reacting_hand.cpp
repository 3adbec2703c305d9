#include "reproduce/reacting_hand.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr int kSubSteps = 20;  // 50 us of a millisecond; the hand's period is 0.1 s

}  // namespace

void ReactingHand::advance(const Pose& intended, const Vec3& force, double dt) noexcept {
    const double h = dt / kSubSteps;
    const Vec3 intended_velocity = (intended.position - intended_.position) / dt;
    for (int i = 1; i <= kSubSteps; ++i) {
        // Semi-implicit Euler: velocity from the present forces, then position from the new velocity.
        const Vec3 path = intended_.position + static_cast<double>(i) * h * intended_velocity;
        const Vec3 pull =
            impedance_.stiffness * (path - pose_.position) + impedance_.damping * (intended_velocity - velocity_);
        velocity_ += h / impedance_.mass * (force + pull);
        pose_.position += h * velocity_;
    }
    pose_.orientation = intended.orientation;
    intended_ = intended;
}

}  // namespace haptic::sim::reproduce
