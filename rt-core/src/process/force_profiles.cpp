#include "process/force_profiles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "device/reachable_region.hpp"
#include "haptic/device/wrench_closure.hpp"

namespace haptic::rt {
namespace {

// Share of the region's size over which its wall grows to its full force, which it has at the region's edge.
constexpr double kWallShare = 0.25;
// Share of the passive stiffness that the walls may use; the rest is left to contacts.
constexpr double kStiffnessShare = 0.5;
// N/m and N*m/rad, of the walls where the configuration limits no stiffness.
constexpr double kStiffness = 300.0;
constexpr double kRotationalStiffness = 0.06;

/// Largest force (axes 0 to 2) or torque (3 to 5) that the strings exert at the centre along any axis.
double reach_along(const device::DeviceGeometry& geometry, std::size_t first_axis) {
    double largest = 0.0;
    for (std::size_t axis = first_axis; axis < first_axis + 3; ++axis) {
        for (const double sign : {-1.0, 1.0}) {
            device::WrenchVector direction{};
            direction[axis] = sign;
            largest = std::max(largest, device::wrench_reach(geometry, Pose{}, direction).value_or(0.0));
        }
    }
    return largest;
}

/// Of the profile, unless the configuration gives less.
double narrowed(const Config& config, const std::string& key, double given, double of_profile) {
    return config.has(key) ? std::min(given, of_profile) : of_profile;
}

WorkspaceWalls walls_of(const TickSettings& tick) {
    const ReachableRegion region = reachable_region(tick.geometry);
    WorkspaceWalls walls;
    if (region.empty()) {
        return walls;
    }
    const auto stiffness = [](double limit, double otherwise) {
        return std::isfinite(limit) ? kStiffnessShare * limit : otherwise;
    };
    walls.on = true;
    // The walls begin inside the region, so that they push with full force at its edge.
    walls.semi_axes = (1.0 - kWallShare) * region.semi_axes;
    walls.thickness = kWallShare * std::min({region.semi_axes.x, region.semi_axes.y, region.semi_axes.z});
    walls.force = std::min(0.5 * tick.limits.force, walls.thickness * stiffness(tick.frames.max_stiffness, kStiffness));
    walls.angle = (1.0 - kWallShare) * region.angle;
    walls.angular_thickness = kWallShare * region.angle;
    walls.torque =
        std::min(0.5 * tick.limits.torque,
                 walls.angular_thickness * stiffness(tick.frames.max_rotational_stiffness, kRotationalStiffness));
    return walls;
}

}  // namespace

const std::vector<ForceProfile>& built_in_profiles() {
    static const std::vector<ForceProfile> profiles = {
        {"learning",
         {.force = 3.0, .torque = 0.05, .force_rate = 300.0, .torque_rate = 6.0},
         {.second = 0.3, .session = 100.0, .duration = 1200.0},
         true},
        {"normal",
         {.force = 8.0, .torque = 0.15, .force_rate = 1000.0, .torque_rate = 20.0},
         {.second = 1.5, .session = 1000.0, .duration = 3600.0},
         true},
        {"expert",
         {.force = 15.0, .torque = 0.3, .force_rate = 3000.0, .torque_rate = 60.0},
         {.second = 4.0, .session = 5000.0, .duration = 14400.0},
         true},
    };
    return profiles;
}

const ForceProfile& normal_profile() {
    return built_in_profiles()[1];
}

const SettingTable<ForceProfile>& profile_table() {
    using S = ForceProfile;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "profile",
        "An own profile of forces for safety.profile, beside learning, normal and expert. Keys that are not given are "
        "those of normal. 0: no limit of an energy or a time.",
        {
            {{.key = "name", .required = true, .meaning = "Name of the profile."}, V::text(&S::name)},
            {{.key = "force", .unit = "N", .meaning = "Maximum force."},
             V::number([](S& s) -> auto& { return s.limits.force; }, {0.0, 60.0})},
            {{.key = "torque", .unit = "N*m", .meaning = "Maximum torque."},
             V::number([](S& s) -> auto& { return s.limits.torque; }, {0.0, 1.0})},
            {{.key = "force_rate", .unit = "N/s", .meaning = "Maximum rate of change of the force."},
             V::number([](S& s) -> auto& { return s.limits.force_rate; }, {1.0, 1e6})},
            {{.key = "torque_rate", .unit = "N*m/s", .meaning = "Maximum rate of change of the torque."},
             V::number([](S& s) -> auto& { return s.limits.torque_rate; }, {0.01, 1e5})},
            {{.key = "energy_per_second",
              .unit = "J",
              .meaning = "Energy that the hand may be given within about a second, less what it gave meanwhile."},
             V::number([](S& s) -> auto& { return s.budget.second; }, {0.0, 1000.0})},
            {{.key = "energy_per_session", .unit = "J", .meaning = "Energy that the hand may be given in a session."},
             V::number([](S& s) -> auto& { return s.budget.session; }, {0.0, 1e6})},
            {{.key = "session_s", .unit = "s", .meaning = "Time for which a session may render."},
             V::number([](S& s) -> auto& { return s.budget.duration; }, {0.0, 1e6})},
            {{.key = "walls", .meaning = "Whether soft walls keep the grip in the reachable workspace."},
             V::flag(&S::walls)},
        },
        SectionKind::Repeated};
    return table;
}

