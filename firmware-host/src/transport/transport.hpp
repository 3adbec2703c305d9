// Transport: carries packets to a board and back in bounded time. Codecs interpret the bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic/device/exchange_status.hpp"
#include "haptic/device/zero_packet.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// One cycle of a board: up to two packets out, then at most one in.
struct PacketExchange {
    std::array<std::span<const std::byte>, 2> out;  // empty spans are not sent
    std::span<std::byte> in;                        // buffer for the reply; empty if none is expected
    std::size_t received = 0;                       // bytes of the reply
    bool reply_later =
        false;  // another exchange, without packets to send, receives the reply: do not wait; `in` is empty
};

class Transport {
  public:
    virtual ~Transport() = default;

    /// Sends the packets and waits for the reply, at most for the transport's time limit. Without packets to send it
    /// only waits, for a reply that is overdue or was left for later. A reply shorter than the buffer is Ok; the codec
    /// checks its length.
    virtual ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Sends one packet by the shortest path and does not wait for a reply; see Board::zero_motors.
    virtual void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Discards replies to commands of an earlier session. Call before the loop starts.
    virtual void drain() = 0;

    /// The open device, for another process that shares it; without a descriptor if there is none.
    [[nodiscard]] virtual DeviceLink link() const { return {}; }
};

}  // namespace haptic::device
