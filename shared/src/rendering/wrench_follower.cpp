#include "rendering/wrench_follower.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "haptic/numeric.hpp"

namespace haptic {
namespace {

// Factor on the change of force that the motion of the surfaces implies; the excess over 1 serves to catch up.
constexpr double kCatchUp = 1.5;
// N/s: how fast the force may change at rest, 1 mN per millisecond.
constexpr double kRateAtRest = 1.0;
// m, moment arm of a tool that is a single point: the radius of a grip.
constexpr double kMinMomentArm = 0.02;

/// Fraction of a change that the bound allows, 0..1.
double allowed_fraction(double allowed, double change) HAPTIC_RT {
    return change > allowed ? allowed / change : 1.0;
}

}  // namespace

Wrench WrenchFollower::follow(const WantedWrench& wanted, double elapsed_s) HAPTIC_RT {
    const Wrench& target = wanted.wrench;
    // A wrench that is not finite cannot be tracked: it is returned as it is, for the caller to reject.
    const double squared_size = glm::dot(target.force, target.force) + glm::dot(target.torque, target.torque);
    if (restarts_ || !std::isfinite(squared_size)) {
        restarts_ = false;
        output_ = std::isfinite(squared_size) ? target : Wrench{};
        release_rate_ = 0.0;
        return target;
    }
    // |dF| <= 1.5 max(min(|dE|, k U), k s mean |u_i|) + change of stiffness + (1 N/s) T, and the same for the torque.
    const double arm = std::max(wanted.max_moment_arm, kMinMomentArm);
    const double most = wanted.max_force_of_motion;
    const double motion = std::max(std::min(glm::length(wanted.announced.force), most), wanted.force_of_motion);
    const double torque_motion =
        std::max(std::min(glm::length(wanted.announced.torque), most * arm), wanted.force_of_motion * arm);
    double allowed = kCatchUp * motion + wanted.force_of_stiffness + kRateAtRest * elapsed_s;
    double torque_allowed = kCatchUp * torque_motion + wanted.torque_of_stiffness + kRateAtRest * elapsed_s * arm;
    // Out of contact: at least the rate that brings the wrench at the end of contact to zero in release_s.
    if (wanted.in_contact) {
        release_rate_ = 0.0;
    } else {
        if (release_rate_ == 0.0) {
            release_rate_ = std::max(glm::length(output_.force), glm::length(output_.torque) / arm) / release_s_;
        }
        allowed = std::max(allowed, release_rate_ * elapsed_s);
        torque_allowed = std::max(torque_allowed, release_rate_ * elapsed_s * arm);
    }
    // One fraction for force and torque, so that both arrive together.
    const Wrench change{target.force - output_.force, target.torque - output_.torque};
    const double fraction = std::min(allowed_fraction(allowed, glm::length(change.force)),
                                     allowed_fraction(torque_allowed, glm::length(change.torque)));
    // Exactly the target once it is within the bound.
    output_ = fraction < 1.0
                  ? Wrench{output_.force + fraction * change.force, output_.torque + fraction * change.torque}
                  : target;
    return output_;
}

}  // namespace haptic
