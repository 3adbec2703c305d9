// PIO word of both USB boards, low byte: bits 0-2 are external switches, bits 4-7 the rotary id switch.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic::device {

inline constexpr unsigned kPioButtonMask = 0x07;
inline constexpr unsigned kPioRotaryShift = 4;
inline constexpr unsigned kPioRotaryMask = 0x0F;

[[nodiscard]] inline std::uint32_t pio_buttons(unsigned pio) HAPTIC_RT {
    return pio & kPioButtonMask;
}

[[nodiscard]] inline std::uint8_t pio_rotary(unsigned pio) HAPTIC_RT {
    return static_cast<std::uint8_t>((pio >> kPioRotaryShift) & kPioRotaryMask);
}

[[nodiscard]] inline std::uint8_t pio_of(unsigned buttons, unsigned rotary) HAPTIC_RT {
    return static_cast<std::uint8_t>((buttons & kPioButtonMask) | ((rotary & kPioRotaryMask) << kPioRotaryShift));
}

}  // namespace haptic::device
