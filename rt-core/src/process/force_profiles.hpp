// Force profiles: what a person may be exposed to in a session, by name: learning, normal, expert, and those of the
// configuration. They narrow the limits; nothing widens them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/setting.hpp"
#include "rendering/limits.hpp"
#include "tick/force_budget.hpp"
#include "tick/tick_settings.hpp"

namespace haptic::rt {

struct ForceProfile {
    std::string name;
    WrenchLimits limits;
    BudgetLimits budget;
    bool walls = true;  // of the workspace
};

/// Profile of a real device unless another one is chosen.
inline constexpr const char* kDefaultProfile = "normal";

[[nodiscard]] const std::vector<ForceProfile>& built_in_profiles();

/// That of kDefaultProfile.
[[nodiscard]] const ForceProfile& normal_profile();

/// Keys of a table [[profile]].
[[nodiscard]] const SettingTable<ForceProfile>& profile_table();

/// The profile of this name, or none for the empty name: only [limits] apply, as for an emulated device. Throws
/// ConfigError for an unknown name, and for a table [[profile]] without a name or with that of another.
[[nodiscard]] std::optional<ForceProfile> find_profile(const Config& config, const std::string& name);

/// Narrows limits and budget to the profile, and the limits to what the strings exert at the centre; where the profile
/// has walls, places them in the reachable region. Limits that the configuration does not give are the profile's.
void apply_profile(const Config& config, const ForceProfile& profile, TickSettings& tick);

/// One line for a person: "profile normal: 8 N, 0.15 N*m, ...".
[[nodiscard]] std::string describe_limits(const std::string& profile, const TickSettings& tick);

}  // namespace haptic::rt
