// Variants as files: TOML with motors, knots, signs, scales and limits of one frame. The ones that are known are built
// in (firmware-host/variants/*.toml, installed too); a user adds a frame, or the calibration of one, by another file.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/device/variant.hpp"

namespace haptic::device {

/// Reads and checks a file. Throws ConfigError with FILE:LINE, key and remedy: not TOML, unknown or missing keys, not
/// exactly eight strings, values not finite or out of range, bounds out of order, digits that cannot make the largest
/// tension, strings of no length, strings that do not determine the pose at the centre. What is legal but unusual are
/// warnings (warnings_of).
[[nodiscard]] Variant load_variant(const std::filesystem::path& file);
/// The same from memory; name stands for the file in messages.
[[nodiscard]] Variant parse_variant(std::string_view toml, std::string_view name);

/// Throws std::invalid_argument with the names that there are.
[[nodiscard]] Variant builtin_variant(std::string_view name);
/// In the order in which they are listed.
[[nodiscard]] std::vector<std::string> builtin_variant_names();
/// The commented file of a built-in variant, as it is installed. Throws like builtin_variant().
[[nodiscard]] std::string_view builtin_variant_text(std::string_view name);

/// What a setting or an option means: a path if it has a slash or ends in ".toml", else a built-in name. Throws like
/// load_variant() and builtin_variant().
[[nodiscard]] Variant find_variant(const std::string& name_or_path);

/// The variant as a file that parse_variant() reads back to the same bits. The first lines are `comment`, each of its
/// lines after a '#'.
[[nodiscard]] std::string to_toml(const Variant& variant, std::string_view comment);

/// What is legal in a variant but limits what it can do.
struct VariantWarning {
    std::string name;  // "not_wrench_closed"
    std::string text;  // what that means for this variant
};

[[nodiscard]] std::vector<VariantWarning> warnings_of(const Variant& variant);

}  // namespace haptic::device
