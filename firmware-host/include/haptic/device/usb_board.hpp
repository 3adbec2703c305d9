// A board on USB: found, opened and responding.
#pragma once

#include <cstdint>
#include <memory>

#include "haptic/device/board.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/device_geometry.hpp"
#include "haptic/device/usb_discovery.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

class UsbTransport;

class UsbBoard final : public Board {
  public:
    /// Finds the one device that matches the selection and makes one exchange with it that sets all motors to zero. If
    /// several devices match, each is opened and asked for its rotary switch in the same way. `timeout_ns` limits an
    /// exchange. Throws BoardError that lists the devices: none or several match, no permission, in use by another
    /// program, no reply.
    UsbBoard(BoardKind kind, const UsbSelection& selection, std::int64_t timeout_ns, const BoardOptions& options = {});
    ~UsbBoard() override;

    void start() override { board_->start(); }

    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading,
                            std::int64_t now_ns) HAPTIC_RT override {
        return board_->exchange(command, reading, now_ns);
    }
    ExchangeStatus send(const MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override {
        return board_->send(command, now_ns);
    }
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return board_->answer_due(); }
    ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override { return board_->collect(now_ns); }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }
    [[nodiscard]] ZeroPacket zero_packet() const override { return board_->zero_packet(); }

    /// Repeats the constructor's search after the device was lost. Must not run while another thread is inside an
    /// exchange. Throws BoardError until the device is back; exchanges return Disconnected meanwhile.
    void reopen();
    /// The kernel no longer has the device.
    [[nodiscard]] bool gone() const noexcept;
    [[nodiscard]] const UsbDevice& device() const noexcept { return device_; }

  private:
    /// Opens a device and makes the first exchange; returns the position of its rotary switch.
    std::uint8_t open(const UsbDevice& device);
    std::uint8_t first_exchange();

    UsbSelection selection_;
    std::unique_ptr<UsbTransport> transport_;
    std::unique_ptr<Board> board_;
    UsbDevice device_;
};

}  // namespace haptic::device
