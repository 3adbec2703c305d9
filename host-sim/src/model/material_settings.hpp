// What a scene says of a body's material: a name, values, or both.
#pragma once

#include <optional>
#include <string>

#include "haptic/config.hpp"
#include "haptic/setting.hpp"
#include "haptic/sim/material.hpp"
#include "haptic/sim/model_settings.hpp"

namespace haptic::sim {

/// Reads `key`, either the name of a material or a table of its values. None if the key is missing. Throws ConfigError.
[[nodiscard]] std::optional<MaterialSettings> read_material(const Config& config, const std::string& key);

[[nodiscard]] SettingSection material_section();

/// The values of `settings` where they are given, else those of the named material, else those of `otherwise`. Throws
/// ConfigError for values of the other kind, and std::invalid_argument as check() does.
[[nodiscard]] SolidMaterial solid_of(const MaterialSettings& settings, const SolidMaterial& otherwise);
[[nodiscard]] SheetMaterial sheet_of(const MaterialSettings& settings, const SheetMaterial& otherwise);

}  // namespace haptic::sim
