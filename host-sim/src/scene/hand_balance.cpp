#include "scene/hand_balance.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace haptic::sim {
namespace {

// Largest part of the debt that a step pays.
constexpr double kPaid = 0.5;
// s, time constants of the payment: in contact long beside what a network delays, after it within what is remembered
constexpr double kPaymentTime = 0.1;
constexpr double kPaymentTimeAfter = 0.02;
// s, longest time that the largest force of the last second would take to pay a debt; more is forgotten
constexpr double kLongestDebt = 0.2;
constexpr double kLargestForceFor = 1.0;
// s after a contact, in which the hand may still feel it: rt-core ends the force within 50 ms
constexpr double kAfterContact = 0.1;

}  // namespace

HandBalance::Share HandBalance::begin_step(const std::optional<DeviceFeedback>& feedback, const Workspace& workspace,
                                           double stiffness, double gain, double step_s,
                                           std::int64_t time_ns) noexcept {
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
    limit_ /= 1.0 + step_s / kLargestForceFor;
    if (last_impulse_) {
        // In the scene's time, which passes more slowly where steps are late.
        const double late = std::max(1.0, seconds(time_ns - last_time_ns_) / step_s);
        share.hand_impulse = (feedback->impulse - *last_impulse_) / late;
        const Vec3 felt = workspace.force_to_scene(share.hand_impulse);
        owed_ += felt - given_;
        limit_ = std::max(limit_, kLongestDebt * glm::length(felt) / step_s);
    }
    last_impulse_ = feedback->impulse;
    last_time_ns_ = time_ns;
    // Bound the debt, and forget it once neither hand nor bodies have felt anything for a while.
    const bool quiet = share.hand_impulse == Vec3(0.0) && given_ == Vec3(0.0);
    quiet_s_ = quiet ? quiet_s_ + step_s : 0.0;
    if (quiet_s_ > kAfterContact) {
        owed_ = Vec3(0.0);
    } else if (const double debt = glm::length(owed_); debt > limit_) {
        owed_ *= limit_ / debt;
    }
    // The hand may meet a surface before the simulation does: nothing is paid to a body that it left long ago.
    const double part = std::min(kPaid, step_s / (since_contact_s_ > 0.0 ? kPaymentTimeAfter : kPaymentTime));
    share.owed_force = since_contact_s_ <= kAfterContact ? (part / step_s) * owed_ : Vec3(0.0);
    return share;
}

void HandBalance::end_step(const Vec3& force, bool in_contact, double step_s) noexcept {
    given_ = step_s * force;
    since_contact_s_ = in_contact ? 0.0 : since_contact_s_ + step_s;
    limit_ = std::max(limit_, kLongestDebt * glm::length(force));
}

}  // namespace haptic::sim
