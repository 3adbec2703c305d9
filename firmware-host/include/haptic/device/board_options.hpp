// Board options: properties of the real boards that are not known for certain. The user sets them with the keys
// device.* of rt-core.
#pragma once

#include <cstdint>

namespace haptic::device {

struct UartOptions {
    // Zero bytes that follow a command, in addition to those that clock its reply out: max(5, reply - command +
    // padding) are sent. The published driver uses 20. Fewer are faster, and sufficient if a board replies immediately.
    int padding = 20;
    // Tell each board the lengths of the commands to the other boards on its line.
    bool set_lengths = true;
};

struct BoardOptions {
    // SH4: bytes 0..15 of a reply echo the DAC codes of the same exchange, so that a reply to another command is
    // detected. Without this check only the order of packets matches replies to commands.
    bool check_echo = true;
    // Simple: bit i is the counting direction of encoder i.
    std::uint8_t simple_phase = 0xFF;
    UartOptions uart;
};

}  // namespace haptic::device
