// Device geometry files: TOML with motors, knots, signs, scales and limits of one device. The known geometries are
// compiled in (firmware-host/geometries/*.toml, also installed). Users supply another device, or their calibration of a
// known one, as a file of their own.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/device/device_geometry.hpp"

namespace haptic::device {

/// Reads and checks a file. Throws ConfigError with FILE:LINE, key and remedy for: invalid TOML, unknown or missing
/// keys, a number of strings other than eight, values out of range or not finite, minimum_tension above
/// maximum_tension, DAC codes that cannot produce maximum_tension, strings of zero length, lengths that do not
/// determine the pose at the centre. Unusual but valid geometries give warnings (warnings_of). Prints a notice with
/// FILE:LINE on stderr for a key by its old name.
[[nodiscard]] DeviceGeometry load_device_geometry(const std::filesystem::path& file);
/// The same from memory, without the notice; `name` replaces the file name in messages.
[[nodiscard]] DeviceGeometry parse_device_geometry(std::string_view toml, std::string_view name);

/// Throws std::invalid_argument that lists the valid names.
[[nodiscard]] DeviceGeometry built_in_geometry(std::string_view name);
/// Names in listing order.
[[nodiscard]] std::vector<std::string> built_in_geometry_names();
/// Commented file of a built-in geometry, as it is installed. Throws like built_in_geometry().
[[nodiscard]] std::string_view built_in_geometry_text(std::string_view name);

/// Resolves a setting or an option: a path if it contains a slash or ends in ".toml", otherwise a built-in name. Throws
/// like load_device_geometry() and built_in_geometry().
[[nodiscard]] DeviceGeometry find_device_geometry(const std::string& name_or_path);

/// Text of a file that parse_device_geometry() reads back to the same bits. Starts with `comment`, each of its lines
/// prefixed with '#'.
[[nodiscard]] std::string to_toml(const DeviceGeometry& geometry, std::string_view comment);

/// A property that is valid but limits the use of a device.
struct DeviceGeometryWarning {
    std::string name;  // "not_wrench_closed"
    std::string text;  // consequence for this device
};

[[nodiscard]] std::vector<DeviceGeometryWarning> warnings_of(const DeviceGeometry& geometry);

}  // namespace haptic::device
