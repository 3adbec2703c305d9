// The SH4 board's firmware hosted on Linux, with the Spidar-G6 and a hand behind it, in this process.
//
// An exchange decodes the OUT packet as the board does, sets the D/A digits, moves the hand to its pose of that time,
// turns string lengths into quantised, wrapping 16-bit counters and queues the IN packet. What the motors then pull is
// there to be measured: tensions(), and the wrench that they make on the grip.
#pragma once

#include <array>
#include <cstdint>

#include "haptic/device/board.hpp"
#include "haptic/device/variant.hpp"
#include "haptic/pose_track.hpp"

namespace haptic::device {

class EmulatedBoard final : public Board {
  public:
    struct Settings {
        Variant variant;
        PoseTrack hand;                                  // pose of the grip over time since the first exchange
        std::array<std::uint16_t, kStrings> power_up{};  // raw counters at the centre: arbitrary on the real board
        std::uint8_t rotary = 0;                         // rotary switch, 0..15
    };

    explicit EmulatedBoard(Settings settings);

    ExchangeStatus exchange(const Sh4Packet& out, Sh4Packet& in, std::int64_t now_ns) HAPTIC_RT override;

    /// Where the hand holds the grip since the last exchange.
    [[nodiscard]] Pose grip_pose() const HAPTIC_RT { return grip_; }
    /// N, what the motors pull since the last exchange.
    [[nodiscard]] std::array<double, kStrings> tensions() const HAPTIC_RT;
    /// Force and torque of all strings on the grip, from the present pose and tensions.
    [[nodiscard]] Wrench wrench() const HAPTIC_RT;
    /// External switches, bits 0-2.
    void set_buttons(std::uint8_t buttons) HAPTIC_RT { buttons_ = buttons; }

  private:
    Settings settings_;
    Pose grip_;
    Sh4Command command_;
    std::int64_t start_ns_ = 0;
    std::uint8_t buttons_ = 0;
    bool started_ = false;
};

}  // namespace haptic::device
