#include "haptic/device/variant.hpp"

#include <numbers>

namespace haptic::device {
namespace {

constexpr double kHalfRoot = std::numbers::sqrt2 / 2.0;

// Spidar-G6 X3: half sizes of the frame and of the grip, m.
constexpr double kX = 0.060;
constexpr double kY = 0.076;
constexpr double kZ = 0.060;
constexpr double kG = 0.0225;

/// Turns a point of the list by -45 degrees about y: the frame stands on the table with a corner toward the user.
/// Written out, not as a general rotation, so that the coordinates that cancel are exactly zero.
constexpr Vec3 turned(double x, double y, double z) noexcept {
    return {(x - z) * kHalfRoot, y, (x + z) * kHalfRoot};
}

}  // namespace

double Variant::rest_length(std::size_t string) const HAPTIC_RT {
    return glm::length(strings[string].motor - strings[string].grip);
}

Variant spidar_g6_x3r() {
    constexpr double kPulse = 1.66555e-5;                      // m a count
    constexpr double kDigit = 1.0 / (0.365296803653 * 415.0);  // N: volts a newton, digits a volt
    Variant variant;
    variant.name = "SpidarG6X3R";
    variant.board = BoardKind::Sh4;
    variant.strings = {{
        {turned(-kX, -kY, +kZ), turned(-kG, 0.0, 0.0), +kPulse, kDigit},  // lower left
        {turned(+kX, -kY, +kZ), turned(+kG, 0.0, 0.0), +kPulse, kDigit},  // lower far
        {turned(+kX, -kY, -kZ), turned(0.0, -kG, 0.0), -kPulse, kDigit},  // lower right
        {turned(-kX, -kY, -kZ), turned(0.0, -kG, 0.0), -kPulse, kDigit},  // lower near
        {turned(-kX, +kY, +kZ), turned(-kG, 0.0, 0.0), -kPulse, kDigit},  // upper left
        {turned(+kX, +kY, +kZ), turned(+kG, 0.0, 0.0), -kPulse, kDigit},  // upper far
        {turned(+kX, +kY, -kZ), turned(0.0, +kG, 0.0), +kPulse, kDigit},  // upper right
        {turned(-kX, +kY, -kZ), turned(0.0, +kG, 0.0), +kPulse, kDigit},  // upper near
    }};
    variant.minimum_tension = 0.3;
    variant.maximum_tension = 20.0;
    return variant;
}

}  // namespace haptic::device
