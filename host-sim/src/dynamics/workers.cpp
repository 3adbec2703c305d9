#include "dynamics/workers.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string>

#include "haptic/denormals.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace haptic::sim {
namespace {

/// Fields of the ticket, from the lowest bit on: how often the caller has asked for an item, how often the others have,
/// and how many there are. Each thread asks once more than it gets any.
constexpr unsigned kBits = 21;
constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
constexpr std::uint64_t kByCaller = 1;
constexpr std::uint64_t kByOthers = std::uint64_t{1} << kBits;
static_assert(Workers::kMaxItems + Workers::kMaxThreads <= kMask);

struct Taken {
    std::uint64_t by_caller;
    std::uint64_t by_others;
    std::uint64_t count;
};

Taken fields_of(std::uint64_t ticket) noexcept {
    return {ticket & kMask, (ticket >> kBits) & kMask, ticket >> (2 * kBits)};
}

// How long a thread waits before others may have its processor for a turn. The kernel takes a microsecond or more to
// ask them, and a thread that asks all the time is late for the next loop by as long.
constexpr auto kTurn = std::chrono::microseconds(100);
constexpr int kSpinsPerLook = 64;  // at the time
// How long a thread waits for the next loop before it sleeps.
constexpr auto kAwake = std::chrono::microseconds(200);

// A wait of this length may be that for a thread that has lost its processor: most loops take a hundredth of it.
constexpr auto kLongWait = std::chrono::microseconds(500);
// How many loops the caller then does alone: as long as a program may keep a processor takes, and more each time.
constexpr std::uint32_t kMinLoopsAlone = 1'000;
constexpr std::uint32_t kMaxLoopsAlone = 16'000;

using Clock = std::chrono::steady_clock;

bool has_items(std::uint64_t ticket) noexcept {
    const Taken taken = fields_of(ticket);
    return taken.by_caller + taken.by_others < taken.count;
}

/// Tells the processor that this is a waiting loop.
void pause() noexcept {
#if defined(__x86_64__)
    _mm_pause();
#elif defined(__aarch64__)
    asm volatile("yield");
#endif
}

/// A wait for what another thread does soon, which keeps the processor but for a moment in each turn.
class ShortWait {
  public:
    void spin() noexcept {
        pause();
        if (++spins_ % kSpinsPerLook != 0) {
            return;
        }
        now_ = Clock::now();
        if (now_ - turn_ > kTurn) {
            std::this_thread::yield();
            turn_ = now_ = Clock::now();
        }
    }
    /// How long it has lasted, as of the last look at the time.
    [[nodiscard]] Clock::duration length() const noexcept { return now_ - begin_; }

  private:
    int spins_ = 0;
    Clock::time_point begin_ = Clock::now();
    Clock::time_point now_ = begin_;
    Clock::time_point turn_ = begin_;
};

}  // namespace

int usable_processors() noexcept {
    cpu_set_t allowed;
    if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) {
        return 1;
    }
    return std::clamp(CPU_COUNT(&allowed), 1, Workers::kMaxThreads);
}

Workers::Workers(int threads) {
    if (threads < 1 || threads > kMaxThreads) {
        throw std::invalid_argument("threads must be in 1.." + std::to_string(kMaxThreads));
    }
    if (sched_getaffinity(0, sizeof allowed_, &allowed_) != 0) {
        CPU_ZERO(&allowed_);
    }
    caller_processor_ = sched_getcpu();
    for (int k = 1; k < threads; ++k) {
        helper_.emplace_back([this] { work(); });
        clockid_t clock = 0;
        if (pthread_getcpuclockid(helper_.back().native_handle(), &clock) == 0) {
            clock_.push_back(clock);
        }
    }
}

Workers::~Workers() {
    end_.store(true);
    loop_.fetch_add(1);
    loop_.notify_all();
    for (std::thread& helper : helper_) {
        helper.join();
    }
}

