// Serial transport: a serial line to UART motor boards. termios, raw, without flow control.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <span>

#include "transport/transport.hpp"

namespace haptic::device {

/// An exchange discards old input, sends, then reads until the reply buffer is full or the time limit is reached. A
/// partial reply is Ok with its length; no reply is Timeout. The number of system calls is bounded, and none waits
/// longer than the remaining time (serial_line.cpp). Times are CLOCK_MONOTONIC, not the caller's clock.
///
/// Many USB adapters delay input by up to 16 ms; low latency is requested if the driver supports it.
class SerialTransport final : public Transport {
  public:
    struct Settings {
        std::int64_t timeout_ns = 2'000'000;  // ns, for a whole exchange
        int baud = 2'000'000;                 // bit/s, one of the rates that the kernel names (Bxxx)
    };

    /// Opens the line exclusively. Throws BoardError with the system's refusal and a remedy.
    SerialTransport(std::filesystem::path path, const Settings& settings);
    SerialTransport(const SerialTransport&) = delete;
    SerialTransport& operator=(const SerialTransport&) = delete;
    ~SerialTransport() override;

    ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override;
    /// One non-blocking write(). May be called in a signal handler, and while another thread is inside exchange().
    void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    /// Reads until nothing has arrived for 20 ms, for at most 0.2 s.
    void drain() override;
    [[nodiscard]] DeviceLink link() const override { return {LinkKind::Serial, descriptor_.load()}; }

    /// Closes the line and opens it again, for example after the adapter was reconnected. Must not run while another
    /// thread exchanges. Throws as the constructor does.
    void reopen();

    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

  private:
    ExchangeStatus send(std::span<const std::byte> out, std::int64_t deadline_ns) HAPTIC_RT;
    ExchangeStatus receive(PacketExchange& packets, std::int64_t deadline_ns) HAPTIC_RT;

    std::filesystem::path path_;
    Settings settings_;
    std::atomic<int> descriptor_{-1};  // also read by signal handlers
};

}  // namespace haptic::device
