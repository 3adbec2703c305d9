#include <haptic/sim/live_settings.hpp>

#include <algorithm>
#include <stdexcept>
#include <string>

namespace haptic::sim {
namespace {

void require(const char* what, double value, const Range& range) {
    if (!(value >= range.least && value <= range.most)) {
        throw std::invalid_argument(std::string(what) + " must be " + std::to_string(range.least) + " to " +
                                    std::to_string(range.most) + ", is " + std::to_string(value));
    }
}

double between(double from, double to, double part) noexcept {
    return part < 1.0 ? from + part * (to - from) : to;
}

/// N/m, of the springs that make the torque.
double torque_stiffness_of(const LiveSettings& settings) noexcept {
    return settings.torque_stiffness > 0.0 ? settings.torque_stiffness : settings.stiffness;
}

}  // namespace

LiveSettings live_settings_of(const Scene& scene) {
    return {.stiffness = scene.coupling.stiffness,
            .torque_stiffness = scene.coupling.torque_stiffness,
            .radius = scene.proxy.radius,
            .shrink = scene.contact.shrink,
            .iterations = scene.solver.iterations,
            .tool_iterations = scene.tool ? scene.tool->iterations : 0,
            .step = scene.solver.step,
            .method = scene.contact.method,
            .pop_out = scene.contact.pop_out,
            .static_friction = scene.contact.static_friction,
            .dynamic_friction = scene.contact.dynamic_friction};
}

void apply(const LiveSettings& settings, Scene& scene) {
    scene.coupling.stiffness = settings.stiffness;
    scene.coupling.torque_stiffness = settings.torque_stiffness;
    scene.proxy.radius = settings.radius;
    scene.proxy.shrink = settings.shrink;
    scene.contact.shrink = settings.shrink;
    scene.solver.iterations = settings.iterations;
    if (scene.tool) {
        scene.tool->iterations = settings.tool_iterations;
    }
    scene.solver.step = settings.step;
    scene.contact.method = settings.method;
    scene.contact.pop_out = settings.pop_out;
    scene.contact.static_friction = settings.static_friction;
    scene.contact.dynamic_friction = settings.dynamic_friction;
}

void check(const LiveSettings& settings) {
    require("coupling.stiffness", settings.stiffness, ranges::kStiffness);
    require("coupling.torque_stiffness", settings.torque_stiffness, ranges::kStiffness);
    require("proxy.radius", settings.radius, ranges::kRadius);
    require("proxy.shrink", settings.shrink, ranges::kShrink);
    require("solver.iterations", settings.iterations, ranges::kIterations);
    require("tool.iterations", settings.tool_iterations, ranges::kIterations);
    require("solver.step", settings.step, ranges::kStep);
    require("proxy.static_friction", settings.static_friction, ranges::kFriction);
    require("proxy.dynamic_friction", settings.dynamic_friction, {0.0, settings.static_friction});
}

void SettingsFade::go_to(const LiveSettings& asked) noexcept {
    from_ = now_;
    asked_ = asked;
    age_s_ = 0.0;
}

const LiveSettings& SettingsFade::advance(double step_s) noexcept {
    age_s_ += step_s;
    const double part = age_s_ / kFade;
    LiveSettings next = asked_;
    next.stiffness = between(from_.stiffness, asked_.stiffness, part);
    if (part < 1.0 && from_.torque_stiffness != asked_.torque_stiffness) {
        next.torque_stiffness = between(torque_stiffness_of(from_), torque_stiffness_of(asked_), part);
    }
    next.shrink = between(from_.shrink, asked_.shrink, part);
    next.static_friction = between(from_.static_friction, asked_.static_friction, part);
    next.dynamic_friction = between(from_.dynamic_friction, asked_.dynamic_friction, part);
    const double growth = 1.0 + std::min(kMostGrowth, kRadiusRate * step_s);
    next.radius = std::clamp(asked_.radius, now_.radius / growth, now_.radius * growth);
    return now_ = next;
}

}  // namespace haptic::sim
