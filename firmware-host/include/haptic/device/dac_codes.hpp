// Conversion between the tension of a string and the DAC code of its motor.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic::device {

/// Largest magnitude: 12 bits on every known board, unsigned or with a sign.
inline constexpr int kMaxDacCode = 4095;

/// m/s^2, standard gravity: what newtons per code are found from by weights.
inline constexpr double kGravity = 9.80665;

/// DAC code for a tension (N): truncated toward zero as the boards' own host software does, clamped to +-kMaxDacCode,
/// with the sign of newtons_per_code. 0 if the tension is not positive and finite.
[[nodiscard]] std::int16_t dac_code_of_tension(double tension_n, double newtons_per_code) HAPTIC_RT;

/// Tension (N, never negative) of a DAC code. A code of the wrong sign would push the string, which has no effect.
[[nodiscard]] double tension_of_dac_code(std::int16_t dac_code, double newtons_per_code) HAPTIC_RT;

}  // namespace haptic::device
