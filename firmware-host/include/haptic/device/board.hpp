// What the tick sees of a board: one bounded exchange, digits out and counters in, whatever the packets are.
//
//     Tick -> Board (Sh4Board, ...: codec and sequence) -> Transport (usbfs, serial line, or in this process) -> device
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string_view>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// How an exchange ended. Everything but Ok leaves the reading untouched.
enum class ExchangeStatus : std::uint8_t {
    Ok,
    Timeout,       // no answer within the transport's bound
    Short,         // an answer of another length
    Malformed,     // an answer that cannot be one
    Stale,         // an answer to another command than the one that was sent
    Stalled,       // the endpoint refused the transfer
    Disconnected,  // there is no device any more
    Failed,        // the bus did not carry a packet, or not whole
};
inline constexpr std::size_t kExchangeStatuses = 8;

/// One or two words for reports.
[[nodiscard]] std::string_view describe(ExchangeStatus status) noexcept;

/// What the motors are to do.
struct MotorCommand {
    std::array<std::int16_t, kStrings> digits{};  // see digits.hpp; boards with unsigned D/A take 0..4095 of it

    friend bool operator==(const MotorCommand&, const MotorCommand&) = default;
};

/// What a board latched.
struct BoardReading {
    std::array<std::uint32_t, kStrings> counters{};  // modulo 2^counter_bits(kind), in the host's sense of direction
    std::array<std::uint16_t, kStrings> analog{};    // A/D, 12 bits; 0 on boards that have none
    std::uint32_t buttons = 0;                       // bit k: switch k is held
    std::uint8_t rotary = 0;                         // rotary id switch, 0..15

    friend bool operator==(const BoardReading&, const BoardReading&) = default;
};

/// A board could not be started: what is wrong, and what to do about it.
class BoardError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

class Board {
  public:
    virtual ~Board() = default;

    /// Makes the board ready for exchange(): throws away answers to an earlier session, sends start-up packets, looks
    /// for what hangs on the line. Once before the loop, and again after the device was plugged in anew; may allocate
    /// and wait. The encoders' reference may be another one afterwards. Throws BoardError where the board does not take
    /// part, and what the transport's drain() throws.
    virtual void start() {}

    /// Sets the motors, latches the encoders, waits for the answer; bounded. `reading` is written only on Ok. now_ns is
    /// the caller's time: an emulated device moves by it; a real one ignores it.
    virtual ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT = 0;

    /// Zero to all motors by the shortest way there is, without waiting for an answer: for crash handlers and
    /// watchdogs, from any thread, while another may be within exchange().
    virtual void zero_motors(std::int64_t now_ns) HAPTIC_RT = 0;
};

}  // namespace haptic::device
