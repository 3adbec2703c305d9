#include "tick/passivity_settings.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace haptic::rt {
namespace {

constexpr Range kEnergies{0.0, 1.0};  // J

PassivityControl control_named(const std::string& name) {
    if (name == "observe") {
        return PassivityControl::Observe;
    }
    return name == "damp" ? PassivityControl::Damp : PassivityControl::Bound;
}

/// m, the coarsest step in which a string is counted.
double resolution(const device::Variant& variant) {
    double coarsest = 0.0;
    for (const device::StringFacts& string : variant.strings) {
        coarsest = std::max(coarsest, std::fabs(string.metres_per_count));
    }
    return coarsest;
}

/// s, of the force after its encoders: with one exchange a period, and what is set besides.
double delay(const Config& config, const TickSettings& tick) {
    const double own_s = tick.exchanges == 1 ? seconds(tick.period_ns) : 0.0;
    return own_s + config.number("limits.stiffness_delay_s", 0.0, {0.0, 1.0});
}

/// A number, "none" for infinity, or "auto" for what is passive.
double largest(const Config& config, const std::string& key, Range range, double passive) {
    if (config.has(key) && !config.has_text(key)) {
        return config.number(key, 0.0, range);
    }
    return config.choice(key, "auto", {"auto", "none"}) == "none" ? std::numeric_limits<double>::infinity() : passive;
}

}  // namespace

void read_passivity(const Config& config, TickSettings& tick) {
    PassivitySettings& passivity = tick.passivity;
    passivity.control = control_named(config.choice("passivity.control", "bound", {"bound", "damp", "observe"}));
    passivity.allowance = config.number("passivity.allowance", passivity.allowance, kEnergies);
    passivity.store = config.number("passivity.store", passivity.store, kEnergies);
    passivity.recovery_s = config.number("passivity.recovery_s", passivity.recovery_s, {0.0, 1.0});
    passivity.brake = config.number("passivity.brake", passivity.brake, {0.0, 1000.0});
    passivity.rotational_brake = config.number("passivity.rotational_brake", passivity.rotational_brake, {0.0, 1.0});
    passivity.damping_credit = config.number("passivity.damping_credit", passivity.damping_credit, {0.0, 1.0});
    passivity.forget_s = config.number("passivity.forget_s", passivity.forget_s, {0.01, 1000.0});
    passivity.surface_power = config.number("passivity.surface_power", passivity.surface_power, {0.0, 1000.0});
    passivity.largest_damping = config.number("passivity.largest_damping", passivity.largest_damping, {0.0, 1000.0});
    passivity.largest_rotational_damping =
        config.number("passivity.largest_rotational_damping", passivity.largest_rotational_damping, {0.0, 1.0});
    passivity.damping = config.number("device.damping", passivity.damping, {0.0, 100.0});
    passivity.rotational_damping = config.number("device.rotational_damping", passivity.rotational_damping, {0.0, 0.1});
    passivity.mass = config.number("device.mass", passivity.mass, {0.001, 10.0});
    passivity.inertia = config.number("device.inertia", passivity.inertia, {1e-7, 0.1});
    const double friction = config.number("device.friction", 0.0, {0.0, 10.0});
    const double period_s = seconds(tick.period_ns);
    const double delay_s = delay(config, tick);
    tick.frames.largest_stiffness =
        largest(config, "limits.stiffness", {1.0, 1e6},
                passive_stiffness(passivity.damping, friction, resolution(tick.variant), period_s, delay_s));
    tick.frames.largest_rotational_stiffness =
        largest(config, "limits.rotational_stiffness", {1e-3, 1e3},
                passive_stiffness(passivity.rotational_damping, 0.0, 0.0, period_s, delay_s));
}

}  // namespace haptic::rt
