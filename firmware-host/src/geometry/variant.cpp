#include <haptic/device/variant.hpp>

#include <haptic/device/variant_file.hpp>

namespace haptic::device {

double Variant::rest_length(std::size_t string) const HAPTIC_RT {
    return glm::length(strings[string].motor - strings[string].grip);
}

Variant spidar_g6_x3r() {
    static const Variant x3r = builtin_variant("SpidarG6X3R");
    return x3r;
}

}  // namespace haptic::device
