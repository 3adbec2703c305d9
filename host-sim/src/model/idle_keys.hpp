// Keys of a body that have no effect on it, such as the cells of a cloth.
#pragma once

#include <string>

#include "haptic/config.hpp"
#include "haptic/sim/model_settings.hpp"

namespace haptic::sim {

/// One line on the keys of `table`, "model" or "objects.0", that the body's generator, mesh file or particle file does
/// not use, with the place of the first one; "" if there is none. It is no error, so that a scene can be tried with
/// another generator or mesh. `body` is as read from the table.
[[nodiscard]] std::string idle_key_notice(const Config& config, const std::string& table, const ModelSettings& body);

}  // namespace haptic::sim
