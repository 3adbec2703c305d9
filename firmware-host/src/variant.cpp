#include "haptic/device/variant.hpp"

namespace haptic::device {

double Variant::rest_length(std::size_t string) const noexcept {
    return glm::length(strings[string].motor - strings[string].grip);
}

}  // namespace haptic::device
