#include "device/velocity.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "device/kinematics.hpp"

namespace haptic::rt {

Vec3 rotation_between(const Quat& from, const Quat& to) HAPTIC_RT {
    Quat turn = to * glm::conjugate(from);
    if (turn.w < 0.0) {
        turn = -turn;  // the same rotation, the shorter way
    }
    const Vec3 axis(turn.x, turn.y, turn.z);
    const double sine = glm::length(axis);
    // angle / sine tends to 2 as the angle vanishes; there the quotient itself would be 0 / 0.
    const double scale = sine > 1e-9 ? 2.0 * std::atan2(sine, turn.w) / sine : 2.0;
    return scale * axis;
}

PoseNoise quantisation_noise(const device::Variant& variant) {
    // Each length off by e moves the pose to the one that explains the lengths best: PoseSolver itself, one string at a
    // time, and linear for steps this small.
    constexpr double step = 1e-6;  // m
    PoseNoise noise;
    const StringArray rest = string_lengths(variant, {});
    for (std::size_t i = 0; i < kStrings; ++i) {
        PoseSolver solver(variant);
        StringArray lengths = rest;
        lengths[i] += step;
        const PoseEstimate& estimate = solver.solve(lengths);
        if (estimate.status != PoseStatus::Ok) {
            return {};
        }
        const double half_counts = 0.5 * std::fabs(variant.strings[i].metres_per_count) / step;
        noise.position += half_counts * glm::abs(estimate.pose.position);
        noise.rotation += half_counts * glm::abs(rotation_between({1.0, 0.0, 0.0, 0.0}, estimate.pose.orientation));
    }
    return noise;
}

AdaptiveVelocity::AdaptiveVelocity(const VelocitySettings& settings) : window_ticks_(settings.window_ticks) {
    if (settings.window_ticks < 1 || settings.window_ticks > kMostTicks) {
        throw std::invalid_argument("velocity: the window must have 1 to 64 ticks");
    }
    for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = static_cast<Vec3::length_type>(k);
        noise_[k] = settings.noise.position[axis];
        noise_[k + 3] = settings.noise.rotation[axis];
    }
    for (const double band : noise_) {
        if (!(band >= 0.0) || !std::isfinite(band)) {
            throw std::invalid_argument("velocity: the noise must be finite and not negative");
        }
    }
}

std::size_t AdaptiveVelocity::back(int ticks) const HAPTIC_RT {
    return (newest_ + kSize - static_cast<std::size_t>(ticks)) % kSize;
}

double AdaptiveVelocity::slope(std::size_t coordinate) const HAPTIC_RT {
    const double now_s = times_s_[newest_];
    const double now = history_[newest_][coordinate];
    const double band = noise_[coordinate];
    // Slopes of lines through the newest pose that miss none so far by more than the band; and the sums of the best
    // line, about the newest pose, which counts with zeros.
    double least = -HUGE_VAL;
    double largest = HUGE_VAL;
    double sum_t = 0.0;
    double sum_x = 0.0;
    double sum_tt = 0.0;
    double sum_tx = 0.0;
    double best = 0.0;
    for (int n = 1; n <= filled_; ++n) {
        const std::size_t index = back(n);
        const double t = times_s_[index] - now_s;  // negative
        const double x = history_[index][coordinate] - now;
        const double inverse = 1.0 / t;
        const double through = x * inverse;
        if (n > 1 && !(least <= through && through <= largest)) {
            break;
        }
        const double spread = -band * inverse;
        least = std::max(least, through - spread);
        largest = std::min(largest, through + spread);
        sum_t += t;
        sum_x += x;
        sum_tt += t * t;
        sum_tx += t * x;
        const double count = n + 1;
        best = (count * sum_tx - sum_t * sum_x) / (count * sum_tt - sum_t * sum_t);
    }
    return best;
}

const Twist& AdaptiveVelocity::update(const Pose& pose, std::int64_t elapsed_ns) HAPTIC_RT {
    const Vec3 turned = rotation_between(last_.orientation, pose.orientation);
    Coordinates next = history_[newest_];
    for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = static_cast<Vec3::length_type>(k);
        next[k] = pose.position[axis];
        next[k + 3] += turned[axis];
    }
    last_ = pose;
    if (elapsed_ns <= 0) {
        history_[newest_] = next;
        return twist_;
    }
    const double time_s = times_s_[newest_] + seconds(elapsed_ns);
    newest_ = (newest_ + 1) % kSize;
    history_[newest_] = next;
    times_s_[newest_] = time_s;
    filled_ = std::min(filled_ + 1, window_ticks_);
    twist_.linear = {slope(0), slope(1), slope(2)};
    twist_.angular = {slope(3), slope(4), slope(5)};
    return twist_;
}

void AdaptiveVelocity::reset(const Pose& pose) HAPTIC_RT {
    last_ = pose;
    twist_ = Twist{};
    newest_ = 0;
    filled_ = 0;
    times_s_[0] = 0.0;
    history_[0] = {pose.position.x, pose.position.y, pose.position.z, 0.0, 0.0, 0.0};
}

}  // namespace haptic::rt
