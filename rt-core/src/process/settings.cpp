#include "process/settings.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include <haptic/device/emulated_config.hpp>
#include <haptic/device/variant_file.hpp>
#include <haptic/types.hpp>
#include "tick/passivity_settings.hpp"

namespace haptic::rt {
namespace {

constexpr Range kTimes{0.001, 10.0};  // s
constexpr Range kTicks{0, 100'000};
constexpr std::int64_t kWatchdogPeriods = 5;

std::int64_t duration_ns(const Config& config, const std::string& key, std::int64_t otherwise_ns, Range range_s) {
    return nanoseconds(config.number(key, seconds(otherwise_ns), range_s));
}

int whole(const Config& config, const std::string& key, int otherwise, Range range) {
    return static_cast<int>(config.integer(key, otherwise, range));
}

void read_loop(const Config& config, Settings& settings) {
    LoopSettings& loop = settings.loop;
    loop.period_ns = duration_ns(config, "loop.period_s", loop.period_ns, {0.0001, 0.02});
    loop.priority = whole(config, "loop.priority", loop.priority, {1, 97});
    loop.cpu = whole(config, "loop.cpu", loop.cpu, {-1, 1023});
    loop.idle_exit_us = whole(config, "loop.idle_exit_us", loop.idle_exit_us, {-1, 100'000});
    loop.warm_up_ticks = whole(config, "loop.warm_up_ticks", loop.warm_up_ticks, {1, 100'000});
    settings.tick.period_ns = loop.period_ns;
    settings.watchdog.priority = loop.priority + 1;
}

device::Variant choose_variant(const Config& config) {
    const std::string chosen = config.text("device.variant", "SpidarG6X3R");
    try {
        return device::find_variant(chosen);
    } catch (const std::invalid_argument& error) {
        config.fail("device.variant", error.what());
    }
}

/// The variant's own limits hold; the configuration may only narrow them.
void narrow_tensions(const Config& config, device::Variant& variant) {
    variant.minimum_tension =
        std::max(variant.minimum_tension, config.number("device.minimum_tension", 0.0, {0.0, 5.0}));
    variant.maximum_tension =
        std::min(variant.maximum_tension, config.number("device.maximum_tension", 200.0, {0.1, 200.0}));
    if (variant.maximum_tension <= variant.minimum_tension) {
        config.fail(config.has("device.maximum_tension") ? "device.maximum_tension" : "device.minimum_tension",
                    "leaves no tension between " + std::to_string(variant.minimum_tension) + " N and " +
                        std::to_string(variant.maximum_tension) + " N, of which the limits of " + variant.name +
                        " are a part");
    }
}

void read_device(const Config& config, TickSettings& tick) {
    tick.variant = choose_variant(config);
    narrow_tensions(config, tick.variant);
    tick.exchanges = config.choice("device.exchanges", "two", {"one", "two"}) == "one" ? 1 : 2;
    tick.maximum_string_speed = config.number("device.maximum_string_speed", tick.maximum_string_speed, {0.1, 20.0});
    tick.velocity_window_ticks =
        whole(config, "velocity.window_ticks", tick.velocity_window_ticks, {1, AdaptiveVelocity::kMostTicks});
    tick.tension_effort = config.number("tension.effort", tick.tension_effort, {1e-12, 1.0});
    tick.tension_infeasible = config.choice("tension.infeasible", "closest", {"closest", "direction"}) == "closest"
                                  ? Infeasible::Closest
                                  : Infeasible::Direction;
    tick.tension_continuity = config.number("tension.continuity", tick.tension_continuity, {0.0, 1.0});
    tick.tension_rate = config.number("tension.rate", tick.tension_rate, {10.0, 1e6});
}

void read_force(const Config& config, TickSettings& tick) {
    FrameSettings& frames = tick.frames;
    frames.stale_after_ns = duration_ns(config, "frames.stale_after_s", frames.stale_after_ns, kTimes);
    frames.fade_ns = duration_ns(config, "frames.fade_s", frames.fade_ns, kTimes);
    frames.ramp_ns = duration_ns(config, "frames.ramp_s", frames.ramp_ns, kTimes);

    WrenchLimits& limits = tick.limits;
    limits.force = config.number("limits.force", limits.force, {0.0, 60.0});
    limits.torque = config.number("limits.torque", limits.torque, {0.0, 1.0});
    limits.force_rate = config.number("limits.force_rate", limits.force_rate, {1.0, 1e6});
    limits.torque_rate = config.number("limits.torque_rate", limits.torque_rate, {0.01, 1e5});
}

void read_safety(const Config& config, SafetySettings& safety) {
    safety.tension_ramp_ns = duration_ns(config, "safety.tension_ramp_s", safety.tension_ramp_ns, {0.01, 10.0});
    safety.calibration_hold_ns =
        duration_ns(config, "safety.calibration_hold_s", safety.calibration_hold_ns, {0.0, 60.0});
    safety.calibration_movement =
        config.number("safety.calibration_movement", safety.calibration_movement, {0.00005, 0.01});
    safety.fault_fade_ns = duration_ns(config, "safety.fault_fade_s", safety.fault_fade_ns, {0.001, 10.0});
    safety.residual = config.number("safety.residual", safety.residual, {0.0001, 0.1});
    safety.residual_ticks = whole(config, "safety.residual_ticks", safety.residual_ticks, kTicks);
    safety.exchange_ticks = whole(config, "safety.exchange_ticks", safety.exchange_ticks, kTicks);
    safety.overrun_ticks = whole(config, "safety.overrun_ticks", safety.overrun_ticks, kTicks);
}

void read_stop_input(const Config& config, Settings& settings) {
    TickSettings& tick = settings.tick;
    tick.stop_button = whole(config, "safety.stop_button", tick.stop_button, {-1, 2});
    tick.stop_when_released = config.choice("safety.stop_button_when", "held", {"held", "released"}) == "released";
    GpioStopSettings& line = settings.stop_line;
    line.chip = config.text("safety.stop_chip", line.chip);
    line.line = whole(config, "safety.stop_line", line.line, {0, 1023});
    line.stop_when_high = config.choice("safety.stop_level", "high", {"high", "low"}) == "high";
}

ProbeLines read_probes(const Config& config) {
    ProbeLines lines{.tick = read_probe_line(config, "tick", "rt-core"),
                     .frame = read_probe_line(config, "frame", "rt-core"),
                     .loopback = read_probe_line(config, "loopback", "rt-core"),
                     .loopback_edges = config.choice("probes.loopback_edges", "rising", {"rising", "both"}) == "both"
                                           ? EdgeKind::Both
                                           : EdgeKind::Rising,
                     .slowest_edge_ns = read_slowest_edge_ns(config)};
    if (lines.loopback && !lines.tick) {
        config.fail("probes.loopback", "needs probes.tick, the line that it is wired to");
    }
    // Names may still be two of one line; the kernel then says that it is in use.
    const auto refuse_same = [&config](const std::optional<GpioLine>& one, const std::optional<GpioLine>& other,
                                       const char* key, const char* of) {
        if (one && other && one->line == other->line) {
            config.fail(key, std::string("must be another line than ") + of);
        }
    };
    refuse_same(lines.frame, lines.tick, "probes.frame", "probes.tick");
    refuse_same(lines.loopback, lines.tick, "probes.loopback", "probes.tick");
    refuse_same(lines.loopback, lines.frame, "probes.loopback", "probes.frame");
    return lines;
}

void read_watchdog(const Config& config, Settings& settings) {
    settings.watchdog.limit_ns = duration_ns(config, "safety.watchdog_s", settings.watchdog.limit_ns, {0.01, 10.0});
    if (settings.watchdog.limit_ns < kWatchdogPeriods * settings.loop.period_ns) {
        config.fail("safety.watchdog_s", "must be at least 5 times loop.period_s");
    }
}

void read_motors(const Config& config, TickSettings& tick) {
    MotorSettings& motors = tick.motors;
    motors.continuous_share = config.number("motors.continuous_share", motors.continuous_share, {0.01, 1.0});
    motors.time_constant_s = config.number("motors.time_constant_s", motors.time_constant_s, {0.1, 10'000.0});
    motors.derate_from = config.number("motors.derate_from", motors.derate_from, {0.0, 0.99});
    if (motors.continuous_share * tick.variant.maximum_tension <= 1.2 * tick.variant.minimum_tension) {
        config.fail("motors.continuous_share",
                    "of device.maximum_tension must be more than 1.2 times "
                    "device.minimum_tension, or keeping the strings taut overheats the motors");
    }
}

}  // namespace

Settings read_settings(const Config& config) {
    Settings settings;
    read_loop(config, settings);
    read_device(config, settings.tick);
    settings.board = read_board_options(config);
    settings.usb = read_usb_settings(config);
    settings.mechanics = device::read_emulated(config);
    settings.serial = read_serial_settings(config);
    read_force(config, settings.tick);
    read_passivity(config, settings.tick);
    read_safety(config, settings.tick.safety);
    read_stop_input(config, settings);
    settings.probes = read_probes(config);
    read_watchdog(config, settings);
    settings.rearm = config.flag("safety.rearm", settings.rearm);
    read_motors(config, settings.tick);
    settings.queue_ticks = static_cast<std::size_t>(
        config.integer("recording.queue_ticks", static_cast<std::int64_t>(settings.queue_ticks), {16, 1'048'576}));
    settings.queue_frames = static_cast<std::size_t>(
        config.integer("recording.queue_frames", static_cast<std::int64_t>(settings.queue_frames), {16, 65'536}));
    settings.tick.black_box_ns = duration_ns(config, "recording.black_box_s", settings.tick.black_box_ns, {0.01, 60.0});
    if (settings.tick.black_box_ns < settings.tick.period_ns) {
        config.fail("recording.black_box_s", "must be at least loop.period_s");
    }
    config.reject_unknown();
    return settings;
}

}  // namespace haptic::rt
