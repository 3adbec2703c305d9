// A board whose cable a test can unplug.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "emulated/firmware.hpp"
#include "emulated/make_firmware.hpp"

namespace haptic::device {

/// An SH4 board.
class CabledFirmware final : public Firmware {
  public:
    explicit CabledFirmware(EmulatedDevice& device) : board_(make_firmware(BoardKind::Sh4, device)) {}

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override {
        board_->receive(out, now_ns);
    }
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override {
        return board_->reply(in, now_ns);
    }
    [[nodiscard]] bool connected(std::int64_t /*now_ns*/) const HAPTIC_RT override { return plugged; }

    bool plugged = true;

  private:
    std::unique_ptr<Firmware> board_;
};

}  // namespace haptic::device
