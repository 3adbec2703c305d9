// Board: the tick's view of the electronics. One bounded exchange sends DAC codes and returns encoder counters.
// A tick makes two: exchange() for the encoders, and send() for the motors, whose answer the next tick collects.
//
//     Tick -> Board (Sh4Board, ...: codec and sequence) -> Transport (usbfs, serial line, or in process) -> device
#pragma once

#include <array>
#include <cstdint>

#include "haptic/device/exchange_status.hpp"
#include "haptic/device/zero_packet.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// Output of one tick to the motors.
struct MotorCommand {
    std::array<std::int16_t, kStrings> dac_codes{};  // dac_codes.hpp; boards with an unsigned DAC clamp to 0..4095

    friend bool operator==(const MotorCommand&, const MotorCommand&) = default;
};

/// Inputs that a board latched together.
struct BoardReading {
    std::array<std::uint32_t, kStrings> counters{};  // modulo 2^counter_bits(kind), with the host's sign
    std::array<std::uint16_t, kStrings> analog{};    // A/D, 12 bits; 0 on boards without A/D
    std::uint32_t buttons = 0;                       // bit k: switch k is pressed
    std::uint8_t rotary = 0;                         // rotary id switch, 0..15

    friend bool operator==(const BoardReading&, const BoardReading&) = default;
};

class Board {
  public:
    virtual ~Board() = default;

    /// Prepares the board for exchange(): discards replies to an earlier session, sends start-up packets, detects the
    /// boards on a serial line. Call once before the loop, and again after the device was reconnected. May allocate and
    /// block. The encoders' zero may differ afterwards. Throws BoardError if the board does not respond, and what the
    /// transport's drain() throws.
    virtual void start() {}

    /// Sets the motors, latches the encoders and waits for the reply; bounded. Writes `reading` only on Ok. `now_ns` is
    /// the caller's time: it drives an emulated device and is ignored by a real one.
    virtual ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT = 0;

    /// Sets the motors as exchange() does, for a caller that does not use the reading. A board that can does not wait
    /// for the reply: then answer_due() is true, and collect() must be called before the next call. Others wait, as
    /// exchange() does. Timeout without sending, if the reply could not be told from one that is overdue.
    virtual ExchangeStatus send(const MotorCommand& command, std::int64_t now_ns) HAPTIC_RT {
        BoardReading unused;
        return exchange(command, unused, now_ns);
    }
    /// The reply to the last send() has not been collected.
    [[nodiscard]] virtual bool answer_due() const HAPTIC_RT { return false; }
    /// Receives the reply to the last send() and checks it as exchange() does: says whether the board took the command.
    /// Waits for it only if it has not arrived; bounded as exchange(). Ok if none is due.
    virtual ExchangeStatus collect(std::int64_t /*now_ns*/) HAPTIC_RT { return ExchangeStatus::Ok; }

    /// Sends zero to all motors by the shortest path, without waiting for a reply. For crash handlers and watchdogs:
    /// may be called from any thread, even while another is inside exchange().
    virtual void zero_motors(std::int64_t now_ns) HAPTIC_RT = 0;

    /// What another process needs to do the same; after start(). Without a link if the board is in this process.
    [[nodiscard]] virtual ZeroPacket zero_packet() const { return {}; }
};

}  // namespace haptic::device
