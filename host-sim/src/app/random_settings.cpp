#include "app/random_settings.hpp"

#include <algorithm>
#include <cmath>

#include "haptic/config.hpp"

namespace haptic::sim {
namespace {

constexpr double kMaxWaitS = 0.2;                    // between two changes
constexpr std::uint64_t kSettingsSeed = 0x73657474;  // derives another sequence from a seed than a hostile hand

}  // namespace

RandomSettings::RandomSettings(std::uint64_t seed, const Simulation& simulation, const LiveSettings& own,
                               std::span<const std::string> given)
    : random_(seed ^ kSettingsSeed), parameters_(simulation, own) {
    for (std::size_t k = 0; k < parameters_.descriptions().size(); ++k) {
        const view::ParameterDescription& of = parameters_.descriptions()[k];
        const bool is_given = std::ranges::find(given, of.key, assigned_key) != given.end();
        if (of.choices.empty() && !is_given) {
            numbers_.push_back(k);
        }
    }
}

std::optional<view::SetParameter> RandomSettings::advance(double dt) {
    left_s_ -= dt;
    if (left_s_ > 0.0 || numbers_.empty()) {
        return std::nullopt;
    }
    left_s_ = kMaxWaitS * random_.next();
    const std::size_t which = numbers_[static_cast<std::size_t>(random_.next() * static_cast<double>(numbers_.size()))];
    // Anywhere in the range of its control, as that is divided.
    const view::ParameterDescription& control = parameters_.descriptions()[which];
    const double part = random_.next();
    return view::SetParameter{which, control.logarithmic ? control.min * std::pow(control.max / control.min, part)
                                                         : control.min + part * (control.max - control.min)};
}

}  // namespace haptic::sim
