// Host driver of the Cyverse "USB2.0 SH4" board (0CEC:0205).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "codecs/sh4_codec.hpp"
#include "haptic/device/board.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

/// The board counts with the opposite sign: counters are negated modulo 65536.
///
/// With check_echo, a reply that echoes the DAC codes of one of the last commands but not of this one is Stale. The
/// exchange then fetches one more reply: a host that is one packet behind catches up immediately, a host that is n
/// packets behind within n exchanges. An exchange takes at most twice the transport's time limit. A lag is invisible
/// while the DAC codes do not change; the counters are then those of the previous exchange.
///
/// Without check_echo nothing in a reply identifies its command. After a reply that missed its time limit, the next
/// exchange therefore first waits for the overdue reply.
class Sh4Board final : public Board {
  public:
    /// The transport must outlive the board.
    explicit Sh4Board(Transport& transport, bool check_echo = true) : transport_(&transport), check_echo_(check_echo) {}

    /// Discards replies to an earlier session. The board has no start-up packets and keeps its counters.
    void start() override;
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    ExchangeStatus send(const MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return answer_due_; }
    ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] ZeroPacket zero_packet() const override;

  private:
    using DacCodes = std::array<std::uint16_t, kStrings>;
    /// Encodes the command into out_ and notes its DAC codes, as the last ones that were sent.
    const DacCodes& prepare(const MotorCommand& command) HAPTIC_RT;
    /// Sends `out` unless it is empty, then receives one reply.
    ExchangeStatus fetch(std::span<const std::byte> out, Sh4Reply& reply, std::int64_t now_ns) HAPTIC_RT;
    /// Checks the echo of a reply that fetch() received with this status. If it is that of an earlier command, fetches
    /// one more.
    ExchangeStatus check(ExchangeStatus status, const DacCodes& sent, Sh4Reply& reply, std::int64_t now_ns) HAPTIC_RT;
    /// Whether one of the last commands had these DAC codes.
    [[nodiscard]] bool sent_recently(const DacCodes& dac_codes) const HAPTIC_RT;

    static constexpr std::size_t kHistory = 5;  // packets that an endpoint can queue, and the last one

    Transport* transport_;
    bool check_echo_;
    bool reply_overdue_ = false;  // the last reply missed its time limit
    bool answer_due_ = false;     // the reply to the last send() is to be collected
    std::array<DacCodes, kHistory> sent_{};
    std::size_t next_ = 0;  // index in sent_ of the next command
    DacCodes due_{};        // of the last send()
    Sh4Packet out_{};
    Sh4Packet in_{};
};

}  // namespace haptic::device
