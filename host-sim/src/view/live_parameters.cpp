#include "view/live_parameters.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "haptic/csv.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim::view {
namespace {

constexpr double kStiffnessFactor = 30.0;   // a control reaches this many times the scene's value, and down to 1/30
constexpr double kRadiusFactor = 4.0;       // the same, of the radius
constexpr double kMaxFriction = 2.0;        // or the scene's value, if larger
constexpr double kMaxIterations = 30.0;     // or four times the scene's value, if larger
constexpr double kMinRate = 20.0;           // Hz
constexpr double kMaxRate = 2000.0;         // Hz
constexpr double kDefaultStiffness = 20.0;  // N/m, of the thesis: for a scene without a stiffness

const SettingDescription& description_of(std::string_view key) {
    return find_setting(scene_reference(), key);
}

const LiveSetting* find_live_setting(std::string_view key) {
    const std::vector<LiveSetting>& all = live_setting_list();
    const auto found = std::find_if(all.begin(), all.end(), [&](const LiveSetting& s) { return s.key == key; });
    return found == all.end() ? nullptr : &*found;
}

/// The step is shown as a rate, its inverse.
bool is_rate(const LiveSetting& setting) {
    return setting.key == "solver.step";
}

/// Sets a value and keeps dynamic friction at or below static friction.
void set_value(const LiveSetting& setting, double value, LiveSettings& settings) {
    setting.set(settings, value);
    if (setting.key == "proxy.static_friction") {
        settings.dynamic_friction = std::min(settings.dynamic_friction, settings.static_friction);
    } else if (setting.key == "proxy.dynamic_friction") {
        settings.static_friction = std::max(settings.static_friction, settings.dynamic_friction);
    }
}

}  // namespace

/// Range and scale of a control.
struct LiveParameters::Control {
    double min = 0.0;
    double max = 1.0;
    bool logarithmic = false;
};

void LiveParameters::add(std::string_view key, const Control& control) {
    const LiveSetting& setting = *find_live_setting(key);
    const SettingDescription& text = description_of(key);
    const bool whole = text.type.name == "integer" || text.type.name == "choice";
    Range allowed = setting.range;
    if (is_rate(setting)) {
        allowed = {1.0 / allowed.max, 1.0 / allowed.min};
    }
    parameters_.push_back(&setting);
    descriptions_.push_back({.key = std::string(key),
                             .label = text.label,
                             .unit = is_rate(setting) ? "Hz" : text.unit,
                             .min = std::max(control.min, allowed.min),
                             .max = text.type.choices.empty() ? std::min(control.max, allowed.max) : allowed.max,
                             .whole = whole,
                             .logarithmic = control.logarithmic,
                             .choices = text.type.choices,
                             .meaning = text.meaning});
}

LiveParameters::LiveParameters(const Simulation& simulation, const LiveSettings& settings) {
    const LiveSettings& s = settings;
    const bool several = simulation.tool().particles().size() > 1;
    const double stiffness = s.stiffness > 0.0 ? s.stiffness : kDefaultStiffness;
    add("coupling.stiffness",
        {.min = stiffness / kStiffnessFactor, .max = stiffness * kStiffnessFactor, .logarithmic = true});
    if (several) {
        add("coupling.torque_stiffness", {.max = std::max(stiffness, s.torque_stiffness) * kStiffnessFactor});
    }
    if (!simulation.scene().tool && !several) {
        add("proxy.radius", {.min = s.radius / kRadiusFactor, .max = s.radius * kRadiusFactor, .logarithmic = true});
    }
    add("proxy.shrink", {});
    add("proxy.static_friction", {.max = std::max(kMaxFriction, s.static_friction)});
    add("proxy.dynamic_friction", {.max = std::max(kMaxFriction, s.static_friction)});
    if (simulation.iterates()) {
        add("solver.iterations", {.max = std::max(kMaxIterations, 4.0 * s.iterations)});
    }
    add("solver.step",
        {.min = std::min(kMinRate, 1.0 / s.step), .max = std::max(kMaxRate, 1.0 / s.step), .logarithmic = true});
    add("contact.method", {});
    add("contact.pop_out", {});
}

std::array<double, kMaxParameters> LiveParameters::values(const LiveSettings& settings) const noexcept {
    std::array<double, kMaxParameters> values{};
    for (std::size_t k = 0; k < parameters_.size(); ++k) {
        const double value = parameters_[k]->get(settings);
        values[k] = is_rate(*parameters_[k]) ? 1.0 / value : value;
    }
    return values;
}

LiveSettings LiveParameters::with(const LiveSettings& settings, std::size_t parameter, double value) const {
    LiveSettings next = settings;
    if (parameter < parameters_.size() && std::isfinite(value)) {
        const LiveSetting& setting = *parameters_[parameter];
        const double within = std::clamp(value, descriptions_[parameter].min, descriptions_[parameter].max);
        set_value(setting, is_rate(setting) ? 1.0 / within : within, next);
    }
    return next;
}

std::string LiveParameters::assignment(const LiveSettings& settings, std::size_t parameter) const {
    const LiveSetting& setting = *parameters_[parameter];
    const std::vector<std::string>& choices = descriptions_[parameter].choices;
    const double value = setting.get(settings);
    return std::string(setting.key) + "=" +
           (choices.empty() ? text_of(value) : choices[static_cast<std::size_t>(value)]);
}

std::vector<std::string> LiveParameters::assignments(const LiveSettings& from, const LiveSettings& to) const {
    std::vector<std::string> all;
    for (std::size_t k = 0; k < parameters_.size(); ++k) {
        if (parameters_[k]->get(from) != parameters_[k]->get(to)) {
            all.push_back(assignment(to, k));
        }
    }
    return all;
}

LiveSettings assigned(const LiveSettings& settings, const std::string& assignment) {
    const auto refuse = [&](const char* why) { throw std::invalid_argument("\"" + assignment + "\": " + why); };
    const std::size_t equals = std::min(assignment.find('='), assignment.size());
    const std::string_view text = std::string_view(assignment).substr(std::min(equals + 1, assignment.size()));
    const LiveSetting* const setting = find_live_setting(std::string_view(assignment).substr(0, equals));
    if (setting == nullptr) {
        refuse("is not a setting that can change while a scene runs");
    }
    const std::vector<std::string>& choices = description_of(setting->key).type.choices;
    double value = 0.0;
    if (choices.empty()) {
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (error != std::errc() || end != text.data() + text.size()) {
            refuse("is not a number");
        }
    } else {
        const auto choice = std::find(choices.begin(), choices.end(), text);
        if (choice == choices.end()) {
            refuse("is not one of the choices");
        }
        value = static_cast<double>(choice - choices.begin());
    }
    LiveSettings next = settings;
    set_value(*setting, value, next);
    check(next);
    return next;
}

}  // namespace haptic::sim::view
