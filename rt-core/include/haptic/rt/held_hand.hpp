// An emulated hand that waits at the centre until the loop runs, as a person does.
#pragma once

#include <cstdint>
#include <filesystem>

#include "haptic/device/board.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/realtime.hpp"
#include "haptic/rt/tick.hpp"

namespace haptic::rt {

/// Stands between a tick and an emulated board, and lets the board's time, and with it its hand, stand still until the
/// tick has been running once. Calibration then always finds the hand where its track begins.
class HeldHandBoard final : public device::Board {
  public:
    explicit HeldHandBoard(device::Board& board) : board_(&board) {}
    /// The tick whose state releases the hand; the same thread runs both.
    void follow(const Tick& tick) noexcept { tick_ = &tick; }

    device::ExchangeStatus exchange(const device::Sh4Packet& out, device::Sh4Packet& in,
                                    std::int64_t now_ns) HAPTIC_RT override;

  private:
    device::Board* board_;
    const Tick* tick_ = nullptr;
    std::int64_t held_ns_ = 0;  // time that the board has not seen
    std::int64_t last_ns_ = 0;
    bool started_ = false;
    bool released_ = false;
};

/// The track of a recording, which may begin anywhere: the hand starts at the centre and moves to the first pose in
/// half a second. A recording that begins at the centre is taken as it is. Throws CsvError.
[[nodiscard]] PoseTrack hand_from_centre(const std::filesystem::path& file);

}  // namespace haptic::rt
