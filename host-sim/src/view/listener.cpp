#include "view/listener.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <stdexcept>
#include <system_error>

namespace haptic::sim::view {
namespace {

constexpr int kBacklog = 64;

/// Throws an error with advice for the likely causes.
[[noreturn]] void refuse(const std::string& address, std::uint16_t port, int error) {
    std::string advice;
    if (error == EADDRINUSE) {
        advice =
            "; another program has this port (another host-sim? ss -ltnp says which): end it, or give another "
            "port, e.g. --view " +
            std::to_string(port + 1);
    } else if (error == EADDRNOTAVAIL) {
        advice = "; this machine does not have that address: ip address lists those that it has";
    } else if (error == EACCES) {
        advice = "; ports below 1024 need root: choose another";
    }
    throw std::runtime_error("--view: cannot listen on " + address + ", port " + std::to_string(port) + ": " +
                             std::generic_category().message(error) + advice);
}

}  // namespace

int listen_on(const std::string& address, std::uint16_t port) {
    // Numeric addresses only: no name lookup, IPv4 or IPv6.
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) {
        throw std::runtime_error("--view: " + address +
                                 " is not an IP address; give one of this machine, e.g. 127.0.0.1");
    }
    const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> owner(found, freeaddrinfo);
    const int socket = ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (socket < 0) {
        refuse(address, port, errno);
    }
    // SO_REUSEADDR: a restarted host-sim gets its port while connections of the previous one are in TIME_WAIT.
    const int yes = 1;
    (void)setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    if (bind(socket, found->ai_addr, found->ai_addrlen) != 0 || listen(socket, kBacklog) != 0) {
        const int error = errno;
        (void)close(socket);
        refuse(address, port, error);
    }
    return socket;
}

std::uint16_t port_of(int socket) {
    sockaddr_storage name{};
    socklen_t length = sizeof(name);
    if (getsockname(socket, reinterpret_cast<sockaddr*>(&name), &length) != 0) {
        throw std::system_error(errno, std::generic_category(), "getsockname");
    }
    // IPv4 and IPv6 addresses have the port at the same offset.
    static_assert(offsetof(sockaddr_in, sin_port) == offsetof(sockaddr_in6, sin6_port));
    return ntohs(reinterpret_cast<const sockaddr_in*>(&name)->sin_port);
}

}  // namespace haptic::sim::view
