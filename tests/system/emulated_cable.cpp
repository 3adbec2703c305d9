// A cable between two network namespaces that delays, jitters and loses what it carries, as netem does, for kernels
// without netem:
//     emulated_cable FROM TO [--delay MS] [--jitter MS] [--loss PERCENT] [--seed N]
// Each namespace gets an interface "cable" (TAP). Every Ethernet frame, in either direction, is lost with the given
// probability, independently of the others, or arrives after delay + jitter * u, u uniform in -1..1 and never before it
// was sent; so jitter reorders frames. Prints "ready" once both interfaces exist, and at SIGTERM or SIGINT what it
// carried. Ends with its parent. Exit status 1 if it cannot make them, or if one is removed.
#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <queue>
#include <random>
#include <string>
#include <system_error>
#include <vector>

#include "haptic/clock.hpp"

namespace {

struct Impairment {
    double delay_ms = 0.0;
    double jitter_ms = 0.0;
    double loss_percent = 0.0;
    std::uint64_t seed = 1;
};

[[noreturn]] void fail(const std::string& what) {
    throw std::system_error(errno, std::system_category(), what);
}

/// An open TAP interface "cable" of a namespace of `ip netns`. The process stays in that namespace.
int open_end(const std::string& name) {
    const int space = ::open(("/var/run/netns/" + name).c_str(), O_RDONLY | O_CLOEXEC);
    if (space < 0) {
        fail("network namespace " + name + " (ip netns add " + name + ")");
    }
    if (::setns(space, CLONE_NEWNET) != 0) {
        fail("entering network namespace " + name + ", which needs root");
    }
    ::close(space);
    const int end = ::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (end < 0) {
        fail("/dev/net/tun (modprobe tun)");
    }
    ifreq request{};
    std::strncpy(request.ifr_name, "cable", IFNAMSIZ - 1);
    request.ifr_flags = IFF_TAP | IFF_NO_PI;
    if (::ioctl(end, TUNSETIFF, &request) != 0) {
        fail("making interface cable in " + name);
    }
    return end;
}

/// One direction of the cable.
class Direction {
  public:
    Direction(int from, int to, const Impairment& impairment, std::uint64_t seed)
        : from_(from), to_(to), impairment_(impairment), random_(seed) {}

    /// Takes all frames that wait at one end.
    void take(std::int64_t now_ns) {
        std::array<std::uint8_t, 65536> frame;
        for (ssize_t size = ::read(from_, frame.data(), frame.size()); size > 0;
             size = ::read(from_, frame.data(), frame.size())) {
            ++carried_;
            if (std::bernoulli_distribution(0.01 * impairment_.loss_percent)(random_)) {
                ++lost_;
                continue;
            }
            const double late_ms =
                impairment_.delay_ms + impairment_.jitter_ms * std::uniform_real_distribution(-1.0, 1.0)(random_);
            waiting_.push({now_ns + static_cast<std::int64_t>(1e6 * std::max(0.0, late_ms)),
                           carried_,
                           {frame.data(), frame.data() + size}});
        }
    }
    /// Delivers what is due at the other end. An interface that is down takes nothing.
    void deliver(std::int64_t now_ns) {
        for (; !waiting_.empty() && waiting_.top().due_ns <= now_ns; waiting_.pop()) {
            const std::vector<std::uint8_t>& frame = waiting_.top().frame;
            refused_ += ::write(to_, frame.data(), frame.size()) < 0 ? 1u : 0u;
        }
    }
    /// When the next frame is due; none: `otherwise`.
    [[nodiscard]] std::int64_t next_ns(std::int64_t otherwise) const {
        return waiting_.empty() ? otherwise : std::min(otherwise, waiting_.top().due_ns);
    }
    void print(const std::string& from, const std::string& to) const {
        std::printf("%s to %s: %llu frames, %llu lost, %llu not taken\n", from.c_str(), to.c_str(),
                    static_cast<unsigned long long>(carried_), static_cast<unsigned long long>(lost_),
                    static_cast<unsigned long long>(refused_));
    }

