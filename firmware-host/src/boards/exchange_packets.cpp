#include "haptic/device/exchange_packets.hpp"

#include "boards/uart_board.hpp"
#include "codecs/sh4_codec.hpp"
#include "codecs/simple_codec.hpp"

namespace haptic::device {

ExchangePackets exchange_packets(BoardKind kind, const BoardOptions& options) noexcept {
    switch (kind) {
        case BoardKind::Sh4:
            return {{kSh4PacketBytes, 0}, kSh4PacketBytes};
        case BoardKind::Simple:
            // DAC codes, then the request to latch.
            return {{kSimplePacketBytes, kSimplePacketBytes}, kSimplePacketBytes};
        case BoardKind::Uart:
            break;
    }
    constexpr std::size_t boards = 2;
    const std::size_t command = uart_current_command_bytes(kUartB3M);
    const std::size_t reply = uart_current_reply_bytes(kUartB3M);
    return {{boards * (command + uart_zeros(options.uart, command, reply)), 0}, boards * reply};
}

}  // namespace haptic::device
