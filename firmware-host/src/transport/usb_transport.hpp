// USB transport: bulk packets to a USB board through libusb.
//
// An exchange submits the IN transfer first and then the OUT transfers, so that the host is ready for the reply before
// the board receives the command. It then handles libusb events until all transfers have ended or the time limit is
// reached. An exchange whose reply is for later submits the same transfers and leaves them to the next one, so that the
// reply arrives while nobody waits. A transfer that has not ended stays submitted and the next exchange continues with
// it, because cancelling makes the kernel wait for the host controller without a bound. A late reply is discarded then.
//
// Transfers and buffers are allocated when the device is opened. libusb still allocates in each submit; the README
// counts these allocations.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "haptic/realtime.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

/// A problem with a USB device: which device, what is wrong, and what to do.
class UsbError : public BoardError {
  public:
    using BoardError::BoardError;
};

class UsbTransport final : public Transport {
  public:
    // The same on every known board: interface 0, alternate setting 0. @source Springhead DRCyUsb20Sh4.cpp (2012)
    static constexpr unsigned char kEndpointOut = 0x02;
    static constexpr unsigned char kEndpointIn = 0x86;

    struct Settings {
        std::int64_t timeout_ns = 2'000'000;  // ns, for a whole exchange
    };

    /// Closed: exchange() returns Disconnected until open().
    explicit UsbTransport(const Settings& settings);
    UsbTransport(const UsbTransport&) = delete;
    UsbTransport& operator=(const UsbTransport&) = delete;
    ~UsbTransport() override;

    /// Opens a device node (/dev/bus/usb/BBB/DDD), checks its endpoints, detaches any kernel driver from interface 0,
    /// claims it and drains it. Throws UsbError and leaves the transport closed. Must not run while another thread is
    /// inside a call of it.
    void open(const std::filesystem::path& node);
    /// Cancels all transfers and releases the device. Blocks for at most a second, unless the kernel blocks longer.
    void close() noexcept;
    /// Resets the device if its endpoints do not respond. False if it must be opened again.
    bool reset();
    /// Whether the kernel no longer has the device; for reports. True if it was never opened.
    [[nodiscard]] bool gone() const noexcept;

    /// Takes at most timeout_ns plus its own work of about ten system calls. The time is CLOCK_MONOTONIC, not now_ns. A
    /// background thread clears a stalled endpoint; exchanges return Stalled until it has finished.
    ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override;
    /// One system call on the device node, without libusb and its locks: may be called from any thread and from signal
    /// handlers. The kernel waits at most 20 ms for the board to accept the packet. A stalled endpoint is cleared and
    /// the packet sent once more.
    void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    /// Clears a halt of IN, and reads until nothing arrives for 10 ms. Throws UsbError if the input does not end.
    void drain() override;
    [[nodiscard]] DeviceLink link() const override { return {LinkKind::Usb, node_.load()}; }

  private:
    struct Link;

    /// Makes room for a new exchange and submits its transfers.
    [[nodiscard]] ExchangeStatus begin(const PacketExchange& packets, std::int64_t deadline_ns) HAPTIC_RT;
    [[nodiscard]] ExchangeStatus submit_all(const PacketExchange& packets) HAPTIC_RT;
    [[nodiscard]] ExchangeStatus outcome(PacketExchange& packets) HAPTIC_RT;
    void handle_until(std::int64_t deadline_ns) HAPTIC_RT;

    Settings settings_;
    std::atomic<int> node_{-1};  // file descriptor; also read by signal handlers
    std::unique_ptr<Link> link_;
};

}  // namespace haptic::device
