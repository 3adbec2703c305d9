// What is not known of the real boards for certain, and is therefore the user's to set (keys device.* of rt-core).
#pragma once

#include <cstdint>

namespace haptic::device {

struct BoardOptions {
    // SH4: whether bytes 0..15 of an answer repeat the digits of the same exchange, so that an answer to another
    // command is found out. Without it only the order of packets tells.
    bool check_echo = true;
    // Simple: bit i is the counting direction of encoder i.
    std::uint8_t simple_phase = 0xFF;
};

}  // namespace haptic::device
