// Geometry and electrical constants of one Spidar-G6 frame.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

/// One string: motor i pulls grip point i toward itself.
struct StringFacts {
    Vec3 motor{0.0, 0.0, 0.0};  // m, device frame, where the string leaves its pulley
    Vec3 grip{0.0, 0.0, 0.0};   // m, grip frame, where it is knotted to the grip
    int count_sign = 1;         // +1 if the host count (already negated from the raw one) rises as the string pays out
};

/// A frame with its eight strings, motors and board.
struct Variant {
    std::string name;
    std::array<StringFacts, kStrings> strings;
    double metres_per_count = 0.0;
    double volts_per_newton = 0.0;
    double digits_per_volt = 0.0;
    double minimum_tension = 0.0;  // N, keeps every string taut
    double maximum_tension = 0.0;  // N

    /// m, with the grip at the centre and level: what calibration sets the lengths to.
    [[nodiscard]] double rest_length(std::size_t string) const HAPTIC_RT;
};

/// Spidar-G6 X3R: aluminium frame 0.120 x 0.152 x 0.120 m, list turned by -45 degrees about y, grip 0.045 m.
/// @source Springhead HISpidarGDesc::Init, as tabled in the firmware-host README.
[[nodiscard]] Variant spidar_g6_x3r();

}  // namespace haptic::device
