#include "scene/rigid_group.hpp"

#include <algorithm>
#include <limits>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

constexpr int kSweeps = 16;
constexpr int kMostRaised = 48;  // times

/// What a push at an arm from the centre changes.
Twist change_by(const Vec3& push, const Vec3& arm, const RigidGroup& group) noexcept {
    return {.linear = push / group.mass, .angular = solve_inertia(group.scatter, glm::cross(arm, push))};
}

}  // namespace

bool FloorSupports::raise(std::uint32_t name, const Vec3& arm, double more, const Twist& way) noexcept {
    const auto end = supports_.begin() + static_cast<std::ptrdiff_t>(count_);
    auto support = std::find_if(supports_.begin(), end, [&](const Support& s) { return s.name == name; });
    if (++raised_ > kMostRaised || (support == end && count_ == kMost)) {
        return false;
    }
    count_ += support == end ? 1 : 0;
    *support = {
        .name = name, .arm = arm, .least = way.at(arm).y + more, .push = support == end ? Vec3(0.0) : support->push};
    return true;
}

void FloorSupports::stop() noexcept {
    std::size_t left = 0;
    for (const Support& support : std::span(supports_).first(count_)) {
        if (support.push.y > 0.0) {
            supports_[left++] = {.name = support.name, .arm = support.arm};
        }
    }
    count_ = left;
}

void FloorSupports::hold_up(const RigidGroup& group, double friction, Twist& twist) noexcept {
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        for (Support& support : std::span(supports_).first(count_)) {
            // Up first, then along the floor as far as friction holds.
            for (const int axis : {1, 0, 2}) {
                Vec3 unit(0.0);
                unit[axis] = 1.0;
                const double mobility = change_by(unit, support.arm, group).at(support.arm)[axis];
                const double wanted = axis == 1 ? support.least : 0.0;
                const double push = support.push[axis] + (wanted - twist.at(support.arm)[axis]) / mobility;
                const double grip = friction * support.push.y;
                const double kept = axis == 1 ? std::max(push, 0.0) : std::clamp(push, -grip, grip);
                const Twist change = change_by((kept - support.push[axis]) * unit, support.arm, group);
                support.push[axis] = kept;
                twist.linear += change.linear;
                twist.angular += change.angular;
            }
        }
    }
}

}  // namespace haptic::sim
