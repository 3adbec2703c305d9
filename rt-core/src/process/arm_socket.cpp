#include "process/arm_socket.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "haptic/clock.hpp"
#include "haptic/other_users.hpp"
#include "haptic/ring.hpp"

namespace haptic::rt {
namespace {

constexpr std::size_t kMaxClients = 8;
constexpr std::int64_t kPatienceNs = 1'000'000'000;  // ns, for the question of a client
constexpr long kAnswerSeconds = 2;                   // s, for an answer
constexpr std::size_t kMaxBytes = 1024;              // of a packet

// First character of an answer.
constexpr char kDone = '+';
constexpr char kRefused = '-';

[[noreturn]] void fail(const std::string& problem, int error) {
    throw std::runtime_error(problem + ": " + std::generic_category().message(error));
}

sockaddr_un address_of(const std::filesystem::path& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string& text = path.native();
    if (text.size() >= sizeof address.sun_path) {
        throw std::runtime_error("the name of the session is too long for a socket: " + text);
    }
    std::memcpy(address.sun_path, text.data(), text.size());
    return address;
}

/// Whether the process at the other end runs as this user, by the kernel's word.
bool is_same_user(int descriptor) {
    ucred peer{};
    socklen_t size = sizeof peer;
    return getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && peer.uid == geteuid();
}

std::string_view word_of(ArmQuestion question) {
    return question == ArmQuestion::Arm ? "arm" : "state";
}

void send_answer(int descriptor, const ArmAnswer& answer) {
    const std::string packet = (answer.done ? kDone : kRefused) + answer.text.substr(0, kMaxBytes - 1);
    // A client that is gone needs no answer.
    (void)send(descriptor, packet.data(), packet.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

}  // namespace

std::filesystem::path arm_socket_path(const std::string& session) {
    (void)ring_segment_name(session, RingKind::State);  // refuses a bad name
    return "/dev/shm/haptic-" + std::to_string(geteuid()) + "-" + session + "-arm";
}

ArmServer::ArmServer(const std::string& session) : path_(arm_socket_path(session)) {
    const sockaddr_un address = address_of(path_);
    listener_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (listener_ < 0) {
        fail("a socket cannot be opened", errno);
    }
    (void)unlink(path_.c_str());
    // Nobody else may connect, not even between bind() and listen(): other users fail at the mode.
    const mode_t mask = umask(S_IXUSR | S_IRWXG | S_IRWXO);
    const bool bound = bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                       listen(listener_, static_cast<int>(kMaxClients)) == 0;
    const int error = errno;
    umask(mask);
    if (!bound) {
        close(listener_);
        fail("the socket " + path_.native() + " cannot be opened; remove it if it belongs to another user", error);
    }
}

ArmServer::~ArmServer() {
    for (const Client& client : clients_) {
        close(client.descriptor);
    }
    close(listener_);
    (void)unlink(path_.c_str());
}

void ArmServer::accept_clients() {
    // accept4() allocates a socket even if no client is waiting, and the kernel frees it through RCU, whose grace
    // periods keep the scheduler's tick alive; so ask first.
    pollfd listener{.fd = listener_, .events = POLLIN, .revents = 0};
    while (clients_.size() < kMaxClients && ::poll(&listener, 1, 0) > 0) {
        const int descriptor = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (descriptor < 0) {
            return;  // none is waiting
        }
        if (is_same_user(descriptor)) {
            clients_.push_back({descriptor, monotonic_now_ns()});
        } else {
            send_answer(descriptor, {.done = false, .text = "another user's session"});
            close(descriptor);
        }
    }
}

bool ArmServer::serve(const Client& client, const std::function<ArmAnswer(ArmQuestion)>& answer) {
    std::array<char, kMaxBytes> packet{};
    const ssize_t size = recv(client.descriptor, packet.data(), packet.size(), 0);
    if (size < 0 && (errno == EAGAIN || errno == EINTR) && monotonic_now_ns() - client.since_ns < kPatienceNs) {
        return false;  // has not asked yet
    }
    if (size > 0) {
        const std::string_view asked(packet.data(), static_cast<std::size_t>(size));
        if (asked == word_of(ArmQuestion::Arm)) {
            send_answer(client.descriptor, answer(ArmQuestion::Arm));
        } else if (asked == word_of(ArmQuestion::State)) {
            send_answer(client.descriptor, answer(ArmQuestion::State));
        } else {
            send_answer(client.descriptor, {.done = false, .text = "this rt-core does not know the question"});
        }
    }
    close(client.descriptor);
    return true;
}

void ArmServer::poll(const std::function<ArmAnswer(ArmQuestion)>& answer) {
    accept_clients();
    std::erase_if(clients_, [&](const Client& client) { return serve(client, answer); });
}

ArmAnswer ask_session(const std::string& session, ArmQuestion question) {
    const std::filesystem::path path = arm_socket_path(session);
    const sockaddr_un address = address_of(path);
    const int descriptor = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (descriptor < 0) {
        fail("a socket cannot be opened", errno);
    }
    const timeval patience{.tv_sec = kAnswerSeconds, .tv_usec = 0};
    setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(descriptor, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    // Ask, and wait for the answer.
    std::array<char, kMaxBytes> packet{};
    const std::string_view word = word_of(question);
    ssize_t size = -1;
    const bool connected = connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    if (connected && send(descriptor, word.data(), word.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(word.size())) {
        size = recv(descriptor, packet.data(), packet.size(), 0);
    }
    const int error = errno;
    close(descriptor);
    if (!connected && (error == ENOENT || error == ECONNREFUSED)) {
        const std::string others = describe_other_users(session);
        throw std::runtime_error("no rt-core runs in session \"" + session + "\" as this user" +
                                 (others.empty() ? "" : "; " + others));
    }
    if (size <= 0) {
        fail("the rt-core of session \"" + session + "\" does not answer", size == 0 ? ECONNRESET : error);
    }
    return {.done = packet[0] == kDone, .text = std::string(packet.data() + 1, static_cast<std::size_t>(size) - 1)};
}

}  // namespace haptic::rt
