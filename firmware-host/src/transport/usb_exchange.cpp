// USB exchange: the real-time half of UsbTransport, called by the tick. usb_transport.cpp opens and closes.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "haptic/clock.hpp"
#include "transport/usb_link.hpp"
#include "transport/usb_syscalls.hpp"

namespace haptic::device {
namespace {

ExchangeStatus status_of_submission(int error) HAPTIC_RT {
    switch (error) {
        case LIBUSB_SUCCESS:
            return ExchangeStatus::Ok;
        case LIBUSB_ERROR_NO_DEVICE:
            return ExchangeStatus::Disconnected;
        case LIBUSB_ERROR_PIPE:
            return ExchangeStatus::Stalled;
        default:
            return ExchangeStatus::Failed;
    }
}

ExchangeStatus status_of_transfer(const libusb_transfer& transfer) HAPTIC_RT {
    switch (transfer.status) {
        case LIBUSB_TRANSFER_COMPLETED:
            return ExchangeStatus::Ok;
        case LIBUSB_TRANSFER_TIMED_OUT:
        case LIBUSB_TRANSFER_CANCELLED:
            return ExchangeStatus::Timeout;
        case LIBUSB_TRANSFER_STALL:
            return ExchangeStatus::Stalled;
        case LIBUSB_TRANSFER_NO_DEVICE:
            return ExchangeStatus::Disconnected;
        case LIBUSB_TRANSFER_OVERFLOW:
            return ExchangeStatus::Short;
        case LIBUSB_TRANSFER_ERROR:
            break;
    }
    return ExchangeStatus::Failed;
}

/// Timeout for a transfer that has not ended.
ExchangeStatus status_of(const UsbSlot& slot) HAPTIC_RT {
    return slot.submitted ? ExchangeStatus::Timeout : status_of_transfer(*slot.transfer);
}

/// The transfer has ended with an error.
bool failed(const UsbSlot& slot) HAPTIC_RT {
    return !slot.submitted && slot.transfer->status != LIBUSB_TRANSFER_COMPLETED;
}

/// Resets the result of the previous exchange to an empty success. A transfer in flight is left unchanged.
void reset_result(UsbSlot& slot) HAPTIC_RT {
    if (!slot.submitted) {
        slot.transfer->status = LIBUSB_TRANSFER_COMPLETED;
        slot.transfer->length = 0;
        slot.transfer->actual_length = 0;
    }
}

ExchangeStatus submit(UsbSlot& slot, std::size_t length) HAPTIC_RT {
    slot.transfer->length = static_cast<int>(length);
    const ExchangeStatus status = status_of_submission(usb::submit(slot.transfer));
    slot.submitted = status == ExchangeStatus::Ok;
    return status;
}

}  // namespace

void UsbTransport::Link::start_clearing() HAPTIC_RT {
    // Relaxed: the release store of `clearing` and the semaphore publish these flags to the thread.
    stalled[0].store(failed(out[0]) || failed(out[1]), std::memory_order_relaxed);
    stalled[1].store(failed(in), std::memory_order_relaxed);
    // Release: a thread that sees `clearing` set also sees the flags above.
    clearing.store(true, std::memory_order_release);
    usb::wake(clear_request);
}

void UsbTransport::handle_until(std::int64_t deadline_ns) HAPTIC_RT {
    Link& link = *link_;
    while (true) {
        usb::reap_transfers(link.context);
        // One failed transfer decides the exchange: do not wait for the others.
        const bool any_failed = failed(link.in) || failed(link.out[0]) || failed(link.out[1]);
        if (!link.busy() || any_failed || monotonic_now_ns() >= deadline_ns) {
            return;
        }
        usb::wait_for_transfer(link.node, deadline_ns);
    }
}

ExchangeStatus UsbTransport::submit_all(const PacketExchange& packets) HAPTIC_RT {
    Link& link = *link_;
    // IN first. An IN transfer whose reply never came is still submitted and serves this exchange.
    if ((!packets.in.empty() || packets.reply_later) && !link.in.submitted) {
        if (const ExchangeStatus status = submit(link.in, kUsbBufferBytes); status != ExchangeStatus::Ok) {
            return status;
        }
    }
    // Then the OUT transfers, from our own buffers: the caller's may be gone before a late transfer ends.
    for (std::size_t i = 0; i < packets.out.size(); ++i) {
        const std::span<const std::byte> out = packets.out[i];
        if (out.empty()) {
            continue;
        }
        if (out.size() > kUsbBufferBytes) {
            return ExchangeStatus::Failed;
        }
        std::memcpy(link.out[i].buffer.data(), out.data(), out.size());
        if (const ExchangeStatus status = submit(link.out[i], out.size()); status != ExchangeStatus::Ok) {
            return status;
        }
    }
    return ExchangeStatus::Ok;
}

ExchangeStatus UsbTransport::begin(const PacketExchange& packets, std::int64_t deadline_ns) HAPTIC_RT {
    Link& link = *link_;
    // Finish the previous exchange: discard a late reply, and wait for OUT transfers in flight, so that no command
    // overtakes another. An exchange that does not wait for its reply does not wait for those either.
    usb::reap_transfers(link.context);
    while ((link.out[0].submitted || link.out[1].submitted) && !packets.reply_later &&
           monotonic_now_ns() < deadline_ns) {
        usb::wait_for_transfer(link.node, deadline_ns);
        usb::reap_transfers(link.context);
    }
    if (link.out[0].submitted || link.out[1].submitted) {
        return ExchangeStatus::Timeout;
    }
    reset_result(link.in);
    reset_result(link.out[0]);
    reset_result(link.out[1]);
    return submit_all(packets);
}

ExchangeStatus UsbTransport::outcome(PacketExchange& packets) HAPTIC_RT {
    Link& link = *link_;
    // Every OUT transfer must have carried its whole packet.
    for (const UsbSlot& slot : link.out) {
        const ExchangeStatus status = status_of(slot);
        if (status != ExchangeStatus::Ok) {
            return status;
        }
        if (slot.transfer->actual_length != slot.transfer->length) {
            return ExchangeStatus::Failed;
        }
    }
    if (packets.in.empty()) {
        return ExchangeStatus::Ok;
    }
    // IN: a reply longer than the caller's buffer is of the wrong length.
    const ExchangeStatus status = status_of(link.in);
    if (status != ExchangeStatus::Ok) {
        return status;
    }
    const auto received = static_cast<std::size_t>(link.in.transfer->actual_length);
    if (received > packets.in.size()) {
        return ExchangeStatus::Short;
    }
    std::memcpy(packets.in.data(), link.in.buffer.data(), received);
    packets.received = received;
    return ExchangeStatus::Ok;
}

ExchangeStatus UsbTransport::exchange(PacketExchange& packets, std::int64_t /*now_ns*/) HAPTIC_RT {
    packets.received = 0;
    if (link_ == nullptr || link_->lost) {
        return ExchangeStatus::Disconnected;
    }
    Link& link = *link_;
    // Acquire: pairs with the thread's release store after it cleared the halts.
    if (link.clearing.load(std::memory_order_acquire)) {
        return ExchangeStatus::Stalled;
    }
    const std::int64_t deadline_ns = monotonic_now_ns() + settings_.timeout_ns;
    // The transfers that the last exchange left are finished here. Without a packet to send, theirs is the result.
    const bool collects = std::exchange(link.reply_later, false) && packets.out[0].empty() && packets.out[1].empty();
    ExchangeStatus status = collects ? ExchangeStatus::Ok : begin(packets, deadline_ns);
    if (status == ExchangeStatus::Ok && packets.reply_later) {
        link.reply_later = true;
        return ExchangeStatus::Ok;
    }
    // Wait until all transfers have ended or the deadline is reached, and evaluate the results.
    if (status == ExchangeStatus::Ok) {
        handle_until(deadline_ns);
        status = outcome(packets);
    }
    if (status == ExchangeStatus::Disconnected) {
        link.lost = true;
    } else if (status == ExchangeStatus::Stalled) {
        link.start_clearing();
    }
    return status;
}

void UsbTransport::send_last(std::span<const std::byte> out, std::int64_t /*now_ns*/) HAPTIC_RT {
    // Acquire: pairs with the release in open(), after which the node is ready for use.
    const int node = node_.load(std::memory_order_acquire);
    if (node < 0) {
        return;
    }
    if (usb::send_now(node, kEndpointOut, out) == EPIPE) {
        usb::clear_halt_now(node, kEndpointOut);
        usb::send_now(node, kEndpointOut, out);
    }
}

}  // namespace haptic::device
