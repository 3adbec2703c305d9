#include "emulated/mechanical_grip.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

namespace haptic::device {
namespace {

// A tick of a millisecond is a whole number of steps, so that a host in step with it never sees between them. The first
// is the longest that resolves an encoder's count at 0.3 m/s.
constexpr std::array<std::int64_t, 8> kStepsNs = {50'000, 40'000, 31'250, 25'000, 20'000, 12'500, 10'000, 5'000};

std::int64_t choose_step_ns(const Variant& variant, const GripMechanics& mechanics) {
    validate(mechanics);
    const double longest_ns = longest_step_s(variant, mechanics) * 1e9;
    for (const std::int64_t step_ns : kStepsNs) {
        if (static_cast<double>(step_ns) <= longest_ns) {
            return step_ns;
        }
    }
    throw std::invalid_argument("grip mechanics: too stiff or too strongly damped for their masses: steps of " +
                                std::to_string(longest_ns / 1e3) +
                                " us would be needed, 5 us is the least; lower string_stiffness, string_damping, "
                                "hand_stiffness or hand_damping, or raise mass, inertia or motor_mass");
}

}  // namespace

MechanicalGrip::MechanicalGrip(const Variant& variant, const GripMechanics& mechanics, const Pose& start)
    : variant_(variant),
      mechanics_(mechanics),
      grid_(grip_at_rest(variant, start)),
      now_(grid_),
      target_(start),
      step_ns_(choose_step_ns(variant, mechanics)) {}

void MechanicalGrip::advance(std::int64_t now_ns, const Drive& drive, const HandMotion& hand) HAPTIC_RT {
    if (!started_) {
        started_ = true;
        grid_ns_ = now_ns;
    }
    if (const std::int64_t steps = (now_ns - grid_ns_) / step_ns_; steps > kMostSteps) {
        carry_over((steps - kMostSteps) * step_ns_, now_ns, drive, hand);
    }
    const double step_s = seconds(step_ns_);
    GripLoad load;
    load.pull = drive.pull;
    load.slack = drive.slack;
    load.held = drive.held;
    while (now_ns - grid_ns_ >= step_ns_) {
        grid_ns_ += step_ns_;
        const Pose next = hand.pose(now_ns - grid_ns_);
        load.hand = target_;
        load.hand_velocity = {(next.position - target_.position) * (1.0 / step_s),
                              small_turn_between(target_.orientation, next.orientation) * (1.0 / step_s)};
        grid_ = step(variant_, mechanics_, grid_, load, step_s);
        target_ = next;
    }
    extrapolate(seconds(std::max<std::int64_t>(now_ns - grid_ns_, 0)));
}

void MechanicalGrip::carry_over(std::int64_t gap_ns, std::int64_t now_ns, const Drive& drive,
                                const HandMotion& hand) HAPTIC_RT {
    grid_ns_ += gap_ns;
    if (mechanics_.hand == Hand::Free || drive.held) {
        return;
    }
    // The grip's place in the hand, its velocity and every string's stretch stay what they were.
    const Pose next = hand.pose(now_ns - grid_ns_);
    const Quat turn = next.orientation * glm::conjugate(target_.orientation);
    const GripState before = grip_at_rest(variant_, grid_.pose);
    grid_.pose.position = next.position + turn * (grid_.pose.position - target_.position);
    grid_.pose.orientation = turn * grid_.pose.orientation;
    const GripState after = grip_at_rest(variant_, grid_.pose);
    for (std::size_t i = 0; i < kStrings; ++i) {
        grid_.length[i] = std::max(0.0, grid_.length[i] + after.length[i] - before.length[i]);
    }
    target_ = next;
}

void MechanicalGrip::extrapolate(double time_s) HAPTIC_RT {
    now_ = grid_;
    if (time_s <= 0.0) {
        return;
    }
    const Twist twist = twist_of(mechanics_, grid_);
    now_.pose.position += twist.linear * time_s;
    now_.pose.orientation = turned(grid_.pose.orientation, twist.angular * time_s);
    for (std::size_t i = 0; i < kStrings; ++i) {
        now_.length[i] = std::max(0.0, grid_.length[i] + grid_.length_rate[i] * time_s);
    }
}

std::array<double, kStrings> MechanicalGrip::tensions(const std::array<double, kStrings>& slack) const HAPTIC_RT {
    return string_tensions(variant_, mechanics_, grid_, slack);
}

}  // namespace haptic::device
