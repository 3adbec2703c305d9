// usbredir session: one guest of the server, without its socket: bytes in, bytes out.
//
// After both hellos the device is connected, disconnected when its cable is unplugged, and connected again when it is
// plugged in and the guest has acknowledged that it was gone. Requests that were on their way meanwhile are answered
// with an error.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "served/message_stream.hpp"
#include "served/served_usb_device.hpp"
#include "usbredir/usbredir_protocol.hpp"

namespace haptic::device {

class UsbredirSession {
  public:
    /// The device must outlive its session, and belongs to it alone.
    UsbredirSession(ServedUsbDevice& device, bool plugged);
    UsbredirSession(const UsbredirSession&) = delete;
    UsbredirSession& operator=(const UsbredirSession&) = delete;
    /// Discards what is pending.
    ~UsbredirSession() { device_->reconnect(); }

    /// Takes bytes from the guest, in pieces of any size, and appends the answers to output().
    void receive(std::span<const std::byte> bytes, std::int64_t now_ns);
    /// The cable is plugged in or unplugged.
    void set_plugged(bool plugged);
    /// Completes pending IN transfers with the firmware's replies.
    void complete_pending(std::int64_t now_ns);

    /// Bytes to send to the guest. The sender removes what it has sent.
    [[nodiscard]] std::vector<std::byte>& output() noexcept { return output_; }

    /// The guest has the device.
    [[nodiscard]] bool connected() const noexcept { return link_ == Link::Connected; }
    [[nodiscard]] bool waits_for_firmware() const noexcept { return device_->waits_for_firmware(); }
    /// The guest broke the protocol, and no more input is read. Close the connection.
    [[nodiscard]] bool ended() const noexcept { return !reason_.empty(); }
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

  private:
    /// What the guest knows about the device.
    enum class Link : std::uint8_t {
        Greeting,      // its hello is awaited
        Absent,        // no device
        Connected,     // it has the device
        Disconnecting  // it was told that the device is gone, and has not acknowledged it
    };

    /// Result of a control transfer.
    struct Answer {
        usbredir::Status status = usbredir::Status::IoError;
        std::vector<std::byte> data{};
    };

    /// Handles the first message of the bytes. Returns its length, or 0 if it is incomplete.
    std::size_t handle(std::span<const std::byte> bytes, std::int64_t now_ns);
    void end(std::string reason);
    /// Connects the device if its cable is plugged in and the guest is ready for it.
    void connect_if_possible();
    /// Performs a control transfer; an IO error without a connection.
    Answer control(const SetupPacket& setup);

    // Each function answers one kind of message. `data` is that of an OUT transfer.
    using Data = std::span<const std::byte>;
    void answer(const usbredir::Hello& hello, Data data, std::int64_t now_ns);
    void answer(const usbredir::Reset& reset, Data data, std::int64_t now_ns);
    void answer(const usbredir::SetConfiguration& request, Data data, std::int64_t now_ns);
    void answer(const usbredir::GetConfiguration& request, Data data, std::int64_t now_ns);
    void answer(const usbredir::SetAltSetting& request, Data data, std::int64_t now_ns);
    void answer(const usbredir::GetAltSetting& request, Data data, std::int64_t now_ns);
    void answer(const usbredir::Cancel& cancel, Data data, std::int64_t now_ns);
    void answer(const usbredir::DisconnectAck& ack, Data data, std::int64_t now_ns);
    void answer(const usbredir::Control& request, Data data, std::int64_t now_ns);
    void answer(const usbredir::Bulk& request, Data data, std::int64_t now_ns);

    ServedUsbDevice* device_;
    MessageStream input_;
    std::vector<std::byte> output_;
    std::string reason_;
    Link link_ = Link::Greeting;
    bool plugged_;
};

}  // namespace haptic::device
