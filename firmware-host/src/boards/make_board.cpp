#include "boards/make_board.hpp"

#include <stdexcept>

#include "boards/sh4_board.hpp"
#include "boards/simple_board.hpp"
#include "boards/uart_board.hpp"

namespace haptic::device {

std::unique_ptr<Board> make_board(BoardKind kind, Transport& transport, const BoardOptions& options) {
    switch (kind) {
        case BoardKind::Sh4:
            return std::make_unique<Sh4Board>(transport, options.check_echo);
        case BoardKind::Simple:
            return std::make_unique<SimpleBoard>(transport, options.simple_phase);
        case BoardKind::Uart:
            return std::make_unique<UartBoard>(transport, options.uart);
    }
    throw std::invalid_argument("no driver for this kind of board");
}

}  // namespace haptic::device
