// Built-in device geometries: the files of firmware-host/geometries/, compiled in.
#pragma once

#include <string_view>
#include <vector>

namespace haptic::device {

struct BuiltInGeometry {
    std::string_view name;  // of the geometry, as in the file
    std::string_view file;  // file name in geometries/
    std::string_view text;
};

[[nodiscard]] const std::vector<BuiltInGeometry>& built_in_geometries();

}  // namespace haptic::device
