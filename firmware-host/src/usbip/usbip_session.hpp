// USB/IP session: one client of the server, without its socket: bytes in, bytes out.
//
// A client either requests the device list, after which the session ends, or imports the device, which then belongs to
// it: its transfers are those of ServedUsbDevice.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "emulated/firmware.hpp"
#include "served/message_stream.hpp"
#include "served/served_usb_device.hpp"
#include "usbip/usbip_protocol.hpp"

namespace haptic::device {

class UsbipSession;

/// The exported device: shared by all sessions, owned by at most one.
class UsbipExport {
  public:
    /// The firmware must outlive its export. Throws std::invalid_argument for a board without USB.
    UsbipExport(BoardKind kind, Firmware& firmware, UsbSpeed speed = UsbSpeed::High);

    /// Whether the device is connected; otherwise clients see an empty list.
    bool plugged = true;

    [[nodiscard]] const usbip::DeviceRecord& record() const noexcept { return record_; }
    [[nodiscard]] const UsbipSession* owner() const noexcept { return owner_; }

  private:
    friend class UsbipSession;
    ServedUsbDevice device_;
    usbip::DeviceRecord record_;
    const UsbipSession* owner_ = nullptr;
};

class UsbipSession {
  public:
    /// Limit of pending IN transfers; one more ends the session.
    static constexpr std::size_t kMaxPending = ServedUsbDevice::kMaxPending;

    /// The export must outlive its sessions.
    explicit UsbipSession(UsbipExport& exported) : exported_(&exported) {}
    UsbipSession(const UsbipSession&) = delete;
    UsbipSession& operator=(const UsbipSession&) = delete;
    /// Releases the device.
    ~UsbipSession();

    /// Takes bytes from the client, in pieces of any size, and appends the replies to output().
    void receive(std::span<const std::byte> bytes, std::int64_t now_ns);
    /// The connection is lost: discards the output and ends the session.
    void drop(std::string reason);
    /// Completes pending IN transfers with the firmware's replies.
    void complete_pending(std::int64_t now_ns);

    /// Bytes to send to the client. The sender removes what it has sent.
    [[nodiscard]] std::vector<std::byte>& output() noexcept { return output_; }

    [[nodiscard]] bool owns_device() const noexcept { return exported_->owner_ == this; }
    [[nodiscard]] bool waits_for_firmware() const noexcept {
        return owns_device() && exported_->device_.waits_for_firmware();
    }
    /// The session reads no more input. Close the connection once the output is sent.
    [[nodiscard]] bool ended() const noexcept { return ended_; }
    /// Why it ended; empty if the client's request was fulfilled.
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

  private:
    /// Handles the first message of the bytes. Returns its length, or 0 if it is incomplete.
    std::size_t handle(std::span<const std::byte> bytes, std::int64_t now_ns);
    std::size_t handle_operation(std::span<const std::byte> bytes);
    std::size_t handle_urb(std::span<const std::byte> bytes, std::int64_t now_ns);
    void import(const std::string& bus_id);
    void submit_control(const usbip::Submit& submit, std::int64_t now_ns);
    void submit_out(const usbip::Submit& submit, std::span<const std::byte> data, std::int64_t now_ns);
    void submit_in(const usbip::Submit& submit, std::int64_t now_ns);
    void unlink(const usbip::Unlink& unlink);
    void release_device();
    void end(std::string reason);

    UsbipExport* exported_;
    MessageStream input_;
    std::vector<std::byte> output_;
    std::string reason_;
    bool ended_ = false;
};

}  // namespace haptic::device
