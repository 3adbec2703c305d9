// Factory of the board drivers.
#pragma once

#include <memory>

#include "haptic/device/board.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/device_geometry.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

/// Makes the driver of a kind of board. The transport must outlive it.
[[nodiscard]] std::unique_ptr<Board> make_board(BoardKind kind, Transport& transport, const BoardOptions& options = {});

}  // namespace haptic::device
