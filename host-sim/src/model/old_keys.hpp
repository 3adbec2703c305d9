// Keys of a body's mass and stiffness that its material has replaced. They keep working, with a notice.
#pragma once

#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/model_settings.hpp"

namespace haptic::sim {

/// One line for each such key that `table`, "model" or "objects.0", gives: file and line, what is wrong with the key,
/// and what replaces it. None for a body with a material, one with the material "none", and plates and rods, which are
/// rigid. Of the regions' stiffnesses only the first is named. `body` is as read from the table.
[[nodiscard]] std::vector<std::string> old_key_notices(const Config& config, const std::string& table,
                                                       const ModelSettings& body);

}  // namespace haptic::sim