void Workers::run(std::size_t count, Call call, const void* item) noexcept {
    const std::uint64_t before = done_by_others_.load(std::memory_order_relaxed);
    const bool flush = denormals_are_flushed();
    const int processor = sched_getcpu();
    // One after the other, at once: the others read the same line of the cache all the time.
    call_ = call;
    item_ = item;
    flush_ = flush;
    caller_processor_.store(processor, std::memory_order_relaxed);
    ticket_.store(static_cast<std::uint64_t>(count) << (2 * kBits), std::memory_order_release);
    loop_.fetch_add(1);
    if (sleeping_.load() > 0) {
        loop_.notify_all();
    }
    std::uint64_t own = 0;
    for (;; ++own) {
        const std::uint64_t ticket = ticket_.fetch_add(kByCaller, std::memory_order_relaxed);
        if (!has_items(ticket)) {
            break;
        }
        call(item, fields_of(ticket).by_caller);
    }
    wait_for_others(before + count - own);
}

/// Waits for items that have begun elsewhere: until others have done so many. If meanwhile their threads did not run,
/// the next loops go without them.
void Workers::wait_for_others(std::uint64_t done) noexcept {
    const auto all_are_done = [&] { return done_by_others_.load(std::memory_order_acquire) == done; };
    for (ShortWait wait; wait.length() < kLongWait; wait.spin()) {
        if (all_are_done()) {
            return;
        }
    }
    // From now on: do their threads run?
    const Clock::time_point late = Clock::now();
    const std::chrono::nanoseconds worked = time_of_others();
    while (!all_are_done()) {
        std::this_thread::yield();
    }
    if (time_of_others() - worked < (Clock::now() - late) / 2) {
        // Longer than the last time if they have helped for a shorter time since.
        const std::uint32_t loop = loop_.load(std::memory_order_relaxed);
        const bool soon = loop - lost_in_loop_ < loops_alone_at_loss_;
        loops_alone_at_loss_ = soon ? std::min(2 * loops_alone_at_loss_, kMaxLoopsAlone) : kMinLoopsAlone;
        loops_alone_ = loops_alone_at_loss_;
        lost_in_loop_ = loop;
        ++losses_;
    }
}

/// Processor time of the helpers since they began.
std::chrono::nanoseconds Workers::time_of_others() const noexcept {
    std::chrono::nanoseconds sum{0};
    for (const clockid_t clock : clock_) {
        timespec time{};
        if (clock_gettime(clock, &time) == 0) {
            sum += std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
        }
    }
    return sum;
}

/// Does items of the loop until none is left. Denormal numbers are flushed as they are in the caller.
void Workers::help() noexcept {
    std::uint64_t done = 0;
    for (;; ++done) {
        const std::uint64_t ticket = ticket_.fetch_add(kByOthers, std::memory_order_acquire);
        if (!has_items(ticket)) {
            break;
        }
        const Taken taken = fields_of(ticket);
        const std::uint64_t item = taken.count - 1 - taken.by_others;
        if (flush_) {
            const FlushDenormals flush;
            call_(item_, item);
        } else {
            call_(item_, item);
        }
    }
    if (done > 0) {
        done_by_others_.fetch_add(done, std::memory_order_release);
    }
}

/// Moves to another processor if this is the caller's.
void Workers::avoid_caller() noexcept {
    const int processor = caller_processor_.load(std::memory_order_relaxed);
    if (processor < 0 || processor >= CPU_SETSIZE || processor != sched_getcpu()) {
        return;
    }
    cpu_set_t others = allowed_;
    CPU_CLR(static_cast<std::size_t>(processor), &others);
    if (CPU_COUNT(&others) > 0) {
        (void)sched_setaffinity(0, sizeof others, &others);
    }
}

void Workers::work() noexcept {
    for (;;) {
        // Read first: a loop is counted after what is read next has changed.
        const std::uint32_t loop = loop_.load();
        if (end_.load()) {
            return;
        }
        for (ShortWait wait; !has_items(ticket_.load(std::memory_order_relaxed)); wait.spin()) {
            if (wait.length() >= kAwake) {
                sleeping_.fetch_add(1);
                loop_.wait(loop);
                sleeping_.fetch_sub(1);
                break;
            }
        }
        avoid_caller();
        help();
    }
}

}  // namespace haptic::sim
