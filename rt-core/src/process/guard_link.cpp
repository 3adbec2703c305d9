#include "process/guard_link.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <ctime>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "haptic/clock.hpp"
#include "haptic/spawn_settings.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kAnswerNs = 5'000'000'000;
constexpr std::int64_t kLeaveNs = 1'000'000'000;
constexpr long kGuardWaitNs = 1'000'000;
// Periods of slack that a loop has beyond the longest wait for its board.
constexpr std::int64_t kSlackPeriods = 4;
constexpr int kSocketOfGuard = 3;

}  // namespace

std::int64_t guard_silence_ns(std::int64_t setting_ns, std::int64_t exchange_bound_ns,
                              std::int64_t period_ns) noexcept {
    return std::max(setting_ns, exchange_bound_ns + kSlackPeriods * period_ns);
}

GuardLink::GuardLink(const GuardSettings& settings, const SharedSupervision& shared, const device::ZeroPacket& zero,
                     int black_box)
    : page_(&shared.page()), silence_ns_(settings.silence_ns) {
    int ends[2] = {-1, -1};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
        throw std::runtime_error("the guard's socket cannot be created: " + std::system_category().message(errno));
    }
    socket_ = ends[0];
    // As a program of its own, so that it has little memory and none of the loop's threads.
    std::vector<std::string> command = {settings.program, "guard", "--socket", std::to_string(kSocketOfGuard)};
    const std::vector<char*> arguments = spawn_arguments(command);
    SpawnSettings spawn;
    posix_spawn_file_actions_addopen(&spawn.files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&spawn.files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_adddup2(&spawn.files, ends[1], kSocketOfGuard);
    const int error =
        posix_spawn(&process_, settings.program.c_str(), &spawn.files, &spawn.attributes, arguments.data(), environ);
    close(ends[1]);
    if (error != 0) {
        close(socket_);
        throw std::runtime_error("the guard cannot be started: " + std::system_category().message(error));
    }
    try {
        begin(settings, shared, zero, black_box);
    } catch (...) {
        (void)kill(process_, SIGKILL);
        reap();
        close(socket_);
        throw;
    }
}

void GuardLink::begin(const GuardSettings& settings, const SharedSupervision& shared, const device::ZeroPacket& zero,
                      int black_box) {
    const GuardMessage message{.order = GuardOrder::Begin,
                               .priority = settings.priority,
                               .loop_cpu = settings.loop_cpu,
                               .silence_ns = settings.silence_ns,
                               .lost_ns = settings.lost_ns,
                               .zero = zero};
    const bool sent = send_message(socket_, message, {shared.descriptor(), black_box, zero.link.descriptor});
    const std::optional<GuardGrant> grant = sent ? receive_grant(socket_, kAnswerNs) : std::nullopt;
    if (!grant) {
        throw std::runtime_error("the guard process does not answer; a real device is not driven without it");
    }
    grant_ = *grant;
}

GuardLink::~GuardLink() {
    // It is about to be silent.
    page_->leave(Supervisor::Guard);
    (void)send_message(socket_, {.order = GuardOrder::Leave}, {});
    reap();
    close(socket_);
}

void GuardLink::reap() noexcept {
    const std::int64_t end_ns = monotonic_now_ns() + kLeaveNs;
    while (waitpid(process_, nullptr, WNOHANG) == 0) {
        if (monotonic_now_ns() > end_ns) {
            (void)kill(process_, SIGKILL);
        }
        const timespec wait{0, kGuardWaitNs};
        nanosleep(&wait, nullptr);
    }
}

void GuardLink::renew(const device::ZeroPacket& zero) {
    const bool sent =
        send_message(socket_, {.order = GuardOrder::Renew, .zero = zero}, {.device = zero.link.descriptor});
    if (!sent || !receive_grant(socket_, kAnswerNs)) {
        throw std::runtime_error("the guard process is gone");
    }
}

}  // namespace haptic::rt
