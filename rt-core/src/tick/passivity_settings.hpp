// The keys of the passivity controller and of the limit of stiffness.
#pragma once

#include <haptic/config.hpp>
#include "tick/tick.hpp"

namespace haptic::rt {

/// [passivity], and what the device's mechanics and limits.stiffness say; variant, period and exchanges must have been
/// read. Throws ConfigError.
void read_passivity(const Config& config, TickSettings& tick);

}  // namespace haptic::rt
