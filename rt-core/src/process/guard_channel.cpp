#include "process/guard_channel.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <type_traits>

#include "haptic/clock.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

constexpr std::size_t kMaxDescriptors = 3;
constexpr std::uint32_t kHasPage = 1U << 0;
constexpr std::uint32_t kHasBlackBox = 1U << 1;
constexpr std::uint32_t kHasDevice = 1U << 2;

/// A message as it travels: which descriptors come with it.
struct Envelope {
    std::uint32_t present = 0;
    GuardMessage message;
};
static_assert(std::is_trivially_copyable_v<Envelope> && std::is_trivially_copyable_v<GuardGrant>);

struct ControlBuffer {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(kMaxDescriptors * sizeof(int))> bytes{};
};

}  // namespace

bool send_message(int socket, const GuardMessage& message, const GuardDescriptors& descriptors) noexcept {
    Envelope envelope{.message = message};
    std::array<int, kMaxDescriptors> sent{};
    std::size_t count = 0;
    const auto add = [&](int descriptor, std::uint32_t bit) {
        if (descriptor >= 0) {
            envelope.present |= bit;
            sent[count++] = descriptor;
        }
    };
    add(descriptors.page, kHasPage);
    add(descriptors.black_box, kHasBlackBox);
    add(descriptors.device, kHasDevice);
    iovec data{&envelope, sizeof envelope};
    msghdr header{};
    header.msg_iov = &data;
    header.msg_iovlen = 1;
    ControlBuffer control;
    if (count > 0) {
        header.msg_control = control.bytes.data();
        header.msg_controllen = CMSG_SPACE(count * sizeof(int));
        cmsghdr* const part = CMSG_FIRSTHDR(&header);
        part->cmsg_level = SOL_SOCKET;
        part->cmsg_type = SCM_RIGHTS;
        part->cmsg_len = CMSG_LEN(count * sizeof(int));
        std::memcpy(CMSG_DATA(part), sent.data(), count * sizeof(int));
    }
    return sendmsg(socket, &header, MSG_NOSIGNAL) == static_cast<ssize_t>(sizeof envelope);
}

Received receive_message(int socket, GuardMessage& message, GuardDescriptors& descriptors) noexcept {
    Envelope envelope;
    iovec data{&envelope, sizeof envelope};
    ControlBuffer control;
    msghdr header{};
    header.msg_iov = &data;
    header.msg_iovlen = 1;
    header.msg_control = control.bytes.data();
    header.msg_controllen = control.bytes.size();
    const ssize_t count = recvmsg(socket, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) {
        return Received::Nothing;
    }
    if (count != static_cast<ssize_t>(sizeof envelope)) {
        return Received::Ended;
    }
    std::array<int, kMaxDescriptors> received{-1, -1, -1};
    const cmsghdr* const part = CMSG_FIRSTHDR(&header);
    if (part != nullptr && part->cmsg_type == SCM_RIGHTS) {
        std::memcpy(received.data(), CMSG_DATA(part), part->cmsg_len - CMSG_LEN(0));
    }
    std::size_t next = 0;
    const auto take = [&](std::uint32_t bit) { return (envelope.present & bit) != 0 ? received[next++] : -1; };
    descriptors.page = take(kHasPage);
    descriptors.black_box = take(kHasBlackBox);
    descriptors.device = take(kHasDevice);
    message = envelope.message;
    return Received::Message;
}

bool send_grant(int socket, const GuardGrant& grant) noexcept {
    return send(socket, &grant, sizeof grant, MSG_NOSIGNAL) == static_cast<ssize_t>(sizeof grant);
}

std::optional<GuardGrant> receive_grant(int socket, std::int64_t max_wait_ns) noexcept {
    const std::int64_t end_ns = monotonic_now_ns() + max_wait_ns;
    for (std::int64_t left_ns = max_wait_ns; left_ns > 0; left_ns = end_ns - monotonic_now_ns()) {
        pollfd watched{socket, POLLIN, 0};
        if (poll(&watched, 1, static_cast<int>(left_ns / 1'000'000) + 1) <= 0) {
            continue;  // a signal, or the time is over
        }
        GuardGrant grant;
        const bool whole = recv(socket, &grant, sizeof grant, 0) == static_cast<ssize_t>(sizeof grant);
        return whole ? std::optional(grant) : std::nullopt;
    }
    return std::nullopt;
}

}  // namespace haptic::rt
