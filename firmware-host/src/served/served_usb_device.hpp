// The served board as a USB device, whatever protocol carries its transfers: control transfers go to the device model,
// bulk transfers to the firmware. A protocol's session translates its messages into these calls and nothing else.
//
// The firmware takes and gives pieces of at most 512 bytes, which is one packet at high speed and eight at full speed.
// An IN transfer is pending until the firmware's replies fill it, or one ends with a packet that is shorter than the
// endpoint's; until then the client may cancel it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <vector>

#include "emulated/firmware.hpp"
#include "served/usb_device_model.hpp"

namespace haptic::device {

/// Longest piece that a firmware takes or gives at once.
inline constexpr std::size_t kPieceBytes = 512;

/// Interval at which a server asks a firmware with pending transfers for its replies.
inline constexpr std::int64_t kUsbPollNs = 250'000;

/// How a transfer ended.
enum class TransferStatus : std::uint8_t {
    Ok,
    Stalled,    // the endpoint is halted, not configured, or does not know the request
    Babble,     // the device sent more than requested
    Short,      // fewer bytes than requested, which the client declared an error
    Cancelled,  // by a reset of the bus
};

/// An IN transfer of a client.
struct InTransfer {
    std::uint64_t id = 0;                                                    // the client's name for it, to cancel it
    std::size_t length = 0;                                                  // bytes requested
    bool short_is_error = false;                                             // fewer bytes are the status Short
    std::function<void(TransferStatus, std::span<const std::byte>)> done{};  // called once, unless it is cancelled
};

class ServedUsbDevice {
  public:
    /// Limit of pending IN transfers.
    static constexpr std::size_t kMaxPending = 256;

    /// The firmware must outlive the device. Throws std::invalid_argument for a board without USB.
    ServedUsbDevice(BoardKind kind, Firmware& firmware, UsbSpeed speed);

    /// Returns to the state of a newly connected device. Discards pending transfers without completing them.
    void reconnect();
    /// A reset of the bus: as reconnect(), but completes pending transfers with Cancelled. It does not reach the
    /// firmware.
    void reset_bus();

    /// Performs a control transfer. Afterwards call complete_pending(): the request may have halted the IN endpoint.
    [[nodiscard]] UsbDeviceModel::ControlResult control(const SetupPacket& setup) { return model_.control(setup); }

    /// Performs a bulk OUT transfer; `ends_empty` adds an empty packet to one of whole pieces. Afterwards call
    /// complete_pending(): on the bus, the transfer completes before the replies that it causes.
    TransferStatus send(std::uint8_t endpoint, std::span<const std::byte> data, bool ends_empty, std::int64_t now_ns);
    /// Starts a bulk IN transfer, which may complete at once. Returns false, and does nothing, if kMaxPending are
    /// pending already.
    [[nodiscard]] bool receive(std::uint8_t endpoint, InTransfer transfer, std::int64_t now_ns);
    /// Cancels a pending transfer, whose `done` is then not called. Returns false if none has this id.
    bool cancel(std::uint64_t id);

    /// Completes pending transfers: with the firmware's replies, or as stalled if the endpoint is no longer usable.
    void complete_pending(std::int64_t now_ns);
    [[nodiscard]] bool waits_for_firmware() const noexcept { return !pending_.empty(); }

    /// Whether the cable is plugged in.
    [[nodiscard]] bool plugged(std::int64_t now_ns) const { return firmware_->connected(now_ns); }
    [[nodiscard]] const UsbDeviceModel& model() const noexcept { return model_; }

  private:
    struct Pending {
        InTransfer transfer;
        std::vector<std::byte> data{};
    };

    /// Adds one piece to the oldest pending transfer. Returns true if this completed the transfer.
    bool add_piece(std::span<const std::byte> piece);
    void end_pending(TransferStatus status);

    Firmware* firmware_;
    UsbDeviceModel model_;
    std::deque<Pending> pending_;
};

}  // namespace haptic::device
