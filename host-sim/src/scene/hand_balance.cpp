#include "scene/hand_balance.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace haptic::sim {
namespace {

// Part of the debt that a step pays.
constexpr double kPaid = 0.5;
// s, time constant with which a debt is forgotten while nothing touches
constexpr double kForget = 1.0;
// s, longest time that the present force would take to pay a debt; more is forgotten
constexpr double kLongestDebt = 0.2;

}  // namespace

HandBalance::Share HandBalance::begin_step(const std::optional<DeviceFeedback>& feedback, const Workspace& workspace,
                                           double stiffness, double gain, double step_s) noexcept {
    Share share{.gain = gain};
    // Without a device the hand feels the simulated force itself.
    if (!feedback || !(workspace.settings().force_scale > 0.0)) {
        *this = {};
        return share;
    }
    // Stiffness that the device renders, and the part of its wrench.
    const double rendered = workspace.coupling_to_scene(feedback->stiffness);
    if (rendered < gain * stiffness) {
        share.gain = rendered / stiffness;
    }
    share.gain *= std::clamp(feedback->scale, 0.0, 1.0);
    // Impulse of the last step at the hand, minus that of the bodies.
    if (last_impulse_) {
        share.hand_impulse = feedback->impulse - *last_impulse_;
        // Along the force alone: across it the hand feels what the strings cannot avoid, not the bodies.
        const double given = glm::length(given_);
        const Vec3 missing = workspace.force_to_scene(share.hand_impulse) - given_;
        owed_ += given > 0.0 ? (glm::dot(missing, given_) / (given * given)) * given_ : Vec3(0.0);
    }
    last_impulse_ = feedback->impulse;
    // Bound the debt; forget it while nothing touches.
    if (const double debt = glm::length(owed_); debt > limit_) {
        owed_ *= limit_ / debt;
    }
    if (given_ == Vec3(0.0)) {
        owed_ /= 1.0 + step_s / kForget;
    }
    share.owed_force = (kPaid / step_s) * owed_;
    return share;
}

void HandBalance::end_step(const Vec3& force, double step_s) noexcept {
    given_ = step_s * force;
    limit_ = std::max(limit_ / (1.0 + step_s / kForget), kLongestDebt * glm::length(force));
}

}  // namespace haptic::sim
