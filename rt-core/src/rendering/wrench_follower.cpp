#include "rendering/wrench_follower.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include <haptic/rt/finite.hpp>

namespace haptic::rt {
namespace {

// How much faster than the surface the force may change.
constexpr double kCatchUp = 1.5;
// N/s, that the force may change while all is at rest: 1 mN a millisecond.
constexpr double kAtRest = 1.0;
// m, lever of a tool that is a single point: the radius of a grip.
constexpr double kLeastLever = 0.02;

/// Part of a way that `allowed` is enough for, 0..1.
double share_of(double allowed, double way) HAPTIC_RT {
    return way > allowed ? allowed / way : 1.0;
}

}  // namespace

Wrench WrenchFollower::follow(const WantedWrench& wanted, double elapsed_s) HAPTIC_RT {
    const Wrench& to = wanted.wrench;
    // What has no measure cannot be approached: it is passed on, for the caller to refuse.
    const double measure = glm::dot(to.force, to.force) + glm::dot(to.torque, to.torque);
    if (leaps_ || !std::isfinite(measure)) {
        leaps_ = false;
        felt_ = std::isfinite(measure) ? to : Wrench{};
        release_ = 0.0;
        return to;
    }
    const double lever = std::max(wanted.lever, kLeastLever);
    double allowed = kCatchUp * wanted.travel + wanted.stiffening + kAtRest * elapsed_s;
    double torque_allowed = kCatchUp * wanted.torque_travel + wanted.torque_stiffening + kAtRest * elapsed_s;
    if (wanted.in_contact) {
        release_ = 0.0;
    } else {
        if (release_ == 0.0) {
            release_ = std::max(glm::length(felt_.force), glm::length(felt_.torque) / lever) / release_s_;
        }
        allowed = std::max(allowed, release_ * elapsed_s);
        torque_allowed = std::max(torque_allowed, release_ * elapsed_s);
    }
    const Wrench way{to.force - felt_.force, to.torque - felt_.torque};
    const double share =
        std::min(share_of(allowed, glm::length(way.force)), share_of(torque_allowed * lever, glm::length(way.torque)));
    felt_ = share < 1.0 ? Wrench{felt_.force + share * way.force, felt_.torque + share * way.torque} : to;
    return felt_;
}

}  // namespace haptic::rt
