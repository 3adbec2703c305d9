// Between the tension of a string and the digit that its motor is sent.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic::device {

/// Twelve bits: what every known board takes, of one sign or both.
inline constexpr int kMaximumDigit = 4095;

/// Digit for a tension: cut towards zero as the boards' own host software does, clamped to +-kMaximumDigit, of the sign
/// of newtons_per_digit; 0 for a tension that is not positive and finite.
[[nodiscard]] std::int16_t digit_of_tension(double tension_n, double newtons_per_digit) HAPTIC_RT;

/// The tension that a digit stands for, N: 0 or more. A motor that is sent the wrong sign pushes a string, which does
/// nothing.
[[nodiscard]] double tension_of_digit(std::int16_t digit, double newtons_per_digit) HAPTIC_RT;

}  // namespace haptic::device
