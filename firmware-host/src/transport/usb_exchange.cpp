// What an exchange over USB does: all of it within the tick. Opening and closing are in usb_transport.cpp.
#include <algorithm>
#include <cerrno>
#include <cstring>

#include <haptic/clock.hpp>
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

/// Of a transfer that still runs: not yet.
ExchangeStatus status_of(const UsbSlot& slot) HAPTIC_RT {
    return slot.submitted ? ExchangeStatus::Timeout : status_of_transfer(*slot.transfer);
}

/// Ended, and not well.
bool failed(const UsbSlot& slot) HAPTIC_RT {
    return !slot.submitted && slot.transfer->status != LIBUSB_TRANSFER_COMPLETED;
}

/// As if its transfer had ended well and carried nothing; one that still runs is left alone.
void forget(UsbSlot& slot) HAPTIC_RT {
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
    stalled[0].store(failed(out[0]) || failed(out[1]), std::memory_order_relaxed);
    stalled[1].store(failed(in), std::memory_order_relaxed);
    clearing.store(true, std::memory_order_release);
    usb::wake(to_clear);
}

void UsbTransport::handle_until(std::int64_t deadline_ns) HAPTIC_RT {
    Link& link = *link_;
    while (true) {
        usb::take_ended(link.context);
        const bool over = failed(link.in) || failed(link.out[0]) || failed(link.out[1]);
        if (!link.busy() || over || monotonic_now_ns() >= deadline_ns) {
            return;
        }
        usb::wait_for_transfer(link.node, deadline_ns);
    }
}

ExchangeStatus UsbTransport::submit_all(const PacketExchange& packets) HAPTIC_RT {
    Link& link = *link_;
    // An IN that is still submitted, because its answer never came, serves this exchange.
    if (!packets.in.empty() && !link.in.submitted) {
        if (const ExchangeStatus status = submit(link.in, kUsbBufferBytes); status != ExchangeStatus::Ok) {
            return status;
        }
    }
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

ExchangeStatus UsbTransport::outcome(PacketExchange& packets) HAPTIC_RT {
    Link& link = *link_;
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
    if (link.clearing.load(std::memory_order_acquire)) {
        return ExchangeStatus::Stalled;
    }
    const std::int64_t deadline_ns = monotonic_now_ns() + settings_.timeout_ns;
    // What the last exchange left: a late answer is thrown away, and no command overtakes one that is still on its way.
    usb::take_ended(link.context);
    while ((link.out[0].submitted || link.out[1].submitted) && monotonic_now_ns() < deadline_ns) {
        usb::wait_for_transfer(link.node, deadline_ns);
        usb::take_ended(link.context);
    }
    if (link.out[0].submitted || link.out[1].submitted) {
        return ExchangeStatus::Timeout;
    }
    forget(link.in);
    forget(link.out[0]);
    forget(link.out[1]);
    ExchangeStatus status = submit_all(packets);
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
