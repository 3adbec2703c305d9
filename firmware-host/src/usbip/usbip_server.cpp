#include "usbip/usbip_server.hpp"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <memory>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "served/socket_io.hpp"

namespace haptic::device {
namespace {

constexpr int kBacklog = 16;
constexpr int kEventsAtOnce = 32;
// s; TCP keep-alive, so that a machine that disappeared without closing loses the device.
constexpr int kKeepAliveIdle = 5;
constexpr int kKeepAliveInterval = 1;
constexpr int kKeepAliveCount = 5;
constexpr unsigned kUserTimeoutMs = 10'000;

struct FreeAddresses {
    void operator()(addrinfo* list) const noexcept { freeaddrinfo(list); }
};
using Addresses = std::unique_ptr<addrinfo, FreeAddresses>;

[[noreturn]] void fail(const std::string& what) {
    throw std::system_error(errno, std::generic_category(), "usbip: " + what);
}

std::string text_of(const NetworkAddress& address) {
    const bool v6 = address.host.find(':') != std::string::npos;
    return (v6 ? "[" + address.host + "]" : address.host) + ":" + std::to_string(address.port);
}

Addresses resolve(const NetworkAddress& address) {
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
    addrinfo* list = nullptr;
    const int error = getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &list);
    if (error != 0) {
        throw std::invalid_argument("usbip: '" + address.host +
                                    "' is not an address of this machine: " + gai_strerror(error));
    }
    return Addresses(list);
}

/// The numeric form of a socket's address.
NetworkAddress name_of(const sockaddr_storage& storage, socklen_t size) {
    std::array<char, NI_MAXHOST> host{};
    std::array<char, NI_MAXSERV> service{};
    const auto* generic = reinterpret_cast<const sockaddr*>(&storage);
    NetworkAddress name;
    if (getnameinfo(generic, size, host.data(), host.size(), service.data(), service.size(),
                    NI_NUMERICHOST | NI_NUMERICSERV) == 0) {
        name.host = host.data();
        const std::string_view port(service.data());
        std::from_chars(port.data(), port.data() + port.size(), name.port);
    }
    return name;
}

void set_option(int socket, int level, int name, unsigned value) {
    // Failure is ignored: these options are improvements, not requirements.
    static_cast<void>(setsockopt(socket, level, name, &value, sizeof value));
}

/// Listens on the first available address of a list. Returns -1 with the errno of the last one on failure.
int listen_on(const addrinfo* list) {
    int socket = -1;
    for (const addrinfo* each = list; each != nullptr && socket < 0; each = each->ai_next) {
        socket = ::socket(each->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        if (socket < 0) {
            continue;
        }
        set_option(socket, SOL_SOCKET, SO_REUSEADDR, 1);
        if (bind(socket, each->ai_addr, each->ai_addrlen) != 0 || listen(socket, kBacklog) != 0) {
            const int error = errno;
            ::close(socket);
            socket = -1;
            errno = error;
        }
    }
    return socket;
}

}  // namespace

NetworkAddress parse_network_address(std::string_view text) {
    const auto wrong = [&](const std::string& what) {
        return std::invalid_argument("'" + std::string(text) + "' " + what + "; an address is HOST:PORT, " +
                                     "for example 127.0.0.1:3240 or [::1]:3240");
    };
    const std::size_t colon = text.rfind(':');
    if (colon == std::string_view::npos) {
        throw wrong("has no port");
    }
    std::string_view host = text.substr(0, colon);
    const std::string_view port = text.substr(colon + 1);
    if (host.starts_with('[') && host.ends_with(']')) {
        host = host.substr(1, host.size() - 2);
    } else if (host.find(':') != std::string_view::npos) {
        throw wrong("has more than one colon");
    }
    if (host.empty()) {
        throw wrong("has no host");
    }
    NetworkAddress address{std::string(host), 0};
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
    if (error != std::errc{} || end != port.data() + port.size()) {
        throw wrong("has no port between 0 and 65535");
    }
    return address;
}

UsbipServer::UsbipServer(const NetworkAddress& address, BoardKind kind, Firmware& firmware, UsbSpeed speed,
                         Report report)
    : report_(std::move(report)),
      firmware_(&firmware),
      exported_(kind, firmware, speed),
      address_(address),
      buffer_(kReadBytes) {
    const Addresses list = resolve(address);
    epoll_ = epoll_create1(EPOLL_CLOEXEC);
    if (epoll_ < 0) {
        fail("cannot make an epoll instance");
    }
    listener_ = listen_on(list.get());
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.ptr = nullptr;  // nullptr: the listener; otherwise the Client
    if (listener_ < 0 || epoll_ctl(epoll_, EPOLL_CTL_ADD, listener_, &event) != 0) {
        const int error = errno;
        ::close(epoll_);
        errno = error;
        fail("cannot listen on " + text_of(address));
    }
    sockaddr_storage storage{};
    socklen_t size = sizeof storage;
    if (getsockname(listener_, reinterpret_cast<sockaddr*>(&storage), &size) == 0) {
        address_ = name_of(storage, size);
    }
}

UsbipServer::~UsbipServer() {
    for (const Client& client : clients_) {
        ::close(client.socket);
    }
    ::close(listener_);
    ::close(epoll_);
}

std::optional<std::int64_t> UsbipServer::due_ns() const {
    std::optional<std::int64_t> due;
    for (const Client& client : clients_) {
        if (client.session.waits_for_firmware()) {
            due = std::min(due.value_or(INT64_MAX), now_ns_ + kUsbPollNs);
        }
        if (!client.imported) {
            due = std::min(due.value_or(INT64_MAX), client.since_ns + kImportTimeoutNs);
        }
    }
    return due;
}

void UsbipServer::step(std::int64_t now_ns) {
    now_ns_ = now_ns;
    update_cable(now_ns);
    // Accept and read.
    std::array<epoll_event, kEventsAtOnce> events{};
    const int count = epoll_wait(epoll_, events.data(), kEventsAtOnce, 0);
    for (int i = 0; i < count; ++i) {
        auto* client = static_cast<Client*>(events[static_cast<std::size_t>(i)].data.ptr);
        if (client == nullptr) {
            accept_clients(now_ns);
        } else {
            read_from(*client, now_ns);
        }
    }
    update_cable(now_ns);  // handling a packet may have unplugged it
    // Complete, time out and write. `next` is taken first, because both may erase the client.
    for (auto client = clients_.begin(); client != clients_.end();) {
        const auto next = std::next(client);
        client->session.complete_pending(now_ns);
        if (!client->imported && now_ns - client->since_ns >= kImportTimeoutNs) {
            close(client, client->session.ended() ? "did not read its reply" : "sent no request for 10 s");
        } else {
            write_to(client);
        }
        client = next;
    }
}

void UsbipServer::accept_clients(std::int64_t now_ns) {
    while (true) {
        sockaddr_storage storage{};
        socklen_t size = sizeof storage;
        const int socket =
            accept4(listener_, reinterpret_cast<sockaddr*>(&storage), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (socket < 0) {
            if (errno == EINTR || errno == ECONNABORTED) {
                continue;
            }
            return;  // EAGAIN: no more clients. Out of descriptors: they stay in the backlog
        }
        const std::string name = text_of(name_of(storage, size));
        if (clients_.size() >= kMaxClients) {
            ::close(socket);
            report_(name + " refused: " + std::to_string(kMaxClients) + " clients are connected already");
            continue;
        }
        // No delay for small packets; detect a client that disappeared.
        set_option(socket, IPPROTO_TCP, TCP_NODELAY, 1);
        set_option(socket, SOL_SOCKET, SO_KEEPALIVE, 1);
        set_option(socket, IPPROTO_TCP, TCP_KEEPIDLE, kKeepAliveIdle);
        set_option(socket, IPPROTO_TCP, TCP_KEEPINTVL, kKeepAliveInterval);
        set_option(socket, IPPROTO_TCP, TCP_KEEPCNT, kKeepAliveCount);
        set_option(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, kUserTimeoutMs);
        Client& client = clients_.emplace_back(socket, name, now_ns, exported_);
        epoll_event event{};
        event.events = EPOLLIN;
        event.data.ptr = &client;
        if (epoll_ctl(epoll_, EPOLL_CTL_ADD, socket, &event) != 0) {
            ::close(socket);
            clients_.pop_back();
        }
    }
}

void UsbipServer::read_from(Client& client, std::int64_t now_ns) {
    if (!client.reading || client.session.ended()) {
        return;
    }
    const ssize_t count = recv(client.socket, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (count > 0) {
        client.session.receive(std::span<const std::byte>(buffer_).first(static_cast<std::size_t>(count)), now_ns);
        if (client.session.owns_device() && !client.imported) {
            client.imported = true;
            report_("imported by " + client.name);
        }
        return;
    }
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) {
        return;
    }
    const std::string reason = count == 0 ? "closed the connection" : std::generic_category().message(errno);
    client.session.drop(reason);
}

void UsbipServer::write_to(std::list<Client>::iterator client) {
    std::vector<std::byte>& output = client->session.output();
    if (const int error = send_some(client->socket, output); error != 0) {
        close(client, std::generic_category().message(error));
        return;
    }
    // An ended session is closed once its output is sent; one that owned the device immediately, to release the device.
    if (client->session.ended() && (output.empty() || client->imported)) {
        close(client, client->session.reason());
        return;
    }
    watch(*client);
}

void UsbipServer::watch(Client& client) {
    // Back-pressure: stop reading while too much output is unsent.
    const std::size_t unsent = client.session.output().size();
    const bool wants_to_send = unsent > 0;
    const bool reading = unsent < kMaxUnsent && !client.session.ended();
    if (wants_to_send == client.wants_to_send && reading == client.reading) {
        return;
    }
    client.wants_to_send = wants_to_send;
    client.reading = reading;
    epoll_event event{};
    event.events = (reading ? EPOLLIN : 0U) | (wants_to_send ? EPOLLOUT : 0U);
    event.data.ptr = &client;
    epoll_ctl(epoll_, EPOLL_CTL_MOD, client.socket, &event);
}

void UsbipServer::close(std::list<Client>::iterator client, std::string_view reason) {
    ::close(client->socket);  // also removes it from the epoll instance
    std::string line = client->name;
    if (client->imported) {
        line += " has lost the device";
    }
    if (client->imported || !reason.empty()) {
        line += reason.empty() ? "" : ": " + std::string(reason);
        report_(line);
    }
    clients_.erase(client);
}

void UsbipServer::update_cable(std::int64_t now_ns) {
    const bool plugged = firmware_->connected(now_ns);
    if (plugged == exported_.plugged) {
        return;
    }
    exported_.plugged = plugged;
    report_(plugged ? "plugged in" : "unplugged");
    for (auto client = clients_.begin(); client != clients_.end();) {
        const auto next = std::next(client);
        if (!plugged && client->imported) {
            close(client, "unplugged");
        }
        client = next;
    }
}

}  // namespace haptic::device