  private:
    struct Waiting {
        std::int64_t due_ns;
        std::uint64_t number;  // frames due at the same time keep their order
        std::vector<std::uint8_t> frame;
        bool operator<(const Waiting& other) const {
            return due_ns != other.due_ns ? due_ns > other.due_ns : number > other.number;
        }
    };

    int from_;
    int to_;
    Impairment impairment_;
    std::mt19937_64 random_;
    std::priority_queue<Waiting> waiting_;
    std::uint64_t carried_ = 0;
    std::uint64_t lost_ = 0;
    std::uint64_t refused_ = 0;
};

void carry(const std::array<std::string, 2>& names, const Impairment& impairment) {
    (void)::prctl(PR_SET_PDEATHSIG, SIGTERM);
    // Signals become readable, so that a wait for frames ends by them too.
    sigset_t stop;
    sigemptyset(&stop);
    sigaddset(&stop, SIGTERM);
    sigaddset(&stop, SIGINT);
    sigprocmask(SIG_BLOCK, &stop, nullptr);
    const int stopped = ::signalfd(-1, &stop, SFD_CLOEXEC);

    const std::array<int, 2> ends = {open_end(names[0]), open_end(names[1])};
    std::array<Direction, 2> directions = {Direction(ends[0], ends[1], impairment, 2 * impairment.seed),
                                           Direction(ends[1], ends[0], impairment, 2 * impairment.seed + 1)};
    std::puts("ready");
    std::fflush(stdout);

    constexpr std::int64_t kSecondNs = 1'000'000'000;
    std::array<pollfd, 3> inputs = {{{ends[0], POLLIN, 0}, {ends[1], POLLIN, 0}, {stopped, POLLIN, 0}}};
    while ((inputs[2].revents & POLLIN) == 0) {
        // Until a frame comes or is due. A frame without delay is delivered in the same pass.
        const std::int64_t now_ns = haptic::monotonic_now_ns();
        std::int64_t due_ns = now_ns + kSecondNs;
        for (Direction& direction : directions) {
            direction.take(now_ns);
            direction.deliver(now_ns);
            due_ns = direction.next_ns(due_ns);
        }
        const std::int64_t wait_ns = std::max<std::int64_t>(0, due_ns - haptic::monotonic_now_ns());
        const timespec timeout = {wait_ns / kSecondNs, wait_ns % kSecondNs};
        if (::ppoll(inputs.data(), inputs.size(), &timeout, nullptr) < 0 && errno != EINTR) {
            fail("waiting for frames");
        }
        if (((inputs[0].revents | inputs[1].revents) & (POLLERR | POLLHUP | POLLNVAL)) != 0) {
            errno = ENODEV;
            fail("an end of the cable");
        }
    }
    directions[0].print(names[0], names[1]);
    directions[1].print(names[1], names[0]);
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("A cable between two network namespaces that delays, jitters and loses Ethernet frames");
    std::array<std::string, 2> names;
    Impairment impairment;
    app.add_option("from", names[0], "network namespace")->required();
    app.add_option("to", names[1], "network namespace")->required();
    app.add_option("--delay", impairment.delay_ms, "ms, of each frame in either direction")
        ->check(CLI::Range(0.0, 1e4));
    app.add_option("--jitter", impairment.jitter_ms, "ms, added or taken away at most")->check(CLI::Range(0.0, 1e4));
    app.add_option("--loss", impairment.loss_percent, "percent of frames")->check(CLI::Range(0.0, 100.0));
    app.add_option("--seed", impairment.seed, "of losses and jitter");
    CLI11_PARSE(app, argc, argv);
    try {
        carry(names, impairment);
    } catch (const std::system_error& error) {
        std::fprintf(stderr, "error: %s\n", error.what());
        return 1;
    }
    return 0;
}
