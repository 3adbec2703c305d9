#include "device/string_monitor.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace haptic::rt {
namespace {

// Evidence is gathered from this share of the threshold on.
constexpr double kWatchedShare = 0.25;

// Of what the eight leave unexplained: the others agree without a string as well as without the best one, if they leave
// no more than so much in addition. An angle of 8 degrees between what two strings do to the lengths.
constexpr double kAsGood = 0.02;

constexpr double kNever = std::numeric_limits<double>::max();

}  // namespace

StringMonitor::StringMonitor(const device::Variant& variant, const StringMonitorSettings& settings)
    : solver_(variant), residual_(settings.residual), kept_(std::exp(-1.0 / settings.memory_ticks)) {
    for (const double value : {settings.residual, settings.memory_ticks}) {
        if (!(value > 0.0) || !std::isfinite(value)) {
            throw std::invalid_argument("string monitor: settings must be positive and finite");
        }
    }
}

void StringMonitor::reset(const Pose& pose) HAPTIC_RT {
    for (PoseEstimate& one : without_) {
        one.pose = pose;
    }
    unexplained_ = StringArray{};
    left_ = 0.0;
    suspicion_ = StringSuspicion{};
}

const StringSuspicion& StringMonitor::update(const StringArray& lengths, const PoseEstimate& estimate) HAPTIC_RT {
    if (estimate.status != PoseStatus::Ok || !(estimate.residual > kWatchedShare * residual_)) {
        reset(estimate.pose);
        return suspicion_;
    }
    left_ = kept_ * left_ + estimate.residual * estimate.residual;
    StringArray errors{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        PoseEstimate& one = without_[i];
        one = solver_.solve_without(i, lengths, one.pose);
        errors[i] = one.residuals[i];
        const double left =
            one.status == PoseStatus::Ok ? one.residual * one.residual : estimate.residual * estimate.residual;
        unexplained_[i] = kept_ * unexplained_[i] + left;
    }
    suspicion_ = StringSuspicion{};
    if (estimate.residual > residual_) {
        judge(errors);
    }
    return suspicion_;
}

void StringMonitor::judge(const std::array<double, kStrings>& errors) HAPTIC_RT {
    double least = kNever;
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (unexplained_[i] < least) {
            least = unexplained_[i];
            suspicion_.error = errors[i];
        }
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (unexplained_[i] <= least + kAsGood * left_) {
            const auto bit = static_cast<std::uint8_t>(1U << i);
            suspicion_.strings = static_cast<std::uint8_t>(suspicion_.strings | bit);
            suspicion_.slack = static_cast<std::uint8_t>(suspicion_.slack | (errors[i] > 0.0 ? bit : 0U));
        }
    }
}

}  // namespace haptic::rt
