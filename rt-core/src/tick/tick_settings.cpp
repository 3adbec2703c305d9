#include "tick/tick_settings.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

namespace haptic::rt {
namespace {

void require(bool condition, const char* problem) {
    if (!condition) {
        throw std::invalid_argument(std::string("tick settings: ") + problem);
    }
}

}  // namespace

TickSettings checked(const TickSettings& settings) {
    // Loop and device.
    const device::DeviceGeometry& geometry = settings.geometry;
    require(settings.period_ns > 0, "period_ns must be positive");
    require(settings.exchanges == 1 || settings.exchanges == 2, "exchanges must be 1 or 2");
    require(geometry.minimum_tension >= 0.0 && geometry.maximum_tension > geometry.minimum_tension,
            "the device's tensions must satisfy 0 <= minimum < maximum");
    require(settings.maximum_string_speed > 0.0, "maximum_string_speed must be positive");
    // Ramps, limits and stiffnesses.
    require(settings.frames.stale_after_ns > 0 && settings.frames.fade_ns > 0 && settings.frames.ramp_ns > 0,
            "stale_after, fade and ramp times of frames must be positive");
    require(settings.safety.tension_ramp_ns > 0 && settings.safety.fault_fade_ns > 0 &&
                settings.safety.calibration_hold_ns >= 0,
            "times of the safety machine must be positive; the calibration hold may be zero");
    require(settings.limits.force >= 0.0 && settings.limits.torque >= 0.0 && settings.limits.force_rate > 0.0 &&
                settings.limits.torque_rate > 0.0,
            "wrench limits must not be negative, and their rates must be positive");
    const OverlaySettings& overlay = settings.overlay;
    require(overlay.max_force >= 0.0 && overlay.max_torque >= 0.0 && overlay.timeout_ns > 0 && overlay.ramp_ns > 0,
            "the limits of the overlay must not be negative, and its times must be positive");
    require(settings.tension_rate > 0.0, "tension_rate must be positive");
    require(settings.frames.max_stiffness >= 0.0 && settings.frames.max_rotational_stiffness >= 0.0,
            "the maximum stiffness must not be negative");
    // Passivity controller.
    const PassivitySettings& passivity = settings.passivity;
    require(passivity.allowance >= 0.0 && passivity.store >= 0.0 && passivity.surface_power >= 0.0 &&
                passivity.damping >= 0.0 && passivity.rotational_damping >= 0.0 && passivity.max_damping >= 0.0 &&
                passivity.max_rotational_damping >= 0.0 && passivity.brake >= 0.0 &&
                passivity.rotational_brake >= 0.0 && passivity.damping_credit >= 0.0,
            "energies, powers and dampings of the passivity controller must not be negative");
    require(passivity.recovery_s >= 0.0 && passivity.forget_s > 0.0 && passivity.mass > 0.0 && passivity.inertia > 0.0,
            "mass, inertia and forget time of the passivity controller must be positive, and its recovery time not "
            "negative");
    // Budget and walls.
    const WorkspaceWalls& walls = settings.walls;
    require(settings.budget.second >= 0.0 && settings.budget.session >= 0.0 && settings.budget.duration >= 0.0,
            "the limits of the budget must not be negative");
    require(!walls.on || (walls.semi_axes.x > 0.0 && walls.semi_axes.y > 0.0 && walls.semi_axes.z > 0.0 &&
                          walls.thickness > 0.0 && walls.angle > 0.0 && walls.angular_thickness > 0.0),
            "the region and the thickness of the workspace's walls must be positive");
    require(settings.black_box_ns >= settings.period_ns, "black_box_ns must hold at least one tick");
    return settings;
}

TensionSettings tension_settings(const TickSettings& settings) {
    // Radius of the grip: distance of the farthest knot.
    double radius = 0.0;
    for (const device::StringFacts& string : settings.geometry.strings) {
        radius = std::max(radius, glm::length(string.grip));
    }
    // Bounds of the tensions, weights of the quadratic programme, and the rate limit per tick.
    TensionSettings result;
    result.minimum = settings.geometry.minimum_tension;
    result.maximum = settings.geometry.maximum_tension;
    result.torque_scale = radius > 0.0 ? 1.0 / radius : 1.0;
    result.effort = settings.tension_effort;
    result.continuity = settings.tension_continuity;
    result.infeasible = settings.tension_infeasible;
    result.slew = settings.tension_rate * seconds(settings.period_ns);
    return result;
}

ThermalSettings thermal_settings(const TickSettings& settings) {
    ThermalSettings result;
    result.minimum = settings.geometry.minimum_tension;
    result.maximum = settings.geometry.maximum_tension;
    result.derate_from = settings.motors.derate_from;
    for (std::size_t i = 0; i < kStrings; ++i) {
        // Ratings from the device file, else the defaults of the motor settings.
        const device::StringFacts& string = settings.geometry.strings[i];
        result.motors[i].continuous = string.continuous_tension > 0.0
                                          ? string.continuous_tension
                                          : settings.motors.continuous_share * result.maximum;
        result.motors[i].time_constant_s =
            string.thermal_time_constant_s > 0.0 ? string.thermal_time_constant_s : settings.motors.time_constant_s;
    }
    return result;
}

}  // namespace haptic::rt
