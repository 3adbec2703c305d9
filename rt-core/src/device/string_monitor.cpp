#include "device/string_monitor.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace haptic::rt {
namespace {

// Evidence is summed once the residual exceeds this share of the threshold.
constexpr double kWatchedFraction = 0.25;

// A string is a suspect too if the error unexplained without it exceeds that without the most likely string by at most
// this share of the error unexplained by all eight. Corresponds to 8 degrees between the effects of the two strings on
// the lengths.
constexpr double kEquallyGood = 0.02;

}  // namespace

StringMonitor::StringMonitor(const device::DeviceGeometry& geometry, const StringMonitorSettings& settings)
    : solver_(geometry), residual_(settings.residual), kept_(std::exp(-1.0 / settings.memory_ticks)) {
    // Thresholds and divisors: neither zero nor infinite.
    for (const double value : {settings.residual, settings.memory_ticks}) {
        if (!(value > 0.0) || !std::isfinite(value)) {
            throw std::invalid_argument("string monitor: settings must be positive and finite");
        }
    }
}

void StringMonitor::reset(const Pose& pose) HAPTIC_RT {
    for (PoseEstimate& estimate_without : without_) {
        estimate_without.pose = pose;
    }
    unexplained_ = StringArray{};
    unexplained_by_all_ = 0.0;
    suspicion_ = StringSuspicion{};
}

const StringSuspicion& StringMonitor::update(const StringArray& lengths, const PoseEstimate& estimate) HAPTIC_RT {
    // All lengths agree, or there is no pose to compare with: discard the evidence.
    if (estimate.status != PoseStatus::Ok || !(estimate.residual > kWatchedFraction * residual_)) {
        reset(estimate.pose);
        return suspicion_;
    }
    unexplained_by_all_ = kept_ * unexplained_by_all_ + estimate.residual * estimate.residual;
    // Solve the pose leaving out each string in turn; evidence decays exponentially.
    StringArray errors{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        // Start at the last pose found without string i: if i is the faulty one, it is near the true pose.
        PoseEstimate& estimate_without = without_[i];
        estimate_without = solver_.solve_without(i, lengths, estimate_without.pose);
        errors[i] = estimate_without.residuals[i];
        // Error that remains without string i. If the pose is not determined without it, leaving it out explains
        // nothing.
        const double error_without = estimate_without.status == PoseStatus::Ok
                                         ? estimate_without.residual * estimate_without.residual
                                         : estimate.residual * estimate.residual;
        unexplained_[i] = kept_ * unexplained_[i] + error_without;
    }
    // Name suspects only while the present residual is above the threshold.
    suspicion_ = StringSuspicion{};
    if (estimate.residual > residual_) {
        find_suspects(errors);
    }
    return suspicion_;
}

void StringMonitor::find_suspects(const std::array<double, kStrings>& errors) HAPTIC_RT {
    double min_unexplained = std::numeric_limits<double>::max();
    // The most likely string is the one whose removal leaves the least unexplained.
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (unexplained_[i] < min_unexplained) {
            min_unexplained = unexplained_[i];
            suspicion_.error = errors[i];
        }
    }
    // Every string that is about as good is a suspect too.
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (unexplained_[i] <= min_unexplained + kEquallyGood * unexplained_by_all_) {
            const auto bit = static_cast<std::uint8_t>(1U << i);
            suspicion_.strings = static_cast<std::uint8_t>(suspicion_.strings | bit);
            suspicion_.slack = static_cast<std::uint8_t>(suspicion_.slack | (errors[i] > 0.0 ? bit : 0U));
        }
    }
}

}  // namespace haptic::rt
