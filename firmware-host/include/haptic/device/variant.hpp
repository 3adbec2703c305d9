// Geometry and electrical constants of one Spidar-G6 frame.
//
// Device frame: origin at the centre of the frame, right-handed, x to the right, y up, z toward the person in front of
// it. Grip frame: origin at the centre of the grip, its axes along those of the device while the grip is level.
// variant_file.hpp reads both from a TOML file; wrench_closure.hpp says what the strings can do.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

/// Which board drives the motors of a frame and counts its encoders.
enum class BoardKind : std::uint8_t {
    Sh4,     // USB 0cec:0205, 12-bit D/A, 16-bit counters
    Simple,  // USB 0cec:0203, 12-bit D/A, 24-bit counters
    Uart     // serial line, signed currents, 16-bit counters
};

/// How many bits a board's counters have before they wrap.
[[nodiscard]] constexpr int counter_bits(BoardKind kind) HAPTIC_RT {
    return kind == BoardKind::Simple ? 24 : 16;
}

/// One string: motor i pulls grip point i toward itself.
struct StringFacts {
    Vec3 motor{0.0, 0.0, 0.0};       // m, device frame, where the string leaves its pulley
    Vec3 grip{0.0, 0.0, 0.0};        // m, grip frame, where it is knotted to the grip
    double metres_per_count = 0.0;   // m; negative if the host's count falls as the string pays out
    double newtons_per_digit = 0.0;  // N; negative if the motor pulls with negative digits
    // What the motor bears; 0 where nobody knows, and the configuration of the process decides.
    double continuous_tension = 0.0;  // N, for ever
    double thermal_time_constant_s = 0.0;

    friend bool operator==(const StringFacts&, const StringFacts&) = default;
};

/// A frame with its eight strings, motors and board.
struct Variant {
    std::string name;
    BoardKind board = BoardKind::Sh4;
    std::array<StringFacts, kStrings> strings;
    double minimum_tension = 0.0;  // N, keeps every string taut
    double maximum_tension = 0.0;  // N
    std::vector<int> uart_boards;  // strings of each board on the line, by id; 8 together; empty but for Uart

    /// m, with the grip at the centre and level: what calibration sets the lengths to.
    [[nodiscard]] double rest_length(std::size_t string) const HAPTIC_RT;

    friend bool operator==(const Variant&, const Variant&) = default;
};

/// Spidar-G6 X3R, the built-in variant of that name: aluminium frame 0.120 x 0.152 x 0.120 m that stands on a corner,
/// grip 0.045 m.
[[nodiscard]] Variant spidar_g6_x3r();

}  // namespace haptic::device
