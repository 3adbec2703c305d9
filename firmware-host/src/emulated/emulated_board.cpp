#include "haptic/device/emulated_board.hpp"

#include <utility>

#include "boards/make_board.hpp"
#include "emulated/emulated_transport.hpp"
#include "emulated/make_firmware.hpp"

namespace haptic::device {

EmulatedBoard::EmulatedBoard(Settings settings, const BoardOptions& options)
    : device_(std::move(settings)),
      firmware_(make_firmware(device_.geometry().board, device_)),
      transport_(std::make_unique<EmulatedTransport>(*firmware_)),
      board_(make_board(device_.geometry().board, *transport_, options)) {
    board_->start();
}

EmulatedBoard::~EmulatedBoard() = default;

}  // namespace haptic::device
