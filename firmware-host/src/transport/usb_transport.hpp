// Bulk packets to a USB board through libusb.
//
// One exchange submits the IN transfer first, then the OUT transfers, so that the answer is already awaited when the
// command arrives, and then handles libusb's events until all have ended or the bound has passed. What has not ended by
// then stays submitted, and the next exchange takes it up: cancelling a transfer makes the kernel wait for the host
// controller, and that has no bound. An answer that came too late is thrown away there.
//
// Transfers and buffers are allocated when the device is opened. libusb allocates all the same, on each submit; the
// README counts it.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "transport/transport.hpp"
#include <haptic/realtime.hpp>

namespace haptic::device {

/// What is wrong with a USB device, where, and what to do.
class UsbError : public BoardError {
  public:
    using BoardError::BoardError;
};

class UsbTransport final : public Transport {
  public:
    // Of every known board: interface 0, alternate setting 0. @source Springhead DRCyUsb20Sh4.cpp (2012)
    static constexpr unsigned char kEndpointOut = 0x02;
    static constexpr unsigned char kEndpointIn = 0x86;

    struct Settings {
        std::int64_t timeout_ns = 2'000'000;  // ns, from the beginning of an exchange to its end at the latest
    };

    /// Closed: each exchange() is Disconnected until open().
    explicit UsbTransport(const Settings& settings);
    UsbTransport(const UsbTransport&) = delete;
    UsbTransport& operator=(const UsbTransport&) = delete;
    ~UsbTransport() override;

    /// Opens a device node (/dev/bus/usb/BBB/DDD), checks its endpoints, takes interface 0 from whatever kernel driver
    /// has it, and drains it. Throws UsbError; the transport is then closed. Not while another thread is within it.
    void open(const std::filesystem::path& node);
    /// Ends every transfer and gives the device back. Blocks for a second at most, unless the kernel does for longer.
    void close() noexcept;
    /// Makes the device enumerate again where its endpoints do not answer. False if it has to be opened anew.
    bool reset();
    /// Whether the device has gone, as the kernel sees it; for reports. True if it was never opened.
    [[nodiscard]] bool gone() const noexcept;

    /// Never longer than timeout_ns, its own work (some ten system calls) not counted. Time is the system's, not
    /// now_ns. A stalled endpoint is cleared by a thread of the transport's; exchanges are Stalled until it is done.
    ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override;
    /// One system call on the device node, without libusb and its locks: from any thread and from signal handlers. The
    /// kernel waits for the board to take the packet, 20 ms at most. A stalled endpoint is cleared and tried once more.
    void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    /// Clears a halt of IN, and reads until nothing comes for 10 ms. Throws UsbError if it does not end.
    void drain() override;

  private:
    struct Link;

    [[nodiscard]] ExchangeStatus submit_all(const PacketExchange& packets) HAPTIC_RT;
    [[nodiscard]] ExchangeStatus outcome(PacketExchange& packets) HAPTIC_RT;
    void handle_until(std::int64_t deadline_ns) HAPTIC_RT;

    Settings settings_;
    std::atomic<int> node_{-1};  // file descriptor; also read by signal handlers
    std::unique_ptr<Link> link_;
};

}  // namespace haptic::device
