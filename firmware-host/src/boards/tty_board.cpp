#include "haptic/device/tty_board.hpp"

#include "boards/uart_board.hpp"
#include "transport/serial_transport.hpp"

namespace haptic::device {

TtyBoard::TtyBoard(const std::filesystem::path& path, const Settings& settings, const UartOptions& options)
    : transport_(std::make_unique<SerialTransport>(
          path, SerialTransport::Settings{.timeout_ns = settings.timeout_ns, .baud = settings.baud})),
      board_(std::make_unique<UartBoard>(*transport_, options)) {}

TtyBoard::~TtyBoard() = default;

void TtyBoard::start() {
    board_->start();
}

ExchangeStatus TtyBoard::exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    return board_->exchange(command, reading, now_ns);
}

void TtyBoard::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    board_->zero_motors(now_ns);
}

ZeroPacket TtyBoard::zero_packet() const {
    return board_->zero_packet();
}

void TtyBoard::reopen() {
    transport_->reopen();
    board_->start();
}

const std::filesystem::path& TtyBoard::path() const noexcept {
    return transport_->path();
}

std::string TtyBoard::found() const {
    return board_->found();
}

ExchangePackets TtyBoard::packets() const noexcept {
    return board_->packets();
}

}  // namespace haptic::device
