#include "process/guard.hpp"

#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <ctime>
#include <fstream>
#include <stdexcept>

#include "haptic/clock.hpp"
#include "haptic/types.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {
namespace {

// ns after the first zeros at which they are sent again: a command of the loop may still be on its way.
constexpr std::array<std::int64_t, 5> kRepeatsNs = {1'000'000, 3'000'000, 10'000'000, 20'000'000, 40'000'000};
// Zeros to a frozen loop's motors: soon again, then now and then, in case something else writes to the device.
constexpr std::int64_t kResendSoonNs = 2'000'000;
constexpr std::int64_t kResendNs = 50'000'000;
constexpr int kSoon = 4;

/// Waits until the socket has something or a time is reached.
void wait_until(int socket, std::int64_t time_ns) noexcept {
    const std::int64_t left_ns = std::max<std::int64_t>(time_ns - monotonic_now_ns(), 0);
    const timespec left{left_ns / kNanosecondsPerSecond, left_ns % kNanosecondsPerSecond};
    pollfd watched{socket, POLLIN, 0};
    (void)ppoll(&watched, 1, &left, nullptr);
}

void sleep_until_time(std::int64_t time_ns) noexcept {
    const timespec time{time_ns / kNanosecondsPerSecond, time_ns % kNanosecondsPerSecond};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
    }
}

/// The lowest score that the kernel allows; a unit may have set one already.
int lower_oom_score() {
    constexpr const char* file = "/proc/self/oom_score_adj";
    for (const int wanted : {-1000, -900, -500}) {
        std::ofstream stream(file);
        if (stream << wanted << std::flush) {
            break;
        }
    }
    int score = 0;
    std::ifstream(file) >> score;
    return score;
}

}  // namespace

GuardGrant protect_guard(int priority, int loop_cpu) {
    (void)prctl(PR_SET_NAME, "rt-core-guard");
    // Neither a terminal nor a stop that is meant for the loop reaches it. Leaving is the loop's decision.
    (void)setsid();
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP, SIGPIPE, SIGUSR1, SIGUSR2, SIGALRM}) {
        (void)std::signal(signal, SIG_IGN);
    }
    GuardGrant grant;
    grant.process = getpid();
    grant.oom_score_adj = lower_oom_score();
    grant.priority = prepare_side_thread(priority, loop_cpu);
    grant.memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    return grant;
}

Guard::Guard(int socket) : socket_(socket) {
    pollfd watched{socket, POLLIN, 0};
    (void)poll(&watched, 1, -1);
    GuardMessage message;
    GuardDescriptors descriptors;
    if (receive_message(socket, message, descriptors) != Received::Message || message.order != GuardOrder::Begin) {
        throw std::runtime_error("the guard is started by rt-core run, not by hand");
    }
    shared_ = std::make_unique<SharedSupervision>(descriptors.page);
    black_box_ = descriptors.black_box;
    zero_ = message.zero;
    zero_.link.descriptor = descriptors.device;
    silence_ns_ = message.silence_ns;
    lost_ns_ = message.lost_ns;
    const GuardGrant grant = protect_guard(message.priority, message.loop_cpu);
    shared_->page().beat(Supervisor::Guard);
    (void)send_grant(socket, grant);
}

Guard::~Guard() {
    close_device();
    if (black_box_ >= 0) {
        close(black_box_);
    }
    close(socket_);
}

void Guard::close_device() noexcept {
    if (zero_.link.descriptor >= 0) {
        close(zero_.link.descriptor);
        zero_.link.descriptor = -1;
    }
}

void Guard::send_zeros() noexcept {
    const device::ExchangeStatus status =
        send_zero_packet(zero_, sent_ == 0 ? device::Waiting::Drop : device::Waiting::Keep);
    status_ = sent_ == 0 ? status : status_;
    ++sent_;
}

Guard::End Guard::run() {
    SupervisorCheck others({&shared_->page(), lost_ns_}, Supervisor::Guard);
    std::int64_t due_ns = monotonic_now_ns() + kPollNs;
    while (true) {
        wait_until(socket_, due_ns);
        const std::int64_t now_ns = monotonic_now_ns();
        const bool late = now_ns - due_ns > silence_ns_ / 2;
        due_ns = now_ns + kPollNs;
        shared_->page().beat(Supervisor::Guard);
        switch (take_messages()) {
            case Received::Message:
                return End::Left;
            case Received::Ended:
                zero_for_good();
                return End::Outlived;
            case Received::Nothing:
                break;
        }
        watch_loop(now_ns, late);
        others.check(now_ns);
    }
}

/// Message: the run has said Leave. Nothing: go on.
Received Guard::take_messages() {
    GuardMessage message;
    GuardDescriptors descriptors;
    while (true) {
        const Received received = receive_message(socket_, message, descriptors);
        if (received != Received::Message || message.order == GuardOrder::Leave) {
            return received;
        }
        // The device was opened again.
        close_device();
        zero_ = message.zero;
        zero_.link.descriptor = descriptors.device;
        (void)send_grant(socket_, {});
    }
}

void Guard::zero_for_good() noexcept {
    const std::int64_t start_ns = monotonic_now_ns();
    status_ = send_zero_packet(zero_);
    ++sent_;
    for (const std::int64_t after_ns : kRepeatsNs) {
        sleep_until_time(start_ns + after_ns);
        (void)send_zero_packet(zero_, device::Waiting::Keep);
        ++sent_;
    }
    // What the dead process had submitted ends now, and the next one can open the device.
    close_device();
}

void Guard::watch_loop(std::int64_t now_ns, bool late) noexcept {
    const std::int64_t beat_ns = shared_->page().loop_beat_ns.load(std::memory_order_acquire);
    if (cut_) {
        // A loop that continued may have had one command on its way.
        if (beat_ns != cut_beat_ns_ || now_ns >= resend_ns_) {
            cut_beat_ns_ = beat_ns;
            send_zeros();
            resend_ns_ = now_ns + (sent_ < kSoon ? kResendSoonNs : kResendNs);
        }
        return;
    }
    if (beat_ns == 0 || now_ns - beat_ns <= silence_ns_) {
        excused_ = false;
        return;
    }
    // If this process did not run either, the machine stood still, and the loop gets one more look.
    if (late && !excused_) {
        excused_ = true;
        return;
    }
    cut(now_ns, beat_ns);
}

void Guard::cut(std::int64_t now_ns, std::int64_t beat_ns) noexcept {
    // First the flag, then the zeros: a loop that continues meanwhile sends zeros too.
    cut_ = true;
    cut_beat_ns_ = beat_ns;
    shared_->page().frozen_ns.store(now_ns - beat_ns);
    shared_->page().cut.store(1);
    send_zeros();
    resend_ns_ = now_ns + kResendSoonNs;
}

}  // namespace haptic::rt
