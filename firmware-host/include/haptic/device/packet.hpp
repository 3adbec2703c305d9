// What the codecs of all boards share.
#pragma once

#include <cstdint>

namespace haptic::device {

/// Why bytes are not a packet. A decoder that finds a defect leaves its output as it was.
enum class PacketDefect : std::uint8_t {
    None,
    Length,  // not as long as such a packet is
    Opcode,  // of another kind, or for another board
    Digit    // a motor's digit has more bits than the board takes
};

}  // namespace haptic::device
