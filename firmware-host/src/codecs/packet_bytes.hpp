// Little-endian 16-bit words in packets. Precondition: at + 2 <= bytes.size().
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic/realtime.hpp"

namespace haptic::device {

inline std::uint16_t load_word(std::span<const std::byte> bytes, std::size_t at) HAPTIC_RT {
    const auto low = std::to_integer<std::uint32_t>(bytes[at]);
    const auto high = std::to_integer<std::uint32_t>(bytes[at + 1]);
    return static_cast<std::uint16_t>(low | (high << 8U));
}

inline void store_word(std::span<std::byte> bytes, std::size_t at, std::uint16_t word) HAPTIC_RT {
    bytes[at] = static_cast<std::byte>(word & 0xFFU);
    bytes[at + 1] = static_cast<std::byte>((word >> 8U) & 0xFFU);
}

}  // namespace haptic::device
