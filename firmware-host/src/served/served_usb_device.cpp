#include "served/served_usb_device.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace haptic::device {

ServedUsbDevice::ServedUsbDevice(BoardKind kind, Firmware& firmware, UsbSpeed speed)
    : firmware_(&firmware), model_(usb_identity(kind), speed) {}

void ServedUsbDevice::reconnect() {
    pending_.clear();
    model_.reset();
}

void ServedUsbDevice::reset_bus() {
    end_pending(TransferStatus::Cancelled);
    model_.reset();
}

TransferStatus ServedUsbDevice::send(std::uint8_t endpoint, std::span<const std::byte> data, bool ends_empty,
                                     std::int64_t now_ns) {
    // A halted endpoint stalls.
    if (endpoint != kEndpointOut || !model_.usable(endpoint)) {
        return TransferStatus::Stalled;
    }
    // Split into pieces. A transfer of whole pieces ends with an empty packet only if the client asks for it.
    for (std::span<const std::byte> rest = data; !rest.empty();) {
        const std::size_t count = std::min(rest.size(), kPieceBytes);
        firmware_->receive(rest.first(count), now_ns);
        rest = rest.subspan(count);
    }
    if (data.empty() || (ends_empty && data.size() % kPieceBytes == 0)) {
        firmware_->receive({}, now_ns);
    }
    return TransferStatus::Ok;
}

bool ServedUsbDevice::receive(std::uint8_t endpoint, InTransfer transfer, std::int64_t now_ns) {
    if (endpoint != kEndpointIn || !model_.usable(endpoint)) {
        transfer.done(TransferStatus::Stalled, {});
        return true;
    }
    // Bounds the memory that one client can occupy.
    if (pending_.size() >= kMaxPending) {
        return false;
    }
    // The transfer waits for data from the firmware, which may be ready already.
    pending_.push_back({.transfer = std::move(transfer)});
    complete_pending(now_ns);
    return true;
}

bool ServedUsbDevice::cancel(std::uint64_t id) {
    const auto found = std::find_if(pending_.begin(), pending_.end(),
                                    [&](const Pending& pending) { return pending.transfer.id == id; });
    if (found == pending_.end()) {
        return false;
    }
    pending_.erase(found);
    return true;
}

void ServedUsbDevice::complete_pending(std::int64_t now_ns) {
    // A control request may have halted IN or deconfigured the device.
    if (!model_.usable(kEndpointIn)) {
        end_pending(TransferStatus::Stalled);
        return;
    }
    // Piece by piece to the oldest transfer; a transfer may take several.
    std::array<std::byte, kPieceBytes> piece{};
    while (!pending_.empty()) {
        const std::size_t count = firmware_->reply(piece, now_ns);
        if (count == 0) {
            return;
        }
        if (add_piece(std::span<const std::byte>(piece).first(count))) {
            pending_.pop_front();
        }
    }
}

bool ServedUsbDevice::add_piece(std::span<const std::byte> piece) {
    Pending& pending = pending_.front();
    // Space left in the oldest transfer.
    const std::size_t room = pending.transfer.length - pending.data.size();
    const std::span<const std::byte> taken = piece.first(std::min(room, piece.size()));
    pending.data.insert(pending.data.end(), taken.begin(), taken.end());
    // More data than requested is babble.
    if (piece.size() > room) {
        pending.transfer.done(TransferStatus::Babble, pending.data);
        return true;
    }
    // A transfer ends when it is full, or with a packet that is shorter than the endpoint's.
    const bool is_short = pending.data.size() < pending.transfer.length;
    if (is_short && piece.size() % bulk_packet_bytes(model_.speed()) == 0) {
        return false;
    }
    // A short transfer is complete, and an error only if the client says so.
    const bool failed = is_short && pending.transfer.short_is_error;
    pending.transfer.done(failed ? TransferStatus::Short : TransferStatus::Ok, pending.data);
    return true;
}

void ServedUsbDevice::end_pending(TransferStatus status) {
    for (const Pending& pending : pending_) {
        pending.transfer.done(status, pending.data);
    }
    pending_.clear();
}

}  // namespace haptic::device
