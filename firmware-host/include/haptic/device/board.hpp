// What the tick sees of a board: one bounded exchange of packets.
#pragma once

#include <cstdint>

#include "haptic/device/sh4_codec.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

enum class ExchangeStatus : std::uint8_t { Ok, Timeout, Short, Disconnected, Refused };

/// A board that answers each OUT packet with one IN packet.
class Board {
  public:
    virtual ~Board() = default;

    /// Sends `out`, waits for the answer, bounded. `in` is written only on Ok. now_ns is the caller's time: the
    /// emulated board moves its hand by it; a real one ignores it.
    virtual ExchangeStatus exchange(const Sh4Packet& out, Sh4Packet& in, std::int64_t now_ns) HAPTIC_RT = 0;
};

}  // namespace haptic::device
