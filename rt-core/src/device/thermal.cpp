#include "device/thermal.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "haptic/numeric.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

// Share of the continuous rating that is allowed at load 1. Below 1, so that the load settles before it reaches 1.
constexpr double kFractionAtFullLoad = 0.9;

void require_rating(bool condition, const char* problem) {
    if (!condition) {
        throw std::invalid_argument(std::string("thermal model: ") + problem);
    }
}

}  // namespace

ThermalModel::ThermalModel(const ThermalSettings& settings) : settings_(settings) {
    require_rating(settings.derate_from >= 0.0 && settings.derate_from < 1.0,
                   "the load at which derating begins must be in 0..1");
    for (const MotorRating& motor : settings.motors) {
        require_rating(motor.time_constant_s > 0.0, "a motor's thermal time constant must be positive");
        // (1 / 1.2)^2 = 0.7: the minimum tension alone must not reach the default derate_from.
        require_rating(motor.continuous > 1.2 * settings.minimum,
                       "a motor's continuous tension must be above 1.2 times the minimum tension");
    }
}

void ThermalModel::update(const StringArray& tensions, std::int64_t elapsed_ns) HAPTIC_RT {
    const double dt = std::max(0.0, seconds(elapsed_ns));
    for (std::size_t i = 0; i < kStrings; ++i) {
        const MotorRating& motor = settings_.motors[i];
        const double relative_tension = tensions[i] / motor.continuous;
        // Exact solution of the first-order model at constant tension; `steady_load` is its steady state.
        const double steady_load = relative_tension * relative_tension;
        loads_[i] = steady_load + (loads_[i] - steady_load) * std::exp(-dt / motor.time_constant_s);
    }
}

StringArray ThermalModel::bounds() const HAPTIC_RT {
    // The bound falls smoothly from the maximum at load derate_from to the sustainable tension at load 1.
    StringArray bounds{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double full_load_bound =
            std::clamp(kFractionAtFullLoad * settings_.motors[i].continuous, settings_.minimum, settings_.maximum);
        const double derating = smooth_step((loads_[i] - settings_.derate_from) / (1.0 - settings_.derate_from));
        bounds[i] = settings_.maximum + (full_load_bound - settings_.maximum) * derating;
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
