// A client of the live view that has nothing of the server's code: a socket, HTTP and WebSocket by hand (RFC 6455).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace haptic::sim::view::test {

inline constexpr int kPatience_ms = 5000;  // after this a test has failed anyway

/// A TCP connection to 127.0.0.1.
class Connection {
  public:
    /// With a small buffer it takes little that it does not read.
    explicit Connection(std::uint16_t port, int receive_buffer = 0);
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;
    ~Connection();

    void send(std::string_view bytes);
    /// Whatever has come, after waiting for something at most that long; empty: nothing, or the end.
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

    /// The value of a header, whose name is in lower case; empty if there is none.
    [[nodiscard]] std::string header(std::string_view name) const;
};

/// "METHOD PATH", and headers, each with its line end.
HttpReply request(std::uint16_t port, const std::string& method_and_path, const std::string& headers);

/// The Host that a browser on this machine names.
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
    /// Only announces a frame of that length.
    void announce_frame(unsigned first_byte, std::uint64_t length);

    /// The next message; none if nothing came in time, or the connection ended without one.
    std::optional<WsMessage> next(int patience_ms = kPatience_ms);
    /// The next text message of that type; what comes before is skipped.
    std::string next_text(std::string_view type);
    /// The next binary message of that kind; what comes before is skipped.
    std::string next_binary(std::uint32_t kind);
    /// Reads to the end; the code that the server closed with, 0 if it did not say.
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
