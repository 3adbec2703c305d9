// Keys of the tool: tables [tool] and [tool.material] of a scene.
#pragma once

#include "haptic/setting.hpp"

namespace haptic::sim {

[[nodiscard]] SettingSection tool_section();
[[nodiscard]] SettingSection tool_material_section();

}  // namespace haptic::sim
