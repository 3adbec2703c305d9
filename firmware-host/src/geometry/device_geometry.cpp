#include "haptic/device/device_geometry.hpp"

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::device {

double DeviceGeometry::rest_length(std::size_t string) const HAPTIC_RT {
    return glm::length(strings[string].motor - strings[string].grip);
}

DeviceGeometry spidar_g6_x3r() {
    static const DeviceGeometry x3r = built_in_geometry("SpidarG6X3R");
    return x3r;
}

}  // namespace haptic::device
