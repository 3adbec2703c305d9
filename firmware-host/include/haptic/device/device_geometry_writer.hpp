// Device geometry writer: replaces a geometry file and never loses the previous one.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "haptic/device/device_geometry.hpp"

namespace haptic::device {

/// Writes to_toml(geometry, comment) to a temporary file next to `file`, reads it back, saves the previous contents as
/// file.bak-1, -2, ..., and only then renames the temporary file to `file`. `file` is unchanged if any step fails.
/// Returns the name of the backup if there was a previous file. Throws std::runtime_error that names the file and the
/// cause.
std::optional<std::filesystem::path> write_device_geometry(const std::filesystem::path& file,
                                                           const DeviceGeometry& geometry, std::string_view comment);

}  // namespace haptic::device
