// Exchange packets: how many bytes an exchange with a board moves, for the budget of a period.
#pragma once

#include <array>
#include <cstddef>

#include "haptic/device/board_options.hpp"
#include "haptic/device/device_geometry.hpp"

namespace haptic::device {

struct ExchangePackets {
    std::array<std::size_t, 2> out{};  // bytes of each packet to the board; 0: no such packet
    std::size_t in = 0;                // bytes of the answer

    [[nodiscard]] std::size_t out_bytes() const noexcept { return out[0] + out[1]; }

    friend bool operator==(const ExchangePackets&, const ExchangePackets&) = default;
};

/// Packets of a kind of board. Those of the serial boards depend on which are on the line, which only
/// TtyBoard::packets() knows: here two boards of four motors, the longest cycle.
[[nodiscard]] ExchangePackets exchange_packets(BoardKind kind, const BoardOptions& options) noexcept;

}  // namespace haptic::device
