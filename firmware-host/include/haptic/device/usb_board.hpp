// A Spidar's board on USB: found, opened and answering.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "haptic/device/board.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/usb_discovery.hpp"
#include "transport/usb_transport.hpp"
#include "haptic/device/variant.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

class UsbBoard final : public Board {
  public:
    /// Finds the one device that is meant, and makes one exchange with it that sets all motors to zero. Where several
    /// fit, each is opened and asked like that for its rotary switch. Throws UsbError that lists what there is: none or
    /// several, not allowed, driven by another program, no answer; BoardError as make_board() and start() do.
    UsbBoard(BoardKind kind, const UsbSelection& selection, const UsbTransport::Settings& settings,
             const BoardOptions& options = {});

    void start() override { board_->start(); }

    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading,
                            std::int64_t now_ns) HAPTIC_RT override {
        return board_->exchange(command, reading, now_ns);
    }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

    /// The same as the constructor does, after the device was lost: for the device with the same selection. Not while
    /// another thread is within an exchange. Throws UsbError as long as it is not there; the board is then
    /// Disconnected.
    void reopen();
    /// The kernel has no such device any more.
    [[nodiscard]] bool gone() const noexcept { return transport_.gone(); }
    [[nodiscard]] const UsbDevice& device() const noexcept { return device_; }

  private:
    /// The position of its rotary switch.
    std::uint8_t open(const UsbDevice& device);
    std::uint8_t first_exchange();

    UsbSelection selection_;
    UsbTransport transport_;
    std::unique_ptr<Board> board_;
    UsbDevice device_;
};

}  // namespace haptic::device
