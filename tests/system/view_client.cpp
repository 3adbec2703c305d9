#include "view_client.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace haptic::test {
namespace {

constexpr std::string_view kEndOfHead = "\r\n\r\n";
// RFC 6455, section 5.2.
constexpr unsigned kFinal = 0x80;
constexpr unsigned kOpcode = 0x0F;
constexpr unsigned kMasked = 0x80;
constexpr unsigned kText = 1;
constexpr unsigned kBinary = 2;
constexpr unsigned kClose = 8;
constexpr unsigned kPing = 9;
constexpr unsigned kPong = 10;

template <class Value>
Value value_at(std::string_view bytes, std::size_t offset) {
    Value value{};
    if (offset + sizeof value <= bytes.size()) {
        std::memcpy(&value, bytes.data() + offset, sizeof value);
    }
    return value;
}

std::uint64_t big_endian(std::string_view bytes) {
    std::uint64_t value = 0;
    for (const char byte : bytes) {
        value = value << 8 | static_cast<unsigned char>(byte);
    }
    return value;
}

/// Client fragments are masked; a mask of zeros is valid.
std::string fragment(unsigned opcode, std::string_view content) {
    std::string bytes;
    bytes += static_cast<char>(kFinal | opcode);
    if (content.size() < 126) {
        bytes += static_cast<char>(kMasked | content.size());
    } else {
        bytes += static_cast<char>(kMasked | 126u);
        bytes += static_cast<char>(content.size() >> 8 & 0xFF);
        bytes += static_cast<char>(content.size() & 0xFF);
    }
    bytes.append(4, '\0');
    return bytes.append(content);
}

/// The value of "type", which host-sim writes without escapes.
std::string type_of(std::string_view json) {
    constexpr std::string_view key = "\"type\":\"";
    const std::size_t begin = json.find(key);
    if (begin == std::string_view::npos) {
        return "";
    }
    const std::string_view rest = json.substr(begin + key.size());
    return std::string(rest.substr(0, rest.find('"')));
}

}  // namespace

Socket::Socket(std::uint16_t port, int receive_buffer) {
    fd_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (receive_buffer > 0) {
        setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (fd_ < 0 || ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
        const int error = errno;
        ::close(fd_);
        throw std::system_error(error, std::generic_category(), "cannot connect to port " + std::to_string(port));
    }
    fcntl(fd_, F_SETFL, O_NONBLOCK);
}

Socket::~Socket() {
    ::close(fd_);
}

bool Socket::send(std::string_view bytes) const {
    const ssize_t sent = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    return sent >= 0 || errno == EAGAIN || errno == EWOULDBLOCK;
}

bool Socket::receive(std::string& bytes) const {
    std::array<char, 65536> buffer;
    while (true) {
        const ssize_t count = ::recv(fd_, buffer.data(), buffer.size(), 0);
        if (count > 0) {
            bytes.append(buffer.data(), static_cast<std::size_t>(count));
        } else if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
            return false;
        } else if (errno != EINTR) {
            return true;
        }
    }
}

