#include "haptic/sim/live_settings.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace haptic::sim {
namespace {

double interpolated(double from, double to, double part) noexcept {
    return part < 1.0 ? from + part * (to - from) : to;
}

/// N/m, of the springs that produce the torque.
double torque_stiffness_of(const LiveSettings& settings) noexcept {
    return settings.torque_stiffness > 0.0 ? settings.torque_stiffness : settings.stiffness;
}

/// The LiveSetting of a member of both structs.
template <auto kMember, typename OfScene>
LiveSetting live_setting(const char* key, OfScene of_scene) {
    using T = std::remove_reference_t<decltype(LiveSettings{}.*kMember)>;
    return {.key = key,
            .get = [](const LiveSettings& s) { return static_cast<double>(s.*kMember); },
            .set =
                [](LiveSettings& s, double v) {
                    if constexpr (std::is_floating_point_v<T>) {
                        s.*kMember = v;
                    } else {
                        s.*kMember = static_cast<T>(std::lround(v));
                    }
                },
            .read =
                [of_scene](const Scene& scene, LiveSettings& s) {
                    if (const T* const value = of_scene(const_cast<Scene&>(scene))) {  // only read
                        s.*kMember = *value;
                    }
                },
            .write =
                [of_scene](const LiveSettings& s, Scene& scene) {
                    if (T* const value = of_scene(scene)) {
                        *value = s.*kMember;
                    }
                }};
}

/// The list with the range of each setting, from the reference of the scene's keys.
std::vector<LiveSetting> with_ranges(std::vector<LiveSetting> list) {
    const SettingReference& reference = scene_reference();
    for (LiveSetting& setting : list) {
        const SettingType type = find_setting(reference, setting.key).type;
        setting.range = type.range.value_or(Range{0.0, static_cast<double>(type.choices.size()) - 1.0});
    }
    return list;
}

}  // namespace

const std::vector<LiveSetting>& live_setting_list() {
    using S = LiveSettings;
    static const std::vector<LiveSetting> list = with_ranges({
        live_setting<&S::stiffness>("coupling.stiffness", [](Scene& s) { return &s.coupling.stiffness; }),
        live_setting<&S::torque_stiffness>("coupling.torque_stiffness",
                                           [](Scene& s) { return &s.coupling.torque_stiffness; }),
        live_setting<&S::radius>("proxy.radius", [](Scene& s) { return &s.proxy.radius; }),
        live_setting<&S::shrink>("proxy.shrink", [](Scene& s) { return &s.contact.shrink; }),
        live_setting<&S::static_friction>("proxy.static_friction", [](Scene& s) { return &s.contact.static_friction; }),
        live_setting<&S::dynamic_friction>("proxy.dynamic_friction",
                                           [](Scene& s) { return &s.contact.dynamic_friction; }),
        live_setting<&S::iterations>("solver.iterations", [](Scene& s) { return &s.solver.iterations; }),
        live_setting<&S::step>("solver.step", [](Scene& s) { return &s.solver.step; }),
        live_setting<&S::method>("contact.method", [](Scene& s) { return &s.contact.method; }),
        live_setting<&S::pop_out>("contact.pop_out", [](Scene& s) { return &s.contact.pop_out; }),
    });
    return list;
}

LiveSettings live_settings_of(const Scene& scene) {
    LiveSettings settings;
    for (const LiveSetting& setting : live_setting_list()) {
        setting.read(scene, settings);
    }
    return settings;
}

void apply(const LiveSettings& settings, Scene& scene) {
    for (const LiveSetting& setting : live_setting_list()) {
        setting.write(settings, scene);
    }
    scene.proxy.shrink = settings.shrink;
}

void check(const LiveSettings& settings) {
    for (const LiveSetting& setting : live_setting_list()) {
        const double value = setting.get(settings);
        Range range = setting.range;
        if (setting.key == "proxy.dynamic_friction") {
            range.max = settings.static_friction;
        }
        if (!(value >= range.min && value <= range.max)) {
            throw std::invalid_argument(std::string(setting.key) + " must be " + std::to_string(range.min) + " to " +
                                        std::to_string(range.max) + ", is " + std::to_string(value));
        }
    }
}

void SettingsFade::go_to(const LiveSettings& asked) noexcept {
    from_ = now_;
    asked_ = asked;
    age_s_ = 0.0;
}

const LiveSettings& SettingsFade::advance(double step_s) noexcept {
    age_s_ += step_s;
    const double part = age_s_ / kFade;
    // Iterations and methods apply at once. What makes a force is interpolated over kFade, and with it the step, which
    // bodies answer with another stiffness.
    LiveSettings next = asked_;
    next.step = interpolated(from_.step, asked_.step, part);
    next.stiffness = interpolated(from_.stiffness, asked_.stiffness, part);
    if (part < 1.0 && from_.torque_stiffness != asked_.torque_stiffness) {
        next.torque_stiffness = interpolated(torque_stiffness_of(from_), torque_stiffness_of(asked_), part);
    }
    next.shrink = interpolated(from_.shrink, asked_.shrink, part);
    next.static_friction = interpolated(from_.static_friction, asked_.static_friction, part);
    next.dynamic_friction = interpolated(from_.dynamic_friction, asked_.dynamic_friction, part);
    // The radius changes by a bounded factor per step.
    const double growth = 1.0 + std::min(kMaxGrowth, kRadiusRate * step_s);
    next.radius = std::clamp(asked_.radius, now_.radius / growth, now_.radius * growth);
    return now_ = next;
}

}  // namespace haptic::sim
