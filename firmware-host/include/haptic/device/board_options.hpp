// What is not known of the real boards for certain, and is therefore the user's to set (keys device.* of rt-core).
#pragma once

#include <cstdint>

namespace haptic::device {

struct UartOptions {
    // Zeros after a command beyond what clocks its answer out without delay: answer - command + padding, 5 at least.
    // 20 is what the published driver sends; fewer are faster, and enough where a board answers at once.
    int padding = 20;
    // Whether boards are told how long the commands to the others on their line are.
    bool set_lengths = true;
};

struct BoardOptions {
    // SH4: whether bytes 0..15 of an answer repeat the digits of the same exchange, so that an answer to another
    // command is found out. Without it only the order of packets tells.
    bool check_echo = true;
    // Simple: bit i is the counting direction of encoder i.
    std::uint8_t simple_phase = 0xFF;
    UartOptions uart;
};

}  // namespace haptic::device
