#include "scene/rigid_group.hpp"

#include <algorithm>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

constexpr int kSweeps = 16;
constexpr int kMostRaised = 48;  // times
// A body is as thick as if this part of its scatter were the same in all directions: points beside a row of particles
// would turn it about that without effort.
constexpr double kThickness = 1e-3;

/// A rigid body that is pushed.
class Pushed {
  public:
    explicit Pushed(const RigidGroup& group) : mass_(group.mass) {
        const Mat3& s = group.scatter;
        const Mat3 scatter = s + Mat3(kThickness * (s[0][0] + s[1][1] + s[2][2]));
        for (int k = 0; k < 3; ++k) {
            Vec3 unit(0.0);
            unit[k] = 1.0;
            inverse_inertia_[k] = solve_inertia(scatter, unit);
        }
    }
    /// What a push at an arm from the centre changes.
    [[nodiscard]] Twist change_by(const Vec3& push, const Vec3& arm) const noexcept {
        return {.linear = push / mass_, .angular = inverse_inertia_ * glm::cross(arm, push)};
    }
    /// How much a push along an axis changes there.
    [[nodiscard]] double mobility(int axis, const Vec3& arm) const noexcept {
        Vec3 unit(0.0);
        unit[axis] = 1.0;
        return change_by(unit, arm).at(arm)[axis];
    }

  private:
    double mass_;
    Mat3 inverse_inertia_{0.0};
};

}  // namespace

bool FloorSupports::raise(std::uint32_t name, const Vec3& point, const Vec3& centre, double more,
                          const Twist& way) noexcept {
    const auto end = supports_.begin() + static_cast<std::ptrdiff_t>(count_);
    const auto support = std::find_if(supports_.begin(), end, [&](const Support& s) { return s.name == name; });
    if (++raised_ > kMostRaised || (support == end && count_ == kMost)) {
        return false;
    }
    if (support == end) {
        *support = {.name = name, .point = point, .arm = point - centre};
        ++count_;
    }
    support->least = way.at(support->arm).y + more;
    return true;
}

void FloorSupports::stop(const RigidMotion& motion, const Vec3& centre) noexcept {
    std::size_t left = 0;
    for (const Support& support : std::span(supports_).first(count_)) {
        if (support.push.y > 0.0) {
            const Vec3 point = motion(support.point);
            supports_[left++] = {.name = support.name, .point = point, .arm = point - centre};
        }
    }
    count_ = left;
}

void FloorSupports::hold_up(const RigidGroup& group, double friction, Twist& twist) noexcept {
    const Pushed body(group);
    const auto push_by = [&](Support& support, const Vec3& push) {
        const Twist change = body.change_by(push, support.arm);
        support.push += push;
        twist.linear += change.linear;
        twist.angular += change.angular;
    };
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        for (Support& support : std::span(supports_).first(count_)) {
            const double up = (support.least - twist.at(support.arm).y) / body.mobility(1, support.arm);
            push_by(support, Vec3(0.0, std::max(up, -support.push.y), 0.0));
            // Along the floor as far as friction holds.
            const Vec3 slip = twist.at(support.arm);
            Vec3 hold(support.push.x - slip.x / body.mobility(0, support.arm), 0.0,
                      support.push.z - slip.z / body.mobility(2, support.arm));
            const double grip = friction * support.push.y;
            if (const double length = glm::length(hold); length > grip) {
                hold *= grip / length;
            }
            push_by(support, Vec3(hold.x - support.push.x, 0.0, hold.z - support.push.z));
        }
    }
}

}  // namespace haptic::sim
