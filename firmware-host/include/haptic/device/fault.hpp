// Fault injection: what fails in an emulated board or device, when, and for how long.
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
    // Packet faults (emulated/faulty_firmware.hpp)
    Drop,       // a packet is lost
    Delay,      // a packet arrives later
    Duplicate,  // a packet arrives twice
    Truncate,   // a packet loses its end
    Flip,       // one bit of a packet is inverted
    Unplug,     // the cable is unplugged
    // Device faults (emulated/device_faults.hpp)
    Stuck,  // an encoder stops counting
    Jump,   // an encoder adds spurious counts
    Slack,  // a string becomes longer
    Dac     // the motors keep their DAC codes
};

/// Whether a fault affects the packets on the cable, rather than the device behind the board.
[[nodiscard]] constexpr bool is_packet_fault(FaultKind kind) HAPTIC_RT {
    return kind <= FaultKind::Unplug;
}

struct Fault {
    static constexpr std::int64_t kForever = std::numeric_limits<std::int64_t>::max();
    static constexpr int kAny = -1;

    FaultKind kind = FaultKind::Drop;
    std::int64_t begin_ns = 0;            // on the fault clock (EmulatedDevice::Settings::faults_wait)
    std::int64_t duration_ns = kForever;  // normal operation resumes afterwards
    bool commands = false;                // way=out: packets from the host; way=in: replies to it
    std::int64_t packets = 0;             // maximum number of affected packets; 0: no limit
    std::int64_t delay_ns = 2'000'000;    // by: of a delayed packet
    int bytes = kAny;                     // kept of a truncated packet; kAny: half of them
    int bit = kAny;                       // inverted bit, 8 k + j is bit j of byte k; kAny: random in each packet
    int string = 0;                       // kAny: all
    int counts = 3000;                    // size of an encoder's jump
    double slack_m = 0.02;                // metres: extra length of a string, m
    bool motor_dead = false;              // motor=dead: the string's motor has no current; pulls: it reels in the slack
    bool echo_frozen = true;  // echo=frozen: the board echoes the motors' DAC codes; sent: those it received

    [[nodiscard]] bool active(std::int64_t time_ns) const HAPTIC_RT {
        return time_ns >= begin_ns && (duration_ns == kForever || time_ns - begin_ns < duration_ns);
    }
    [[nodiscard]] bool affects(std::size_t index) const HAPTIC_RT {
        return string == kAny || static_cast<std::size_t>(string) == index;
    }
};

/// what() quotes the text and says which column is wrong and what is allowed there.
class FaultError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

/// Throws FaultError.
[[nodiscard]] Fault parse_fault(std::string_view text);

/// Grammar with all kinds and their parameters, for --help.
[[nodiscard]] std::string fault_help();

}  // namespace haptic::device
