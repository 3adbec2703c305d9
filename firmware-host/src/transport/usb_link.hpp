// What a UsbTransport has of an open device.
#pragma once

#include <libusb.h>
#include <semaphore.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <thread>

#include "transport/usb_transport.hpp"

namespace haptic::device {

/// The longest packet of a known board. Also the packet size of a high-speed bulk endpoint, so that no answer
/// overflows.
inline constexpr std::size_t kUsbBufferBytes = 512;

/// One transfer with its buffer, used again and again. It lies still, because libusb keeps pointers to it.
struct UsbSlot {
    libusb_transfer* transfer = nullptr;
    std::array<unsigned char, kUsbBufferBytes> buffer{};
    bool submitted = false;  // and has not ended
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

    bool lost = false;                  // the kernel said that there is no device any more
    std::atomic<bool> clearing{false};  // set by an exchange, reset by the thread below

    void start_clearing() HAPTIC_RT;

    /// Clears halts when it is told to: libusb_clear_halt() waits for a control transfer, which only the kernel bounds.
    std::thread clearer;
    sem_t to_clear{};
    std::array<std::atomic<bool>, 2> stalled{};  // OUT, IN
    std::atomic<bool> ending{false};

    [[nodiscard]] std::array<UsbSlot*, 3> slots() noexcept { return {&in, &out[0], &out[1]}; }
    [[nodiscard]] bool busy() const HAPTIC_RT { return in.submitted || out[0].submitted || out[1].submitted; }
    /// Cancels what is submitted and waits for its end, at most so long. False if something did not end.
    bool settle(std::int64_t at_most_ns) noexcept;
};

}  // namespace haptic::device
