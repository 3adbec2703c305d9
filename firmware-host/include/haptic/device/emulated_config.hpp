// The table [emulated] of a configuration: what stands behind an emulated board.
#pragma once

#include <optional>

#include "haptic/config.hpp"
#include "haptic/device/grip_mechanics.hpp"

namespace haptic::device {

/// Reads every key of the table; rt-core/config/rt-core.toml says what each means. Nothing for `mechanics = "ideal"`, a
/// hand that holds the grip on its track whatever the strings do. Throws ConfigError.
[[nodiscard]] std::optional<GripMechanics> read_emulated(const Config& config);

}  // namespace haptic::device
