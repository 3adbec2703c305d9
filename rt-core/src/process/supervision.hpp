// Supervision: the memory in which the loop and everything that can stop it see that the others still run.
//
// The guard (guard.hpp) is a process of its own, so the memory is shared with it. Everyone beats there: the loop with
// the time of its ticks, the watchdog's thread, the stop line's thread and the guard with counters. Each of the three,
// and the main thread, also looks whether the counters of the others change. One that is lost (its thread blocked in
// the kernel, its process killed) stops the run in an orderly way, with the fault HAPTIC_FAULT_GUARD and its name.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "haptic/realtime.hpp"

namespace haptic::rt {

enum class Supervisor : std::uint8_t { Watchdog, StopLine, Guard };
inline constexpr std::size_t kSupervisors = 3;

struct SupervisionPage {
    std::atomic<std::int64_t> loop_beat_ns{0};                     // begin or end of the last tick; 0: no loop runs
    std::array<std::atomic<std::uint64_t>, kSupervisors> beats{};  // 0: there is none
    std::atomic<std::uint32_t> lost{0};                            // bit per Supervisor
    std::atomic<std::uint32_t> cut{0};                             // 1: the guard has sent zeros; for good
    std::atomic<std::int64_t> frozen_ns{0};                        // time without a beat when it did
    std::atomic<std::uint32_t> black_box_kept{0};                  // 1: nothing is left to be saved from the black box

    void beat(Supervisor one) noexcept { of(one).fetch_add(1, std::memory_order_relaxed); }
    void leave(Supervisor one) noexcept { of(one).store(0, std::memory_order_relaxed); }
    /// By the loop's thread: the time of a tick's begin or end, or 0 when no more follow.
    void loop_beat(std::int64_t now_ns) HAPTIC_RT { loop_beat_ns.store(now_ns, std::memory_order_release); }
    /// The guard has sent zeros: no other command may follow.
    [[nodiscard]] bool is_cut() const HAPTIC_RT { return cut.load() != 0; }
    [[nodiscard]] bool has_lost() const HAPTIC_RT { return lost.load(std::memory_order_relaxed) != 0; }

  private:
    std::atomic<std::uint64_t>& of(Supervisor one) noexcept { return beats[static_cast<std::size_t>(one)]; }
};
static_assert(std::atomic<std::int64_t>::is_always_lock_free && std::atomic<std::uint32_t>::is_always_lock_free,
              "two processes share them");

/// Names of the supervisors whose bits are set in SupervisionPage::lost: "stop line, guard".
[[nodiscard]] std::string supervisor_names(std::uint32_t bits);

/// A SupervisionPage in memory that another process can map. Nobody can shrink it, which would end both by SIGBUS.
class SharedSupervision {
  public:
    /// Throws std::system_error.
    SharedSupervision();
    /// Maps the memory of another process, and owns the descriptor from then on. Throws std::system_error.
    explicit SharedSupervision(int descriptor);
    SharedSupervision(const SharedSupervision&) = delete;
    SharedSupervision& operator=(const SharedSupervision&) = delete;
    ~SharedSupervision();

    [[nodiscard]] SupervisionPage& page() const noexcept { return *page_; }
    [[nodiscard]] int descriptor() const noexcept { return descriptor_; }

  private:
    void map();

    int descriptor_ = -1;
    SupervisionPage* page_ = nullptr;
};

/// How a thread takes part.
struct Supervision {
    SupervisionPage* page = nullptr;      // nullptr: it does not
    std::int64_t limit_ns = 150'000'000;  // ns, silence after which a supervisor is lost
};

/// The look of one thread at the supervisors. Silence counts only while that thread itself looks regularly, so that a
/// process that was stopped and continued takes nobody for lost.
class SupervisorCheck {
  public:
    /// `self`: the supervisor that looks, which does not look at itself; none for the main thread.
    SupervisorCheck(const Supervision& supervision, std::optional<Supervisor> self);
    /// Marks those that are lost in the page.
    void check(std::int64_t now_ns) noexcept;

  private:
    Supervision supervision_;
    std::optional<Supervisor> self_;
    std::int64_t last_ns_ = 0;
    std::array<std::uint64_t, kSupervisors> beats_{};
    std::array<std::int64_t, kSupervisors> silent_ns_{};
};

}  // namespace haptic::rt
