#include "emulated/mechanical_grip.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

namespace haptic::device {
namespace {

// Divisors of 1 ms, so that a host with a period of 1 ms always samples at a grid point. The longest one resolves a
// single encoder count at 0.3 m/s.
constexpr std::array<std::int64_t, 8> kStepsNs = {50'000, 40'000, 31'250, 25'000, 20'000, 12'500, 10'000, 5'000};

std::int64_t choose_step_ns(const DeviceGeometry& geometry, const GripMechanics& mechanics) {
    validate(mechanics);
    // Longest step of the grid that keeps the integration stable.
    const double longest_ns = longest_step_s(geometry, mechanics) * 1e9;
    for (const std::int64_t step_ns : kStepsNs) {
        if (static_cast<double>(step_ns) <= longest_ns) {
            return step_ns;
        }
    }
    // Not even the shortest step is stable: refuse, because an unstable emulation would mislead.
    throw std::invalid_argument(
        "grip mechanics: too stiff or too strongly damped for the masses: they require steps of " +
        std::to_string(longest_ns / 1e3) +
        " us, the minimum is 5 us; lower string_stiffness, string_damping, hand_stiffness or "
        "hand_damping, or raise mass, inertia or motor_mass");
}

}  // namespace

MechanicalGrip::MechanicalGrip(const DeviceGeometry& geometry, const GripMechanics& mechanics, const Pose& start)
    : geometry_(geometry),
      mechanics_(mechanics),
      grid_(grip_at_rest(geometry, start)),
      now_(grid_),
      target_(start),
      step_ns_(choose_step_ns(geometry, mechanics)) {}

void MechanicalGrip::advance(std::int64_t now_ns, const Drive& drive, const HandMotion& hand) HAPTIC_RT {
    // The grid of steps starts at the first call.
    if (!started_) {
        started_ = true;
        grid_ns_ = now_ns;
    }
    // Bound the work: skip the part of the interval that exceeds kMaxSteps.
    if (const std::int64_t steps = (now_ns - grid_ns_) / step_ns_; steps > kMaxSteps) {
        carry_over((steps - kMaxSteps) * step_ns_, now_ns, drive, hand);
    }
    // Motors and slack are constant over the interval; only the hand moves.
    const double step_s = seconds(step_ns_);
    GripLoad load;
    load.pull = drive.pull;
    load.slack = drive.slack;
    load.held = drive.held;
    while (now_ns - grid_ns_ >= step_ns_) {
        // Hand pose at the start of the step, hand velocity as its finite difference over the step.
        grid_ns_ += step_ns_;
        const Pose next = hand.pose(now_ns - grid_ns_);
        load.hand = target_;
        load.hand_velocity = {(next.position - target_.position) * (1.0 / step_s),
                              small_rotation_between(target_.orientation, next.orientation) * (1.0 / step_s)};
        // One step; the end of the hand's path is the start of the next.
        grid_ = step(geometry_, mechanics_, grid_, load, step_s);
        target_ = next;
    }
    // State at now_ns, between grid points.
    extrapolate(seconds(std::max<std::int64_t>(now_ns - grid_ns_, 0)));
}

void MechanicalGrip::pay_out(std::size_t string, double metres) HAPTIC_RT {
    for (GripState* const state : {&grid_, &now_}) {
        state->length[string] = std::max(0.0, state->length[string] + metres);
    }
}

void MechanicalGrip::carry_over(std::int64_t gap_ns, std::int64_t now_ns, const Drive& drive,
                                const HandMotion& hand) HAPTIC_RT {
    // Without a hand that carries it, the grip stays.
    grid_ns_ += gap_ns;
    if (mechanics_.hand == Hand::Free || drive.held) {
        return;
    }
    // Rigid motion of the hand over the gap. The grip's pose relative to the hand, its velocity and the stretch of
    // every string are kept.
    const Pose next = hand.pose(now_ns - grid_ns_);
    const Quat rotation = next.orientation * glm::conjugate(target_.orientation);
    const GripState before = grip_at_rest(geometry_, grid_.pose);
    // Move the grip with the hand: p' = h' + R (p - h).
    grid_.pose.position = next.position + rotation * (grid_.pose.position - target_.position);
    grid_.pose.orientation = rotation * grid_.pose.orientation;
    // Geometric change of every string's length, added to the length at the motor.
    const GripState after = grip_at_rest(geometry_, grid_.pose);
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
    // First order, from the last grid point; the grid itself is not touched.
    const Twist twist = twist_of(mechanics_, grid_);
    now_.pose.position += twist.linear * time_s;
    now_.pose.orientation = rotated(grid_.pose.orientation, twist.angular * time_s);
    for (std::size_t i = 0; i < kStrings; ++i) {
        now_.length[i] = std::max(0.0, grid_.length[i] + grid_.length_rate[i] * time_s);
    }
}

std::array<double, kStrings> MechanicalGrip::tensions(const std::array<double, kStrings>& slack) const HAPTIC_RT {
    return string_tensions(geometry_, mechanics_, grid_, slack);
}

}  // namespace haptic::device
