// The device of most tests, an X3R, and what they have in common.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>

#include "haptic/device/device_geometry.hpp"

namespace haptic::device::test {

inline constexpr std::int64_t kMs = 1'000'000;  // ns
inline constexpr double kPulse = 1.66555e-5;    // m per count
inline constexpr Quat kLevel(1.0, 0.0, 0.0, 0.0);
/// Readings of counters of 16 bits before they are cleared.
inline constexpr std::array<std::uint32_t, kStrings> kPowerUp = {0, 65535, 32768, 12345, 1, 40000, 7, 60000};

/// Counts by which string i lengthens when the grip moves 20 mm to the right.
inline long counts_of_a_step_to_the_right(std::size_t i) {
    const StringFacts string = spidar_g6_x3r().strings[i];
    const double before = glm::length(string.motor - string.grip);
    const double after = glm::length(string.motor - string.grip - Vec3(0.02, 0.0, 0.0));
    return std::lround((after - before) / string.metres_per_count);
}

}  // namespace haptic::device::test
