// One client of the USB/IP server, without its socket: bytes in, bytes out.
//
// Until the client imports the device it may ask for the list and is then done with; from the import on the device is
// its own. An OUT transfer is cut into packets of 512 bytes, each given to the firmware. An IN transfer waits until the
// firmware has answers to fill it, or one that is shorter than a packet; it can be taken back before that.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "emulated/firmware.hpp"
#include "usbip/usb_device_model.hpp"
#include "usbip/usbip_protocol.hpp"

namespace haptic::device {

class UsbipSession;

/// The device that all sessions share and one of them may own.
class UsbipExport {
  public:
    /// The firmware must outlive its export. Throws std::invalid_argument for a board without a USB plug.
    UsbipExport(BoardKind kind, Firmware& firmware);

    /// Whether the device is there; without it clients see an empty list.
    bool plugged = true;

    [[nodiscard]] const usbip::DeviceRecord& record() const noexcept { return record_; }
    [[nodiscard]] const UsbipSession* owner() const noexcept { return owner_; }

  private:
    friend class UsbipSession;
    Firmware* firmware_;
    UsbDeviceModel model_;
    usbip::DeviceRecord record_;
    const UsbipSession* owner_ = nullptr;
};

class UsbipSession {
  public:
    /// IN transfers that may wait; more end the session.
    static constexpr std::size_t kMostWaiting = 256;

    /// The export must outlive its sessions.
    explicit UsbipSession(UsbipExport& exported) : exported_(&exported) {}
    UsbipSession(const UsbipSession&) = delete;
    UsbipSession& operator=(const UsbipSession&) = delete;
    /// Gives the device back.
    ~UsbipSession();

    /// Takes what the client sent, in pieces of any size, and answers as far as it can.
    void receive(std::span<const std::byte> bytes, std::int64_t now_ns);
    /// The connection is lost: what was not sent yet is thrown away.
    void drop(std::string reason);
    /// Fills IN transfers that wait, if the firmware has answers meanwhile.
    void fill(std::int64_t now_ns);

    /// What is to be sent to the client. Whoever sends it takes it from here.
    [[nodiscard]] std::vector<std::byte>& output() noexcept { return output_; }

    [[nodiscard]] bool owns_device() const noexcept { return exported_->owner_ == this; }
    [[nodiscard]] bool waits_for_firmware() const noexcept { return !waiting_.empty(); }
    /// Nothing more is read; once the output is sent the connection is to be closed.
    [[nodiscard]] bool ended() const noexcept { return ended_; }
    /// Why it ended: empty if the client got all that it asked for.
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

  private:
    struct Waiting {
        usbip::Submit submit;
        std::vector<std::byte> data;
    };

    /// Handles the message at the beginning of the bytes: how many it has, 0 if it is not complete yet.
    std::size_t handle(std::span<const std::byte> bytes, std::int64_t now_ns);
    std::size_t handle_operation(std::span<const std::byte> bytes);
    std::size_t handle_urb(std::span<const std::byte> bytes, std::int64_t now_ns);
    void import(const std::string& bus_id);
    void submit_control(const usbip::Submit& submit);
    void submit_out(const usbip::Submit& submit, std::span<const std::byte> data, std::int64_t now_ns);
    void submit_in(const usbip::Submit& submit, std::int64_t now_ns);
    void unlink(const usbip::Unlink& unlink);
    /// Adds one packet to the oldest transfer that waits; true if that is then answered.
    bool add_packet(std::span<const std::byte> packet);
    void fail_waiting(std::int32_t status);
    void end(std::string reason);

    UsbipExport* exported_;
    std::vector<std::byte> input_;  // an incomplete message
    std::vector<std::byte> output_;
    std::deque<Waiting> waiting_;
    std::string reason_;
    bool ended_ = false;
};

}  // namespace haptic::device
