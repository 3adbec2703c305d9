#include "process/settings.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "haptic/device/device_geometry_file.hpp"
#include "haptic/types.hpp"
#include "process/force_profiles.hpp"
#include "process/realtime_setup.hpp"
#include "process/setting_tables.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kWatchdogPeriods = 5;

device::DeviceGeometry find_geometry(const Config& config, const FileKeys& keys) {
    try {
        return device::find_device_geometry(keys.geometry);
    } catch (const std::invalid_argument& error) {
        config.fail("device.geometry", error.what());
    }
}

/// The geometry's own limits apply; the configuration can only narrow them.
void narrow_tensions(const Config& config, const FileKeys& keys, device::DeviceGeometry& geometry) {
    geometry.minimum_tension = std::max(geometry.minimum_tension, keys.minimum_tension);
    geometry.maximum_tension = std::min(geometry.maximum_tension, keys.maximum_tension);
    if (geometry.maximum_tension <= geometry.minimum_tension) {
        config.fail(config.has("device.maximum_tension") ? "device.maximum_tension" : "device.minimum_tension",
                    "leaves no tension between the minimum, " + std::to_string(geometry.minimum_tension) +
                        " N, and the maximum, " + std::to_string(geometry.maximum_tension) +
                        " N; the limits of geometry " + geometry.name + " are included");
    }
}

void choose_usb_device(const Config& config, const FileKeys& keys, UsbSettings& usb) {
    if (!keys.usb_id.empty()) {
        usb.id = device::parse_usb_id(keys.usb_id);
        if (!usb.id) {
            config.fail("device.usb_id", "must be vendor and product in hexadecimal, such as 0cec:0205");
        }
    }
    if (keys.rotary >= 0) {
        usb.rotary = static_cast<std::uint8_t>(keys.rotary);
    }
}

/// m, the coarsest resolution of a string's encoder.
double resolution(const device::DeviceGeometry& geometry) {
    double coarsest = 0.0;
    for (const device::StringFacts& string : geometry.strings) {
        coarsest = std::max(coarsest, std::fabs(string.metres_per_count));
    }
    return coarsest;
}

double stiffness_limit(const NumberOrWord& key, double passive) {
    if (key.number) {
        return *key.number;
    }
    return key.word == "none" ? std::numeric_limits<double>::infinity() : passive;
}

void limit_stiffness(const FileKeys& keys, TickSettings& tick) {
    const PassivitySettings& device = tick.passivity;
    const double period_s = seconds(tick.period_ns);
    // With one exchange per tick the force is sent a period after its encoders were read.
    const double delay_s = (tick.exchanges == 1 ? period_s : 0.0) + keys.stiffness_delay_s;
    tick.frames.max_stiffness = stiffness_limit(
        keys.stiffness, passive_stiffness(device.damping, keys.friction, resolution(tick.geometry), period_s, delay_s));
    tick.frames.max_rotational_stiffness = stiffness_limit(
        keys.rotational_stiffness, passive_stiffness(device.rotational_damping, 0.0, 0.0, period_s, delay_s));
}

void check_probes(const Config& config, const ProbeLines& lines) {
    if (lines.loopback && !lines.tick) {
        config.fail("probes.loopback", "needs probes.tick, the line that it is wired to");
    }
    // Two names may still mean one line; then the kernel reports that it is in use.
    const auto refuse_same = [&config](const std::optional<GpioLine>& one, const std::optional<GpioLine>& other,
                                       const char* key, const char* other_key) {
        if (one && other && one->line == other->line) {
            config.fail(key, std::string("must be another line than ") + other_key);
        }
    };
    refuse_same(lines.frame, lines.tick, "probes.frame", "probes.tick");
    refuse_same(lines.loopback, lines.tick, "probes.loopback", "probes.tick");
    refuse_same(lines.loopback, lines.frame, "probes.loopback", "probes.frame");
}

/// Keys of earlier versions whose meaning has changed, so that no value can be taken over.
void refuse_old_keys(const Config& config) {
    struct OldKey {
        const char* key;
        const char* remedy;
    };
    constexpr const char* by_share = "counted ticks; faults are now judged by their share of recent time: set ";
    for (const OldKey& old : {OldKey{"safety.residual_ticks", "safety.residual_share"},
                              OldKey{"safety.exchange_ticks", "safety.exchange_share (and safety.encoder_age_s)"},
                              OldKey{"safety.overrun_ticks", "safety.late_share"}}) {
        if (config.has(old.key)) {
            config.fail(old.key, std::string(by_share) + old.remedy + " instead");
        }
    }
}

