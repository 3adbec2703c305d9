// Link: the resources of an open USB device: libusb handles, transfers, buffers, and the thread that clears halts.
#pragma once

#include <libusb.h>
#include <semaphore.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <thread>

#include "transport/usb_transport.hpp"

namespace haptic::device {

/// Longest packet of a known board. Equal to the packet size of a high-speed bulk endpoint, so that no reply overflows.
inline constexpr std::size_t kUsbBufferBytes = 512;

/// One reusable transfer with its buffer. Its address is fixed, because libusb keeps pointers to it.
struct UsbSlot {
    libusb_transfer* transfer = nullptr;
    std::array<unsigned char, kUsbBufferBytes> buffer{};
    bool submitted = false;  // and not ended
};

struct UsbTransport::Link {
    Link() = default;
    Link(const Link&) = delete;
    Link& operator=(const Link&) = delete;
    ~Link();

    libusb_context* context = nullptr;
    libusb_device_handle* handle = nullptr;
    int node = -1;
    UsbSlot in;
    std::array<UsbSlot, 2> out;

    bool reply_later = false;           // the transfers of the last exchange are for the next one to finish
    bool lost = false;                  // the kernel reported that the device is gone
    std::atomic<bool> clearing{false};  // set by an exchange, reset by halt_clearer

    void start_clearing() HAPTIC_RT;

    /// Clears halts on request. libusb_clear_halt() waits for a control transfer, which only the kernel bounds, so that
    /// an exchange must not call it.
    std::thread halt_clearer;
    sem_t clear_request{};
    std::array<std::atomic<bool>, 2> stalled{};  // OUT, IN
    std::atomic<bool> ending{false};

    [[nodiscard]] std::array<UsbSlot*, 3> slots() noexcept { return {&in, &out[0], &out[1]}; }
    [[nodiscard]] bool busy() const HAPTIC_RT { return in.submitted || out[0].submitted || out[1].submitted; }
    /// Cancels all submitted transfers and waits until they end. False if one has not ended after `max_wait_ns`.
    bool cancel_all(std::int64_t max_wait_ns) noexcept;
};

}  // namespace haptic::device
