// Packet defect: the error code shared by the codecs of all boards.
#pragma once

#include <cstdint>

namespace haptic::device {

/// Why bytes are not a packet. A decoder that finds a defect leaves its output unchanged.
enum class PacketDefect : std::uint8_t {
    None,
    Length,  // wrong length
    Opcode,  // wrong opcode, or addressed to another board
    DacCode  // a DAC code exceeds the board's range
};

}  // namespace haptic::device