void Socket::reset() {
    const linger at_once{.l_onoff = 1, .l_linger = 0};
    setsockopt(fd_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    ::close(fd_);
    fd_ = -1;
}

ViewClient::ViewClient(std::uint16_t port, int receive_buffer) : socket_(port, receive_buffer) {
    const std::string host = "127.0.0.1:" + std::to_string(port);
    // The key of RFC 6455's example; this test does not check the answer to it.
    socket_.send("GET /stream HTTP/1.1\r\nHost: " + host + "\r\nOrigin: http://" + host +
                 "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                 "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: haptic-view-1\r\n\r\n");
}

std::uint64_t ViewClient::count(const std::string& type) const {
    const auto found = counts_.find(type);
    return found == counts_.end() ? 0 : found->second;
}

std::string ViewClient::newest(const std::string& type) const {
    const auto found = texts_.find(type);
    return found == texts_.end() ? "" : found->second;
}

bool ViewClient::say(std::string_view text) {
    return socket_.send(fragment(kText, text));
}

void ViewClient::take() {
    if (closed_) {
        return;
    }
    const std::size_t before = in_.size();
    const bool more = socket_.receive(in_);
    bytes_ += in_.size() - before;
    if (status_ == 0) {
        take_head();
    }
    while (status_ == 101 && take_fragment()) {
    }
    closed_ = closed_ || !more;
}

void ViewClient::take_head() {
    const std::size_t end = in_.find(kEndOfHead);
    if (end != std::string::npos) {
        // "HTTP/1.1 101 Switching Protocols"
        status_ = std::atoi(in_.substr(in_.find(' ') + 1, 3).c_str());
        in_.erase(0, end + kEndOfHead.size());
    }
}

bool ViewClient::take_fragment() {
    const std::string_view bytes = in_;
    if (bytes.size() < 2) {
        return false;
    }
    const unsigned first = static_cast<unsigned char>(bytes[0]);
    std::uint64_t length = static_cast<unsigned char>(bytes[1]) & 0x7F;
    std::size_t head = 2;
    if (length >= 126) {
        const std::size_t width = length == 126 ? 2 : 8;
        if (bytes.size() < head + width) {
            return false;
        }
        length = big_endian(bytes.substr(head, width));
        head += width;
    }
    if (bytes.size() < head + length) {
        return false;
    }
    const std::string_view content = bytes.substr(head, length);
    switch (first & kOpcode) {
        case kClose:
            close_code_ = static_cast<int>(big_endian(content.substr(0, 2)));
            socket_.send(fragment(kClose, content.substr(0, 2)));
            closed_ = true;
            break;
        case kPing:
            socket_.send(fragment(kPong, content));
            break;
        case kPong:
            break;
        case kText:
        case kBinary:
            text_ = (first & kOpcode) == kText;
            message_.clear();
            [[fallthrough]];
        default:
            message_ += content;
            if ((first & kFinal) != 0) {
                take_message();
            }
    }
    in_.erase(0, head + length);
    return true;
}

void ViewClient::take_message() {
    if (text_) {
        const std::string type = type_of(message_);
        texts_[type] = message_;
        counts_[type] += 1;
        return;
    }
    const auto kind = value_at<std::uint32_t>(message_, 0);
    counts_[kind == 1 ? "geometry" : kind == 2 ? "frame" : kind == 3 ? "samples" : "unknown"] += 1;
    if (kind == 2) {
        time_ = value_at<double>(message_, 8);
        step_ = value_at<double>(message_, 16);
    }
}

bool take_until(const std::vector<ViewClient*>& clients, std::chrono::milliseconds time,
                const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + time;
    std::vector<pollfd> waiting;
    while (!condition()) {
        if (std::chrono::steady_clock::now() >= end) {
            return false;
        }
        waiting.clear();
        for (const ViewClient* const client : clients) {
            if (!client->closed()) {
                waiting.push_back({.fd = client->socket().descriptor(), .events = POLLIN, .revents = 0});
            }
        }
        poll(waiting.data(), waiting.size(), 5);
        for (ViewClient* const client : clients) {
            client->take();
        }
    }
    return true;
}

std::optional<std::uint16_t> view_port_in(const std::string& output) {
    constexpr std::string_view before = "http://127.0.0.1:";
    const std::size_t begin = output.find(before);
    if (begin == std::string::npos) {
        return std::nullopt;
    }
    const int port = std::atoi(output.c_str() + begin + before.size());
    return port > 0 && port < 65536 ? std::optional(static_cast<std::uint16_t>(port)) : std::nullopt;
}

std::size_t open_descriptors(int pid) {
    const std::filesystem::directory_iterator all("/proc/" + std::to_string(pid) + "/fd");
    return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

std::size_t resident_bytes(int pid) {
    std::ifstream file("/proc/" + std::to_string(pid) + "/statm");
    std::size_t size = 0;
    std::size_t resident = 0;
    file >> size >> resident;
    return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace haptic::test
