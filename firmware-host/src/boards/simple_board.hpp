// Host driver of the Cyverse "USB2.0 Simple" board (0CEC:0203).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "codecs/simple_codec.hpp"
#include "haptic/device/board.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

/// An exchange is three transfers: DAC codes, latch command, reply. Nothing in a reply identifies its command. After a
/// reply that missed its time limit, the next exchange therefore first waits for the overdue reply; an exchange takes
/// at most twice the transport's time limit.
class SimpleBoard final : public Board {
  public:
    /// The transport must outlive the board. `phase`: bit i is the counting direction of encoder i. Which value counts
    /// with a geometry's sign is not known for certain; published drivers send 0xFF.
    explicit SimpleBoard(Transport& transport, std::uint8_t phase = 0xFF) : transport_(&transport), phase_(phase) {}

    /// Sets the counting directions, then clears the counters.
    void start() override;
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    ExchangeStatus send(const MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return answer_due_; }
    ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] ZeroPacket zero_packet() const override;

  private:
    /// Encodes the two packets of a command.
    void prepare(const MotorCommand& command) HAPTIC_RT;
    /// Receives and decodes a reply; with packets in `out`, sends those first.
    ExchangeStatus fetch(const std::array<std::span<const std::byte>, 2>& out, SimpleReply& reply,
                         std::int64_t now_ns) HAPTIC_RT;

    Transport* transport_;
    std::uint8_t phase_;
    bool reply_overdue_ = false;  // the last reply missed its time limit
    bool answer_due_ = false;     // the reply to the last send() is to be collected
    SimplePacket dac_codes_{};
    SimplePacket latch_{};
    SimplePacket in_{};
};

}  // namespace haptic::device
