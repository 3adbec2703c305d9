#include "view/live_parameters.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "haptic/csv.hpp"

namespace haptic::sim::view {
namespace {

constexpr double kStiffer = 30.0;         // times what the scene begins with, and as many times softer
constexpr double kLarger = 4.0;           // likewise, of the radius
constexpr double kMostFriction = 2.0;     // or what the scene begins with
constexpr double kManyIterations = 30.0;  // or four times what the scene begins with
constexpr double kSlowestRate = 20.0;     // Hz
constexpr double kFastestRate = 2000.0;   // Hz
constexpr double kUsualStiffness = 20.0;  // N/m, of the thesis: for a scene that begins without

}  // namespace

/// A member of LiveSettings as a number: as a scene file has it, or the index of a choice.
struct LiveParameters::Parameter {
    std::string_view key;
    double (*get)(const LiveSettings&);
    void (*set)(LiveSettings&, double);
    bool is_rate = false;  // shown as one over it
    std::vector<std::string> choices = {};
};

const std::array<LiveParameters::Parameter, 11>& LiveParameters::all() {
    using S = LiveSettings;
    static const std::array<Parameter, 11> list{{
        {"coupling.stiffness", [](const S& s) { return s.stiffness; }, [](S& s, double v) { s.stiffness = v; }},
        {"coupling.torque_stiffness", [](const S& s) { return s.torque_stiffness; },
         [](S& s, double v) { s.torque_stiffness = v; }},
        {"proxy.radius", [](const S& s) { return s.radius; }, [](S& s, double v) { s.radius = v; }},
        {"proxy.shrink", [](const S& s) { return s.shrink; }, [](S& s, double v) { s.shrink = v; }},
        {"proxy.static_friction", [](const S& s) { return s.static_friction; },
         [](S& s, double v) {
             s.static_friction = v;
             s.dynamic_friction = std::min(s.dynamic_friction, v);
         }},
        {"proxy.dynamic_friction", [](const S& s) { return s.dynamic_friction; },
         [](S& s, double v) {
             s.dynamic_friction = v;
             s.static_friction = std::max(s.static_friction, v);
         }},
        {"solver.iterations", [](const S& s) { return static_cast<double>(s.iterations); },
         [](S& s, double v) { s.iterations = static_cast<int>(std::lround(v)); }},
        {"tool.iterations", [](const S& s) { return static_cast<double>(s.tool_iterations); },
         [](S& s, double v) { s.tool_iterations = static_cast<int>(std::lround(v)); }},
        {"solver.step", [](const S& s) { return s.step; }, [](S& s, double v) { s.step = v; }, true},
        {"contact.method",
         [](const S& s) { return s.method == CcdMethod::Thesis ? 1.0 : 0.0; },
         [](S& s, double v) { s.method = v > 0.5 ? CcdMethod::Thesis : CcdMethod::Complete; },
         false,
         {"complete", "thesis"}},
        {"contact.pop_out",
         [](const S& s) { return s.pop_out == PopOutMethod::Thesis ? 1.0 : 0.0; },
         [](S& s, double v) { s.pop_out = v > 0.5 ? PopOutMethod::Thesis : PopOutMethod::OrderFree; },
         false,
         {"order_free", "thesis"}},
    }};
    return list;
}

struct LiveParameters::Slider {
    const char* label = "";
    const char* unit = "";
    double least = 0.0;
    double most = 1.0;
    bool whole = false;
    bool logarithmic = false;
};

void LiveParameters::add(std::string_view key, const Slider& slider) {
    const Parameter& parameter =
        *std::find_if(all().begin(), all().end(), [&](const Parameter& p) { return p.key == key; });
    parameters_.push_back(&parameter);
    descriptions_.push_back({.key = std::string(key),
                             .label = slider.label,
                             .unit = slider.unit,
                             .least = slider.least,
                             .most = slider.most,
                             .whole = slider.whole,
                             .logarithmic = slider.logarithmic,
                             .choices = parameter.choices});
}

LiveParameters::LiveParameters(const Simulation& simulation, const LiveSettings& s) {
    const bool many = simulation.tool().particles().size() > 1;
    const double stiffness = s.stiffness > 0.0 ? s.stiffness : kUsualStiffness;
    add("coupling.stiffness", {.label = "Stiffness",
                               .unit = "N/m",
                               .least = std::max(ranges::kStiffness.least, stiffness / kStiffer),
                               .most = std::min(ranges::kStiffness.most, stiffness * kStiffer),
                               .logarithmic = true});
    if (many) {
        add("coupling.torque_stiffness",
            {.label = "Stiffness of the torque (0: the same)",
             .unit = "N/m",
             .most = std::min(ranges::kStiffness.most, std::max(stiffness, s.torque_stiffness) * kStiffer)});
    }
    if (!simulation.scene().tool && !many) {
        add("proxy.radius", {.label = "Radius",
                             .unit = "m",
                             .least = std::max(ranges::kRadius.least, s.radius / kLarger),
                             .most = std::min(ranges::kRadius.most, s.radius * kLarger),
                             .logarithmic = true});
    }
    add("proxy.shrink", {.label = "Shrink", .least = ranges::kShrink.least, .most = ranges::kShrink.most});
    add("proxy.static_friction", {.label = "Friction at rest", .most = std::max(kMostFriction, s.static_friction)});
    add("proxy.dynamic_friction", {.label = "Friction in motion", .most = std::max(kMostFriction, s.static_friction)});
    add("solver.iterations",
        {.label = "Iterations", .most = std::max(kManyIterations, 4.0 * s.iterations), .whole = true});
    if (many) {
        add("tool.iterations", {.label = "Iterations of the tool",
                                .most = std::max(kManyIterations, 4.0 * s.tool_iterations),
                                .whole = true});
    }
    add("solver.step", {.label = "Rate",
                        .unit = "Hz",
                        .least = std::min(kSlowestRate, 1.0 / s.step),
                        .most = std::max(kFastestRate, 1.0 / s.step),
                        .logarithmic = true});
    add("contact.method", {.label = "Contacts found by", .most = 1.0, .whole = true});
    add("contact.pop_out", {.label = "Pop-out", .most = 1.0, .whole = true});
    for (ParameterDescription& description : descriptions_) {
        if (description.key.ends_with("iterations")) {
            description.most = std::min(description.most, ranges::kIterations.most);
        }
    }
}

std::array<double, kMostParameters> LiveParameters::values(const LiveSettings& settings) const noexcept {
    std::array<double, kMostParameters> values{};
    for (std::size_t k = 0; k < parameters_.size(); ++k) {
        const double value = parameters_[k]->get(settings);
        values[k] = parameters_[k]->is_rate ? 1.0 / value : value;
    }
    return values;
}

LiveSettings LiveParameters::with(const LiveSettings& settings, std::size_t parameter, double value) const noexcept {
    LiveSettings next = settings;
    if (parameter < parameters_.size() && std::isfinite(value)) {
        const Parameter& which = *parameters_[parameter];
        const double within = std::clamp(value, descriptions_[parameter].least, descriptions_[parameter].most);
        which.set(next, which.is_rate ? 1.0 / within : within);
    }
    return next;
}

std::string LiveParameters::assignment(const LiveSettings& settings, std::size_t parameter) const {
    const Parameter& which = *parameters_[parameter];
    const double value = which.get(settings);
    return std::string(which.key) + "=" +
           (which.choices.empty() ? text_of(value) : which.choices[static_cast<std::size_t>(value)]);
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
    const std::size_t equals = assignment.find('=');
    const std::string_view key = std::string_view(assignment).substr(0, equals);
    const std::string_view text =
        equals == std::string::npos ? std::string_view{} : std::string_view(assignment).substr(equals + 1);
    const auto refuse = [&](const char* why) { throw std::invalid_argument("\"" + assignment + "\": " + why); };
    for (const LiveParameters::Parameter& which : LiveParameters::all()) {
        if (which.key != key) {
            continue;
        }
        double value = 0.0;
        if (which.choices.empty()) {
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            if (error != std::errc() || end != text.data() + text.size()) {
                refuse("is not a number");
            }
        } else {
            const auto choice = std::find(which.choices.begin(), which.choices.end(), text);
            if (choice == which.choices.end()) {
                refuse("is not one of the choices");
            }
            value = static_cast<double>(choice - which.choices.begin());
        }
        LiveSettings next = settings;
        which.set(next, value);
        check(next);
        return next;
    }
    refuse("is not a setting that changes while a scene runs");
    return settings;
}

}  // namespace haptic::sim::view
