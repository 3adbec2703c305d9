#include "socket_client.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

namespace haptic::sim::view::test {
namespace {

int status_of(std::string_view reply) {
    return reply.starts_with("HTTP/1.") && reply.size() > 12 ? std::stoi(std::string(reply.substr(9, 3))) : 0;
}

}  // namespace

Connection::Connection(std::uint16_t port, int receive_buffer) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer > 0) {
        (void)setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof(receive_buffer));
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
        const int error = errno;
        (void)close(socket_);
        throw std::system_error(error, std::generic_category(), "connect");
    }
}

Connection::~Connection() {
    (void)close(socket_);
}

void Connection::send(std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        if (sent <= 0) {
            ended_ = true;
            return;
        }
        bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
}

std::string Connection::receive(int patience_ms) {
    pollfd waits{socket_, POLLIN, 0};
    std::array<char, 65536> bytes{};
    if (poll(&waits, 1, patience_ms) <= 0) {
        return {};
    }
    const ssize_t length = recv(socket_, bytes.data(), bytes.size(), 0);
    if (length <= 0) {
        ended_ = true;
        return {};
    }
    return {bytes.data(), static_cast<std::size_t>(length)};
}

std::string HttpReply::header(std::string_view name) const {
    std::size_t begin = 0;
    while (begin < headers.size()) {
        const std::size_t end = std::min(headers.find("\r\n", begin), headers.size());
        const std::string line = headers.substr(begin, end - begin);
        const std::size_t colon = line.find(':');
        if (colon == name.size() && std::equal(name.begin(), name.end(), line.begin(), [](char a, char b) {
                return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
            })) {
            return line.substr(std::min(line.find_first_not_of(' ', colon + 1), line.size()));
        }
        begin = end + 2;
    }
    return {};
}

HttpReply request(std::uint16_t port, const std::string& method_and_path, const std::string& headers,
                  std::string_view content) {
    Connection connection(port);
    connection.send(method_and_path + " HTTP/1.1\r\n" + headers + "Connection: close\r\n\r\n" + std::string(content));
    std::string all;
    for (std::string some = connection.receive(); !some.empty(); some = connection.receive()) {
        all += some;
    }
    HttpReply reply;
    reply.status = status_of(all);
    const std::size_t end = all.find("\r\n\r\n");
    if (end != std::string::npos) {
        reply.headers = all.substr(0, end);
        reply.body = all.substr(end + 4);
    }
    return reply;
}

std::string own_host(std::uint16_t port) {
    return "127.0.0.1:" + std::to_string(port);
}

std::uint16_t WsMessage::close_code() const {
    return bytes.size() < 2 ? std::uint16_t{0}
                            : static_cast<std::uint16_t>(static_cast<unsigned char>(bytes[0]) * 256 +
                                                         static_cast<unsigned char>(bytes[1]));
}

StreamClient::StreamClient(std::uint16_t port, const Handshake& handshake)
    : connection_(port, handshake.receive_buffer) {
    std::string text = "GET " + handshake.path +
                       " HTTP/1.1\r\nHost: " + (handshake.host.empty() ? own_host(port) : handshake.host) +
                       "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                       "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    if (!handshake.subprotocol.empty()) {
        text += "Sec-WebSocket-Protocol: " + handshake.subprotocol + "\r\n";
    }
    if (!handshake.origin.empty()) {
        text += "Origin: " + handshake.origin + "\r\n";
    }
    connection_.send(text + "\r\n");
    while (received_.find("\r\n\r\n") == std::string::npos) {
        const std::string some = connection_.receive();
        if (some.empty()) {
            break;
        }
        received_ += some;
    }
    status_ = status_of(received_);
    // Key and accept value of the example in RFC 6455, section 1.3.
    if (status_ == 101 && received_.find("s3pPLMBiTxaQ9kYGzzhZRbK+xOo=") == std::string::npos) {
        throw std::runtime_error("the handshake's answer is wrong");
    }
    received_.erase(0, std::min(received_.find("\r\n\r\n"), received_.size() - 4) + 4);
}

void StreamClient::send_frame(unsigned first_byte, std::string_view payload) {
    constexpr std::string_view mask = "\x12\x34\x56\x78";
    std::string frame(1, static_cast<char>(first_byte));
    if (payload.size() < 126) {
        frame += static_cast<char>(0x80U | payload.size());
    } else {
        frame += static_cast<char>(0x80U | 126U);
        frame += static_cast<char>(payload.size() / 256);
        frame += static_cast<char>(payload.size() % 256);
    }
    frame += mask;
    for (std::size_t k = 0; k < payload.size(); ++k) {
        frame += static_cast<char>(payload[k] ^ mask[k % mask.size()]);
    }
    connection_.send(frame);
}

void StreamClient::announce_frame(unsigned first_byte, std::uint64_t length) {
    std::string frame(1, static_cast<char>(first_byte));
    frame += static_cast<char>(0x80U | 127U);
    for (int shift = 56; shift >= 0; shift -= 8) {
        frame += static_cast<char>((length >> static_cast<unsigned>(shift)) & 0xFFU);
    }
    connection_.send(frame + "mask" + std::string(64, 'x'));
}

bool StreamClient::fill(std::size_t length, int patience_ms) {
    while (received_.size() < length) {
        const std::string some = connection_.receive(patience_ms);
        if (some.empty()) {
            return false;
        }
        received_ += some;
    }
    return true;
}

std::optional<WsMessage> StreamClient::next(int patience_ms) {
    std::optional<WsMessage> message;
    while (true) {
        if (!fill(2, patience_ms)) {
            return std::nullopt;
        }
        const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(received_[k]); };
        const bool last = (byte(0) & 0x80U) != 0;
        const unsigned opcode = byte(0) & 0x0FU;
        std::size_t header = 2;
        std::uint64_t length = byte(1);  // servers do not mask
        const std::size_t more = length == 126 ? 2 : (length == 127 ? 8 : 0);
        if (!fill(header + more, patience_ms)) {
            return std::nullopt;
        }
        if (more > 0) {
            length = 0;
            for (std::size_t k = 0; k < more; ++k) {
                length = length * 256 + byte(header + k);
            }
            header += more;
        }
        if (!fill(header + length, patience_ms)) {
            return std::nullopt;
        }
        const std::string payload = received_.substr(header, length);
        received_.erase(0, header + length);
        if (opcode == 8) {
            return WsMessage{WsMessage::Kind::Close, payload};
        }
        if (opcode > 8) {
            continue;  // ping or pong
        }
        if (opcode != 0) {
            message = WsMessage{opcode == 1 ? WsMessage::Kind::Text : WsMessage::Kind::Binary, {}};
        }
        if (!message) {
            throw std::runtime_error("a message begins with a continuation");
        }
        message->bytes += payload;
        if (last) {
            return message;
        }
    }
}

std::string StreamClient::next_text(std::string_view type) {
    while (const std::optional<WsMessage> message = next()) {
        if (message->kind == WsMessage::Kind::Text && nlohmann::json::parse(message->bytes).at("type") == type) {
            return message->bytes;
        }
    }
    return {};
}

std::string StreamClient::next_binary(std::uint32_t kind) {
    while (const std::optional<WsMessage> message = next()) {
        if (message->kind == WsMessage::Kind::Binary && number_at<std::uint32_t>(message->bytes, 0) == kind) {
            return message->bytes;
        }
    }
    return {};
}

int StreamClient::close_code() {
    while (const std::optional<WsMessage> message = next()) {
        if (message->kind == WsMessage::Kind::Close) {
            return message->close_code();
        }
    }
    return 0;
}

}  // namespace haptic::sim::view::test
