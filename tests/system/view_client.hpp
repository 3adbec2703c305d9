// Minimal viewer: one WebSocket to host-sim's live view, by hand, so that tests and benchmarks can open a hundred of
// them and do what no browser does. Protocol: host-sim/page/PROTOCOL.md.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace haptic::test {

/// A connected, non-blocking TCP socket on the loopback device; closes itself.
class Socket {
  public:
    /// Connects; throws std::system_error.
    explicit Socket(std::uint16_t port, int receive_buffer = 0);
    Socket(const Socket&) = delete;
    Socket& operator=(const Socket&) = delete;
    ~Socket();

    [[nodiscard]] int descriptor() const noexcept { return fd_; }
    /// Sends all of it, or as much as the socket accepts. Returns false if the connection is gone.
    bool send(std::string_view bytes) const;
    /// Appends received bytes. Returns false at the end of the connection.
    bool receive(std::string& bytes) const;
    /// Closes the connection with a reset.
    void reset();

  private:
    int fd_ = -1;
};

class ViewClient {
  public:
    /// Connects and requests the stream. `receive_buffer`: size of the kernel's buffer, bytes; 0: default.
    explicit ViewClient(std::uint16_t port, int receive_buffer = 0);

    /// Reads everything received, without waiting.
    void take();
    /// Sends a text message, e.g. {"type":"pause","on":true}.
    bool say(std::string_view text);

    [[nodiscard]] const Socket& socket() const noexcept { return socket_; }
    [[nodiscard]] bool open() const noexcept { return status_ == 101 && !closed_; }
    [[nodiscard]] bool closed() const noexcept { return closed_; }
    [[nodiscard]] int status() const noexcept { return status_; }          // of HTTP; 0: none yet
    [[nodiscard]] int close_code() const noexcept { return close_code_; }  // of the server; 0: none
    [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }  // on the wire
    [[nodiscard]] std::uint64_t frames() const noexcept { return count("frame"); }
    /// Number of messages of a type: of JSON, or "geometry", "frame", "samples".
    [[nodiscard]] std::uint64_t count(const std::string& type) const;
    /// The newest text message of a type; empty if there was none.
    [[nodiscard]] std::string newest(const std::string& type) const;
    [[nodiscard]] double time() const noexcept { return time_; }  // s, of the newest frame; its step:
    [[nodiscard]] double step() const noexcept { return step_; }

  private:
    void take_head();
    bool take_fragment();
    void take_message();

    Socket socket_;
    std::string in_;       // received, not yet parsed
    std::string message_;  // fragments of the current message
    bool text_ = false;
    bool closed_ = false;
    int status_ = 0;
    int close_code_ = 0;
    std::uint64_t bytes_ = 0;
    double time_ = 0.0;
    double step_ = 0.0;
    std::map<std::string, std::uint64_t> counts_;
    std::map<std::string, std::string> texts_;
};

using ViewClients = std::vector<std::unique_ptr<ViewClient>>;

/// Lets all viewers read until the condition holds. Returns false on timeout.
bool take_until(const std::vector<ViewClient*>& clients, std::chrono::milliseconds time,
                const std::function<bool()>& condition);

/// The port in the live view's address, from the output of a process.
[[nodiscard]] std::optional<std::uint16_t> view_port_in(const std::string& output);

/// Resources used by a process, from /proc.
[[nodiscard]] std::size_t open_descriptors(int pid);
[[nodiscard]] std::size_t resident_bytes(int pid);

}  // namespace haptic::test
