// Faults on command: what goes wrong with an emulated board or device, when, and for how long.
//
//     KIND@T[/DURATION][:NAME=VALUE[,NAME=VALUE ...]]          drop@2.0/0.5    jump@2:string=3,counts=3000
#pragma once

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

enum class FaultKind : std::uint8_t {
    // Of packets (faulty_firmware.hpp)
    Drop,       // a packet gets lost
    Delay,      // a packet comes later
    Duplicate,  // a packet comes twice
    Truncate,   // a packet loses its end
    Flip,       // one bit of a packet is inverted
    Unplug,     // the cable is out
    // Of the device (device_faults.hpp)
    Stuck,  // an encoder stands still
    Jump,   // an encoder counts what was not there
    Slack,  // a string gets longer
    Dac     // the motors keep what they had
};

/// Which end of a fault: the packets on the cable, or what is behind the board.
[[nodiscard]] constexpr bool is_of_packets(FaultKind kind) HAPTIC_RT {
    return kind <= FaultKind::Unplug;
}

struct Fault {
    static constexpr std::int64_t kForever = std::numeric_limits<std::int64_t>::max();
    static constexpr int kAny = -1;

    FaultKind kind = FaultKind::Drop;
    std::int64_t begin_ns = 0;            // on the faults' clock (EmulatedDevice::Settings::faults_wait)
    std::int64_t duration_ns = kForever;  // after which all is as before
    bool commands = false;                // way=out: packets from the host; way=in: answers to it
    std::int64_t packets = 0;             // no more than so many of them; 0 for all
    std::int64_t delay_ns = 2'000'000;    // by: of a delayed packet
    int bytes = kAny;                     // that a truncated packet keeps; kAny: half of them
    int bit = kAny;                       // that is inverted, 8 k + j is bit j of byte k; kAny: another in each packet
    int string = 0;                       // kAny: all
    int counts = 3000;                    // by which an encoder jumps
    double slack_m = 0.02;                // m, metres: by which a string gets longer
    bool motor_dead = false;              // motor=dead: the string's motor has no current; pulls: it reels the slack in
    bool echo_frozen = true;  // echo=frozen: the board reads back what the motors have; sent: what it was sent

    [[nodiscard]] bool active(std::int64_t time_ns) const HAPTIC_RT {
        return time_ns >= begin_ns && (duration_ns == kForever || time_ns - begin_ns < duration_ns);
    }
    [[nodiscard]] bool concerns(std::size_t index) const HAPTIC_RT {
        return string == kAny || static_cast<std::size_t>(string) == index;
    }
};

/// what() quotes the text, and says where in it what is wrong and what would be right.
class FaultError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

/// Throws FaultError.
[[nodiscard]] Fault parse_fault(std::string_view text);

/// The grammar with all kinds and their parameters, for --help.
[[nodiscard]] std::string fault_help();

}  // namespace haptic::device
