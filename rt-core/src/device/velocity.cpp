#include "device/velocity.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "device/kinematics.hpp"

namespace haptic::rt {

Vec3 rotation_between(const Quat& from, const Quat& to) HAPTIC_RT {
    // Relative rotation (cos(angle / 2), axis * sin(angle / 2)).
    Quat rotation = to * glm::conjugate(from);
    if (rotation.w < 0.0) {
        rotation = -rotation;  // q and -q are the same rotation; take the angle below pi
    }
    const Vec3 axis(rotation.x, rotation.y, rotation.z);
    const double sine = glm::length(axis);
    // axis has length sin(angle / 2). angle / sine tends to 2 for small angles, where the quotient would be 0 / 0.
    const double scale = sine > 1e-9 ? 2.0 * std::atan2(sine, rotation.w) / sine : 2.0;
    return scale * axis;
}

PoseNoise quantisation_noise(const device::DeviceGeometry& geometry) {
    // Columns of the pseudo-inverse by finite differences: the pose that PoseSolver finds when one length is off by a
    // step. Linear for steps this small.
    constexpr double step = 1e-6;  // m
    PoseNoise noise;
    const StringArray rest = string_lengths(geometry, {});
    for (std::size_t i = 0; i < kStrings; ++i) {
        // Pose change of one string's step.
        PoseSolver solver(geometry);
        StringArray lengths = rest;
        lengths[i] += step;
        const PoseEstimate& estimate = solver.solve(lengths);
        if (estimate.status != PoseStatus::Ok) {
            return {};
        }
        // Rounding is at most half a count; the worst cases of all strings add up.
        const double half_counts = 0.5 * std::fabs(geometry.strings[i].metres_per_count) / step;
        noise.position += half_counts * glm::abs(estimate.pose.position);
        noise.rotation += half_counts * glm::abs(rotation_between({1.0, 0.0, 0.0, 0.0}, estimate.pose.orientation));
    }
    return noise;
}

AdaptiveVelocity::AdaptiveVelocity(const VelocitySettings& settings) : window_ticks_(settings.window_ticks) {
    // The window must fit the ring of past poses.
    if (settings.window_ticks < 1 || settings.window_ticks > kMaxTicks) {
        throw std::invalid_argument("velocity: the window must have 1 to 64 ticks");
    }
    // Noise band per coordinate: position, then rotation.
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

std::size_t AdaptiveVelocity::index_before(int ticks) const HAPTIC_RT {
    return (newest_ + kSize - static_cast<std::size_t>(ticks)) % kSize;
}

double AdaptiveVelocity::slope(std::size_t coordinate) const HAPTIC_RT {
    // Everything relative to the newest pose.
    const double now_s = times_s_[newest_];
    const double now = history_[newest_][coordinate];
    const double band = noise_[coordinate];
    // Interval of slopes of lines through the newest pose that miss no pose of the window by more than the band.
    double min_slope = -HUGE_VAL;
    double max_slope = HUGE_VAL;
    // Sums of the least-squares line, relative to the newest pose, which therefore adds zeros.
    double sum_t = 0.0;
    double sum_x = 0.0;
    double sum_tt = 0.0;
    double sum_tx = 0.0;
    double best = 0.0;
    // Grow the window backwards in time while the line through both its ends stays in the interval.
    for (int n = 1; n <= filled_; ++n) {
        // Slope of the line from the n-th pose before to the newest; it must pass all in between within their bands.
        const std::size_t index = index_before(n);
        const double t = times_s_[index] - now_s;  // negative
        const double x = history_[index][coordinate] - now;
        const double inverse = 1.0 / t;
        const double through = x * inverse;
        if (n > 1 && !(min_slope <= through && through <= max_slope)) {
            break;
        }
        // Narrow the interval to the slopes that pass this pose within its band.
        const double spread = -band * inverse;
        min_slope = std::max(min_slope, through - spread);
        max_slope = std::min(max_slope, through + spread);
        // Least-squares slope over n + 1 points.
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
    // Next sample: position, and rotation as the sum of rotation vectors, which does not wrap.
    const Vec3 rotation = rotation_between(last_.orientation, pose.orientation);
    Coordinates next = history_[newest_];
    for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = static_cast<Vec3::length_type>(k);
        next[k] = pose.position[axis];
        next[k + 3] += rotation[axis];
    }
    last_ = pose;
    // No time has passed: replace the newest sample.
    if (elapsed_ns <= 0) {
        history_[newest_] = next;
        return twist_;
    }
    // Append to the ring, and evaluate the slope of every coordinate.
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
