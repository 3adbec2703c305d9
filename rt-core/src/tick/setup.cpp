// What allocates and may throw: constructors, kept apart from the objects of the tick so that the symbols these refer
// to can be checked.
#include <algorithm>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "tick/recorder.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {
namespace {

void require(bool condition, const char* problem) {
    if (!condition) {
        throw std::invalid_argument(std::string("tick settings: ") + problem);
    }
}

TickSettings checked(const TickSettings& settings) {
    const device::Variant& variant = settings.variant;
    require(settings.period_ns > 0, "period_ns must be positive");
    require(settings.exchanges == 1 || settings.exchanges == 2, "exchanges must be 1 or 2");
    require(variant.minimum_tension >= 0.0 && variant.maximum_tension > variant.minimum_tension,
            "the variant's tensions must obey 0 <= minimum < maximum");
    require(settings.maximum_string_speed > 0.0, "maximum_string_speed must be positive");
    require(settings.frames.stale_after_ns > 0 && settings.frames.fade_ns > 0 && settings.frames.ramp_ns > 0,
            "times of frames must be positive");
    require(settings.safety.tension_ramp_ns > 0 && settings.safety.fault_fade_ns > 0 &&
                settings.safety.calibration_hold_ns >= 0,
            "times of the safety machine must be positive");
    require(settings.limits.force >= 0.0 && settings.limits.torque >= 0.0 && settings.limits.force_rate > 0.0 &&
                settings.limits.torque_rate > 0.0,
            "limits of the wrench must not be negative, and those of its rate must be positive");
    require(settings.tension_rate > 0.0, "tension_rate must be positive");
    require(settings.frames.largest_stiffness >= 0.0 && settings.frames.largest_rotational_stiffness >= 0.0,
            "the largest stiffness must not be negative");
    const PassivitySettings& passivity = settings.passivity;
    require(passivity.allowance >= 0.0 && passivity.store >= 0.0 && passivity.surface_power >= 0.0 &&
                passivity.damping >= 0.0 && passivity.rotational_damping >= 0.0 && passivity.largest_damping >= 0.0 &&
                passivity.largest_rotational_damping >= 0.0 && passivity.brake >= 0.0 &&
                passivity.rotational_brake >= 0.0 && passivity.damping_credit >= 0.0,
            "energies, powers and dampings of the passivity controller must not be negative");
    require(passivity.recovery_s >= 0.0 && passivity.forget_s > 0.0 && passivity.mass > 0.0 && passivity.inertia > 0.0,
            "times, mass and inertia of the passivity controller must be positive");
    require(settings.black_box_ns >= settings.period_ns, "black_box_ns must hold at least one tick");
    return settings;
}

TensionSettings tension_settings(const TickSettings& settings) {
    double radius = 0.0;
    for (const device::StringFacts& string : settings.variant.strings) {
        radius = std::max(radius, glm::length(string.grip));
    }
    TensionSettings result;
    result.minimum = settings.variant.minimum_tension;
    result.maximum = settings.variant.maximum_tension;
    result.torque_scale = radius > 0.0 ? 1.0 / radius : 1.0;
    result.effort = settings.tension_effort;
    result.continuity = settings.tension_continuity;
    result.infeasible = settings.tension_infeasible;
    result.slew = settings.tension_rate * seconds(settings.period_ns);
    return result;
}

ThermalSettings thermal_settings(const TickSettings& settings) {
    ThermalSettings result;
    result.minimum = settings.variant.minimum_tension;
    result.maximum = settings.variant.maximum_tension;
    result.derate_from = settings.motors.derate_from;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const device::StringFacts& string = settings.variant.strings[i];
        result.motors[i].continuous = string.continuous_tension > 0.0
                                          ? string.continuous_tension
                                          : settings.motors.continuous_share * result.maximum;
        result.motors[i].time_constant_s =
            string.thermal_time_constant_s > 0.0 ? string.thermal_time_constant_s : settings.motors.time_constant_s;
    }
    return result;
}

}  // namespace

ThermalModel::ThermalModel(const ThermalSettings& settings) : settings_(settings) {
    require(settings.derate_from >= 0.0 && settings.derate_from < 1.0, "motors are spared from a load of 0..1 on");
    for (const MotorRating& motor : settings.motors) {
        require(motor.time_constant_s > 0.0, "a motor's thermal time constant must be positive");
        // Load 0.7 at most, so that the minimum tension alone spares no motor.
        require(motor.continuous > 1.2 * settings.minimum,
                "a motor must bear more than 1.2 times the minimum tension for ever");
    }
}

BlackBox::BlackBox(std::size_t capacity) : records_(std::max<std::size_t>(capacity, 1)) {}

Recorder::Recorder(std::size_t tick_capacity, std::size_t frame_capacity)
    : ticks_(tick_capacity), frames_(frame_capacity) {}

Tick::Tick(const TickSettings& settings, device::Board& board, RingReader<ContactFrame>& frames,
           RingWriter<DeviceState>& states, StageClock clock)
    : Tick(settings, board, std::make_unique<RingFrames>(frames), nullptr, states, clock) {}

Tick::Tick(const TickSettings& settings, device::Board& board, FrameSource& frames, RingWriter<DeviceState>& states,
           StageClock clock)
    : Tick(settings, board, nullptr, &frames, states, clock) {}

Tick::Tick(const TickSettings& settings, device::Board& board, std::unique_ptr<FrameSource> owned, FrameSource* frames,
           RingWriter<DeviceState>& states, StageClock clock)
    : settings_(checked(settings)),
      board_(&board),
      owned_frames_(std::move(owned)),
      frames_(frames != nullptr ? frames : owned_frames_.get()),
      states_(&states),
      clock_(clock),
      encoders_(settings.variant, settings.maximum_string_speed),
      pose_solver_(settings.variant),
      string_monitor_(settings.variant, {.residual = settings.safety.residual}),
      velocity_({.window_ticks = settings.velocity_window_ticks, .noise = quantisation_noise(settings.variant)}),
      renderer_(settings.frames),
      passivity_(settings.passivity, settings.limits),
      limiter_(settings.limits),
      safety_(settings.safety),
      thermal_(thermal_settings(settings)),
      tension_solver_(tension_settings(settings)),
      black_box_(static_cast<std::size_t>(settings.black_box_ns / settings.period_ns)) {}

Tick::~Tick() = default;

}  // namespace haptic::rt