std::optional<ForceProfile> find_profile(const Config& config, const std::string& name) {
    // All profiles, so that a mistake in any table is found, whichever one is used.
    std::vector<ForceProfile> profiles = built_in_profiles();
    std::string names;
    for (std::size_t i = 0; i < config.tables("profile"); ++i) {
        const std::string path = "profile." + std::to_string(i);
        ForceProfile own = normal_profile();
        own.name.clear();
        profile_table().read(config, path, own);
        const bool taken = std::any_of(profiles.begin(), profiles.end(),
                                       [&own](const ForceProfile& other) { return other.name == own.name; });
        if (own.name.empty() || taken) {
            config.fail(path + ".name", own.name.empty() ? "must be given" : "is the name of another profile");
        }
        profiles.push_back(own);
    }
    if (name.empty()) {
        return std::nullopt;
    }
    for (const ForceProfile& profile : profiles) {
        if (profile.name == name) {
            return profile;
        }
        names += (names.empty() ? "" : ", ") + profile.name;
    }
    config.fail("safety.profile", "unknown profile \"" + name + "\"; there are " + names);
}

void apply_profile(const Config& config, const ForceProfile& profile, TickSettings& tick) {
    WrenchLimits& limits = tick.limits;
    limits.force = narrowed(config, "limits.force", limits.force, profile.limits.force);
    limits.torque = narrowed(config, "limits.torque", limits.torque, profile.limits.torque);
    limits.force_rate = narrowed(config, "limits.force_rate", limits.force_rate, profile.limits.force_rate);
    limits.torque_rate = narrowed(config, "limits.torque_rate", limits.torque_rate, profile.limits.torque_rate);
    // What no axis can exert is no limit worth promising.
    limits.force = std::min(limits.force, reach_along(tick.geometry, 0));
    limits.torque = std::min(limits.torque, reach_along(tick.geometry, 3));
    tick.budget = profile.budget;
    if (profile.walls) {
        tick.walls = walls_of(tick);
    }
}

std::string describe_limits(const std::string& profile, const TickSettings& tick) {
    std::array<char, 400> text{};
    std::snprintf(text.data(), text.size(), "profile %s: %.3g N, %.3g N*m, %.4g N/s, %.3g N*m/s",
                  profile.empty() ? "none" : profile.c_str(), tick.limits.force, tick.limits.torque,
                  tick.limits.force_rate, tick.limits.torque_rate);
    std::string line = text.data();
    const auto add = [&](double limit, const char* format) {
        if (limit > 0.0) {
            std::snprintf(text.data(), text.size(), format, limit);
            line += text.data();
        }
    };
    add(tick.budget.second, ", %.3g J in a second");
    add(tick.budget.session, ", %.4g J in the session");
    add(tick.budget.duration, ", %.5g s of rendering");
    if (tick.walls.on) {
        std::snprintf(text.data(), text.size(), "; walls from %.0f x %.0f x %.0f mm and %.0f degrees on",
                      1e3 * tick.walls.semi_axes.x, 1e3 * tick.walls.semi_axes.y, 1e3 * tick.walls.semi_axes.z,
                      tick.walls.angle * 180.0 / std::numbers::pi);
        return line + text.data();
    }
    return line + "; no walls";
}

}  // namespace haptic::rt
