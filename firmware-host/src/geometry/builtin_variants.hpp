// The files of firmware-host/variants/, compiled in.
#pragma once

#include <string_view>
#include <vector>

namespace haptic::device {

struct BuiltInVariant {
    std::string_view name;  // of the variant, as the file itself says
    std::string_view file;  // its name in variants/
    std::string_view text;
};

[[nodiscard]] const std::vector<BuiltInVariant>& built_in_variants();

}  // namespace haptic::device
