#include "device/thermal.hpp"

#include <algorithm>
#include <cmath>

#include <haptic/rt/smooth.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {
namespace {

// Share of the continuous tension that is left at load 1: below 1, so that the load settles before it gets there.
constexpr double kLeftAtFullLoad = 0.9;

}  // namespace

void ThermalModel::update(const StringArray& tensions, std::int64_t elapsed_ns) HAPTIC_RT {
    const double dt = std::max(0.0, seconds(elapsed_ns));
    for (std::size_t i = 0; i < kStrings; ++i) {
        const MotorRating& motor = settings_.motors[i];
        const double share = tensions[i] / motor.continuous;
        const double settled = share * share;
        loads_[i] = settled + (loads_[i] - settled) * std::exp(-dt / motor.time_constant_s);
    }
}

StringArray ThermalModel::bounds() const HAPTIC_RT {
    StringArray bounds{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double least =
            std::clamp(kLeftAtFullLoad * settings_.motors[i].continuous, settings_.minimum, settings_.maximum);
        const double taken = smooth_step((loads_[i] - settings_.derate_from) / (1.0 - settings_.derate_from));
        bounds[i] = settings_.maximum + (least - settings_.maximum) * taken;
    }
    return bounds;
}

bool ThermalModel::derated() const HAPTIC_RT {
    return std::any_of(loads_.begin(), loads_.end(),
                       [this](double load) HAPTIC_RT { return load > settings_.derate_from; });
}

bool ThermalModel::overheated() const HAPTIC_RT {
    return std::any_of(loads_.begin(), loads_.end(), [](double load) HAPTIC_RT { return !(load < 1.0); });
}

}  // namespace haptic::rt
