#include "usbredir/usbredir_server.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <span>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "served/socket_io.hpp"

namespace haptic::device {
namespace {

constexpr int kBacklog = 1;
constexpr int kEventsAtOnce = 4;

[[noreturn]] void fail(const std::string& what) {
    throw std::system_error(errno, std::generic_category(), "usbredir: " + what);
}

sockaddr_un address_of(const std::filesystem::path& path) {
    check_socket_path(path);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.c_str(), path.native().size() + 1);
    return address;
}

/// Removes a socket that a killed server left. One that somebody listens at, and any other file, stays.
void remove_stale(const std::filesystem::path& path, const sockaddr_un& address) {
    struct stat status{};
    if (lstat(path.c_str(), &status) != 0 || !S_ISSOCK(status.st_mode)) {
        return;
    }
    const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (probe < 0) {
        return;
    }
    const bool stale =
        connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 && errno == ECONNREFUSED;
    close(probe);
    if (stale) {
        unlink(path.c_str());
    }
}

/// Returns -1 with errno on failure.
int listen_at(const std::filesystem::path& path) {
    const sockaddr_un address = address_of(path);
    remove_stale(path, address);
    const int listener = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (listener < 0) {
        return -1;
    }
    if (bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        listen(listener, kBacklog) != 0) {
        const int error = errno;
        close(listener);
        errno = error;
        return -1;
    }
    return listener;
}

}  // namespace

void check_socket_path(const std::filesystem::path& path) {
    constexpr std::size_t longest = sizeof sockaddr_un::sun_path - 1;
    if (path.empty() || path.native().size() > longest) {
        throw std::invalid_argument("'" + path.string() + "': the path of a socket has 1 to " +
                                    std::to_string(longest) + " characters");
    }
}

UsbredirServer::UsbredirServer(const std::filesystem::path& path, BoardKind kind, Firmware& firmware, UsbSpeed speed,
                               Report report)
    : report_(std::move(report)), device_(kind, firmware, speed), path_(path), buffer_(kReadBytes) {
    listener_ = listen_at(path);
    if (listener_ < 0) {
        fail("cannot listen at " + path.string());
    }
    epoll_ = epoll_create1(EPOLL_CLOEXEC);
    epoll_event event{.events = EPOLLIN, .data = {.fd = listener_}};
    if (epoll_ < 0 || epoll_ctl(epoll_, EPOLL_CTL_ADD, listener_, &event) != 0) {
        const int error = errno;
        ::close(listener_);
        unlink(path_.c_str());
        if (epoll_ >= 0) {
            ::close(epoll_);
        }
        errno = error;
        fail("cannot wait for guests");
    }
}

UsbredirServer::~UsbredirServer() {
    if (guest_ >= 0) {
        ::close(guest_);
    }
    ::close(listener_);
    ::close(epoll_);
    unlink(path_.c_str());
}

std::optional<std::int64_t> UsbredirServer::due_ns() const {
    if (!session_) {
        return std::nullopt;
    }
    return now_ns_ + (session_->waits_for_firmware() ? kUsbPollNs : kCablePollNs);
}

void UsbredirServer::step(std::int64_t now_ns) {
    now_ns_ = now_ns;
    update_cable(now_ns);
    std::array<epoll_event, kEventsAtOnce> events{};
    const int count = epoll_wait(epoll_, events.data(), kEventsAtOnce, 0);
    for (int i = 0; i < count; ++i) {
        if (events[static_cast<std::size_t>(i)].data.fd == listener_) {
            accept_guests();
        } else {
            read(now_ns);
        }
    }
    update_cable(now_ns);  // handling a packet may have unplugged it
    if (session_) {
        session_->complete_pending(now_ns);
        write(*session_);
    }
}

void UsbredirServer::accept_guests() {
    while (true) {
        const int socket = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (socket < 0) {
            if (errno == EINTR || errno == ECONNABORTED) {
                continue;
            }
            return;  // EAGAIN: no more guests
        }
        if (session_) {
            ::close(socket);
            report_("another guest refused: the device has one already");
            continue;
        }
        guest_ = socket;
        guest_events_ = EPOLLIN;
        epoll_event event{.events = guest_events_, .data = {.fd = guest_}};
        if (epoll_ctl(epoll_, EPOLL_CTL_ADD, guest_, &event) != 0) {
            ::close(std::exchange(guest_, -1));
            return;
        }
        session_.emplace(device_, plugged_);
        report_("a guest has connected");
    }
}

void UsbredirServer::read(std::int64_t now_ns) {
    // The listener and the guest may be in one batch of events, and the guest gone already.
    if (!session_ || (guest_events_ & EPOLLIN) == 0) {
        return;
    }
    const ssize_t count = recv(guest_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (count > 0) {
        session_->receive(std::span<const std::byte>(buffer_).first(static_cast<std::size_t>(count)), now_ns);
        return;
    }
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) {
        return;
    }
    close_guest(count == 0 ? "closed the connection" : std::generic_category().message(errno));
}

void UsbredirServer::write(UsbredirSession& session) {
    if (const int error = send_some(guest_, session.output()); error != 0) {
        close_guest(std::generic_category().message(error));
        return;
    }
    if (session.ended()) {
        close_guest(session.reason());
        return;
    }
    // Back-pressure: stop reading while too much output is unsent.
    const std::size_t unsent = session.output().size();
    const std::uint32_t events = (unsent < kMaxUnsent ? EPOLLIN : 0U) | (unsent > 0 ? EPOLLOUT : 0U);
    if (events != guest_events_) {
        guest_events_ = events;
        epoll_event event{.events = events, .data = {.fd = guest_}};
        epoll_ctl(epoll_, EPOLL_CTL_MOD, guest_, &event);
    }
}

void UsbredirServer::close_guest(std::string_view reason) {
    report_("the guest is gone: " + std::string(reason));
    session_.reset();
    ::close(std::exchange(guest_, -1));  // also removes it from the epoll instance
}

void UsbredirServer::update_cable(std::int64_t now_ns) {
    const bool plugged = device_.plugged(now_ns);
    if (plugged == plugged_) {
        return;
    }
    plugged_ = plugged;
    report_(plugged ? "plugged in" : "unplugged");
    if (session_) {
        session_->set_plugged(plugged);
    }
}

}  // namespace haptic::device
