// A serial line to UART motor boards: termios, raw, without flow control.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <span>

#include "transport/transport.hpp"

namespace haptic::device {

/// An exchange sends, then reads until as many bytes have come as there is room for, or the time is over; what came
/// until then is Ok with its length, nothing at all Timeout. What stood in the input before it is thrown away. It makes
/// a bounded number of system calls, none of which waits longer than the time that is left (serial_line.cpp). Time is
/// the system's, whatever the caller's clock is.
///
/// Many USB adapters hold bytes back for up to 16 ms unless told otherwise; this asks for low latency where the driver
/// knows of it.
class SerialTransport final : public Transport {
  public:
    struct Settings {
        std::int64_t timeout_ns = 2'000'000;  // ns, from the beginning of an exchange to its end at the latest
        int baud = 2'000'000;                 // bit/s, one of those that the kernel has a name for
    };

    /// Opens the line for nobody else. Throws BoardError that says what the system refuses and what to do.
    SerialTransport(std::filesystem::path path, const Settings& settings);
    SerialTransport(const SerialTransport&) = delete;
    SerialTransport& operator=(const SerialTransport&) = delete;
    ~SerialTransport() override;

    ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override;
    /// One write() that does not wait: may be called in a signal handler, and while another thread is within
    /// exchange().
    void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    /// Reads until nothing has come for 20 ms, for 0.2 s at most.
    void drain() override;

    /// Closes the line and opens it anew, as after its adapter was plugged in again; not while another thread
    /// exchanges. Throws as the constructor does.
    void reopen();

    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

  private:
    ExchangeStatus send(std::span<const std::byte> out, std::int64_t deadline_ns) HAPTIC_RT;
    ExchangeStatus receive(PacketExchange& packets, std::int64_t deadline_ns) HAPTIC_RT;

    std::filesystem::path path_;
    Settings settings_;
    std::atomic<int> descriptor_{-1};
};

}  // namespace haptic::device
