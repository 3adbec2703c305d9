#include "haptic/device/exchange_packets.hpp"

#include <gtest/gtest.h>

namespace haptic::device {
namespace {

TEST(ExchangePackets, AreThoseOfTheBoardsDocumentation) {
    EXPECT_EQ(exchange_packets(BoardKind::Sh4, {}), (ExchangePackets{{512, 0}, 512}));
    EXPECT_EQ(exchange_packets(BoardKind::Simple, {}), (ExchangePackets{{32, 32}, 32}));
    EXPECT_EQ(exchange_packets(BoardKind::Uart, {}), (ExchangePackets{{74, 0}, 34}));
    // At least five zeros follow a command.
    BoardOptions eager;
    eager.uart.padding = 0;
    EXPECT_EQ(exchange_packets(BoardKind::Uart, eager), (ExchangePackets{{2 * (9 + 8), 0}, 34}));
}

}  // namespace
}  // namespace haptic::device
