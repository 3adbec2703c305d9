// Device geometry: where the strings of a Spidar-G6 run, and the electrical constants of its motors and encoders.
//
// Device frame: origin at the centre of the structure that holds the motors, right-handed, x right, y up, z toward the
// user. Grip frame: origin at the centre of the grip, axes parallel to the device frame while the grip is level.
// device_geometry_file.hpp reads both from TOML; wrench_closure.hpp analyses the wrenches that the strings can
// produce.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

/// The electronics that drive the motors and count the encoders.
enum class BoardKind : std::uint8_t {
    Sh4,     // USB 0cec:0205, 12-bit D/A, 16-bit counters
    Simple,  // USB 0cec:0203, 12-bit D/A, 24-bit counters
    Uart     // serial line, signed currents, 16-bit counters
};

/// Width of a board's counters, bits, before they wrap.
[[nodiscard]] constexpr int counter_bits(BoardKind kind) HAPTIC_RT {
    return kind == BoardKind::Simple ? 24 : 16;
}

/// One string: motor i pulls knot i of the grip toward itself.
struct StringFacts {
    Vec3 motor{0.0, 0.0, 0.0};      // m, device frame: where the string leaves its pulley
    Vec3 grip{0.0, 0.0, 0.0};       // m, grip frame: knot
    double metres_per_count = 0.0;  // m; negative if the count falls while the string pays out
    double newtons_per_code = 0.0;  // N; negative if the motor pulls with negative DAC codes
    // Thermal rating of the motor; 0 if unknown, in which case the configuration of the process decides.
    double continuous_tension = 0.0;  // N, sustained without a time limit
    double thermal_time_constant_s = 0.0;

    friend bool operator==(const StringFacts&, const StringFacts&) = default;
};

/// A device: eight strings, their tension limits, and the board.
struct DeviceGeometry {
    std::string name;
    BoardKind board = BoardKind::Sh4;
    std::array<StringFacts, kStrings> strings;  // string i is counted by channel i of the board
    // Channel of the board that drives the motor of string i; a permutation. It differs from i where the plugs of
    // motors are exchanged.
    std::array<std::uint8_t, kStrings> motor_channels{0, 1, 2, 3, 4, 5, 6, 7};
    double minimum_tension = 0.0;  // N, keeps every string taut
    double maximum_tension = 0.0;  // N
    std::vector<int> uart_boards;  // number of strings of each board on the line, by id, total 8; empty unless Uart

    /// Length of a string with the grip level at the centre, m. Calibration sets the lengths to this.
    [[nodiscard]] double rest_length(std::size_t string) const HAPTIC_RT;

    friend bool operator==(const DeviceGeometry&, const DeviceGeometry&) = default;
};

/// Built-in geometry of the Spidar-G6 X3R: aluminium structure of 0.120 x 0.152 x 0.120 m standing on a corner, grip of
/// 0.045 m.
[[nodiscard]] DeviceGeometry spidar_g6_x3r();

}  // namespace haptic::device
