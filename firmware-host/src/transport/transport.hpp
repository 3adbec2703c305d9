// How packets reach a board: bytes out, bytes in, in bounded time. What they mean is a codec's business.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include <haptic/device/board.hpp>
#include <haptic/realtime.hpp>

namespace haptic::device {

/// One cycle of a board: up to two packets out, then at most one in.
struct PacketExchange {
    std::array<std::span<const std::byte>, 2> out;  // an empty span is not sent
    std::span<std::byte> in;                        // room for the answer; empty if none is awaited
    std::size_t received = 0;                       // bytes of the answer
};

class Transport {
  public:
    virtual ~Transport() = default;

    /// Sends what is to be sent and waits for the answer, no longer than the bound that the transport was made with;
    /// with nothing to send it only waits, for an answer that is overdue. A shorter answer than there is room for is
    /// Ok; its length is a codec's business.
    virtual ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Sends one packet by the shortest way there is and waits for nothing; see Board::zero_motors.
    virtual void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Throws away what waits to be received: an answer to a command of an earlier session. Before the loop starts.
    virtual void drain() = 0;
};

}  // namespace haptic::device