/// The line of the motors' relay, which is another one than all others.
void choose_relay(const Config& config, const FileKeys& keys, Settings& settings) {
    if (keys.relay_chip.empty()) {
        return;
    }
    const std::string line = std::to_string(keys.relay_line);
    const GpioStopSettings& stop = settings.stop_line;
    bool taken = stop.chip == keys.relay_chip && stop.line == keys.relay_line;
    for (const auto& probe : {settings.probes.tick, settings.probes.frame, settings.probes.loopback}) {
        taken = taken || (probe && probe->chip == keys.relay_chip && probe->line == line);
    }
    if (taken) {
        config.fail("safety.relay_line", "must be another line than the stop line and the probes");
    }
    settings.probes.relay = GpioLine{.chip = keys.relay_chip,
                                     .line = line,
                                     .purpose = "relay line (safety.relay_chip, safety.relay_line)",
                                     .user = "rt-core relay"};
}

void check_times(const Config& config, const Settings& settings) {
    if (settings.watchdog.limit_ns < kWatchdogPeriods * settings.loop.period_ns) {
        config.fail("safety.watchdog_s", "must be at least 5 times loop.period_s");
    }
    if (settings.tick.black_box_ns < settings.tick.period_ns) {
        config.fail("recording.black_box_s", "must be at least loop.period_s");
    }
}

void check_buttons(const Config& config, const Settings& settings) {
    if (settings.loop.arm_button >= 0 && settings.loop.arm_button == settings.tick.stop_button) {
        config.fail("safety.arm_button", "must be another switch than safety.stop_button");
    }
}

void check_motors(const Config& config, const TickSettings& tick) {
    if (tick.motors.continuous_share * tick.geometry.maximum_tension <= 1.2 * tick.geometry.minimum_tension) {
        config.fail("motors.continuous_share",
                    "times device.maximum_tension must be more than 1.2 times device.minimum_tension; else keeping the "
                    "strings taut overheats the motors");
    }
}

}  // namespace

Settings read_settings(const Config& config) {
    Settings settings;
    FileKeys keys;
    visit_tables(settings, keys, [&config](const auto& table, auto& part) { table.read(config, part); });
    settings.tick.period_ns = settings.loop.period_ns;
    settings.watchdog.priority = settings.loop.priority + 1;
    settings.guard.priority = std::min(settings.loop.priority + 2, kHighestPriority);
    settings.probes.slowest_edge_ns = keys.probes.slowest_edge_ns;
    settings.mechanics = device::grip_mechanics(keys.emulated);
    settings.tremor = keys.emulated.tremor;
    settings.tick.geometry = find_geometry(config, keys);
    settings.protocol =
        read_protocol(keys.protocol.empty() ? protocol_beside(keys.geometry) : std::filesystem::path(keys.protocol),
                      settings.tick.geometry);
    narrow_tensions(config, keys, settings.tick.geometry);
    choose_usb_device(config, keys, settings.usb);
    limit_stiffness(keys, settings.tick);
    if (const std::optional<ForceProfile> profile = find_profile(config, settings.profile)) {
        apply_profile(config, *profile, settings.tick);
    }
    settings.tick.walls.on = settings.tick.walls.on && settings.walls;
    check_probes(config, settings.probes);
    choose_relay(config, keys, settings);
    check_times(config, settings);
    check_motors(config, settings.tick);
    check_buttons(config, settings);
    refuse_old_keys(config);
    config.reject_unknown();
    return settings;
}

SettingReference setting_reference() {
    Settings settings;
    FileKeys keys;
    SettingReference reference;
    visit_tables(settings, keys,
                 [&reference](const auto& table, const auto& part) { add_section(reference, table.describe(part)); });
    add_section(reference, profile_table().describe(normal_profile()));
    return reference;
}

std::string default_config_text() {
    return commented_toml(
        "Configuration of rt-core. Every key is optional; the values here are the defaults. Use it with rt-core run "
        "--config FILE; --set SECTION.KEY=VALUE overrides one key. SI units. The manual page is rt-core.toml(5).",
        setting_reference());
}

}  // namespace haptic::rt
