// Independent client of the live view: socket, HTTP and WebSocket by hand (RFC 6455), without the server's code.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace haptic::sim::view::test {

// Timeout after which a test fails: a process that a sanitizer watches takes seconds to start on a busy machine.
inline constexpr int kPatience_ms = 60'000;

/// A TCP connection to 127.0.0.1.
class Connection {
  public:
    /// A small receive buffer makes the socket full soon when it is not read.
    explicit Connection(std::uint16_t port, int receive_buffer = 0);
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;
    ~Connection();

    void send(std::string_view bytes);
    /// Received bytes, after waiting for some at most this long; empty: none, or the end.
    std::string receive(int patience_ms = kPatience_ms);
    [[nodiscard]] bool ended() const noexcept { return ended_; }

  private:
    int socket_ = -1;
    bool ended_ = false;
};

struct HttpReply {
    int status = 0;  // 0: the connection ended without one
    std::string headers;
    std::string body;

    /// Value of a header, given by its name in lower case; empty if it is missing.
    [[nodiscard]] std::string header(std::string_view name) const;
};

/// Sends "METHOD PATH" with headers, each with its line end, and content.
HttpReply request(std::uint16_t port, const std::string& method_and_path, const std::string& headers,
                  std::string_view content = {});

/// The Host that a browser on this machine sends.
std::string own_host(std::uint16_t port);

struct WsMessage {
    enum class Kind : std::uint8_t { Text, Binary, Close };
    Kind kind = Kind::Close;
    std::string bytes;  // of a close: code and reason
    [[nodiscard]] std::uint16_t close_code() const;
};

struct Handshake {
    std::string host{};    // empty: own_host()
    std::string origin{};  // empty: none
    std::string path = "/stream";
    std::string subprotocol = "haptic-view-1";
    int receive_buffer = 0;
};

class StreamClient {
  public:
    explicit StreamClient(std::uint16_t port, const Handshake& handshake = {});

    /// 101 if it is connected.
    [[nodiscard]] int status() const noexcept { return status_; }

    void say(std::string_view text) { send_frame(0x81, text); }
    /// `first_byte`: FIN and opcode.
    void send_frame(unsigned first_byte, std::string_view payload);
    /// Announces a frame of this length without sending it.
    void announce_frame(unsigned first_byte, std::uint64_t length);

    /// The next message; none if nothing came in time or the connection ended without one.
    std::optional<WsMessage> next(int patience_ms = kPatience_ms);
    /// The next text message of this type; earlier messages are skipped.
    std::string next_text(std::string_view type);
    /// The next binary message of this kind; earlier messages are skipped.
    std::string next_binary(std::uint32_t kind);
    /// Reads to the end; returns the server's close code, 0 if it sent none.
    int close_code();
    /// Whether the server has ended the connection.
    [[nodiscard]] bool ended() const noexcept { return connection_.ended(); }

  private:
    bool fill(std::size_t length, int patience_ms);

    Connection connection_;
    int status_ = 0;
    std::string received_;
};

/// A number at an offset of a binary message.
template <class Number>
Number number_at(std::string_view bytes, std::size_t offset) {
    Number number{};
    if (offset + sizeof(Number) <= bytes.size()) {
        __builtin_memcpy(&number, bytes.data() + offset, sizeof(Number));
    }
    return number;
}

}  // namespace haptic::sim::view::test
