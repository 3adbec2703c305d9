// Keys of the tool: table [tool] of a scene.
#pragma once

#include "haptic/setting.hpp"

namespace haptic::sim {

[[nodiscard]] SettingSection tool_section();

}  // namespace haptic::sim
