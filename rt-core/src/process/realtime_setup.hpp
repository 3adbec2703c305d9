// What a process and its real-time thread ask of the kernel before the first tick, and what to do where it refuses.
#pragma once

#include <sched.h>

#include <cstddef>
#include <string>
#include <vector>

namespace haptic::rt {

/// Something that the kernel refused.
struct MissingPrivilege {
    std::string what;    // what does not hold now
    std::string needs;   // which limit or capability would allow it
    std::string remedy;  // the command or configuration lines that grant it
};

/// As the thread really runs; goes into the report.
struct RealtimeSetup {
    std::string kernel;  // release and version of uname
    bool preempt_rt = false;
    std::string policy = "SCHED_OTHER";
    int priority = 0;
    int cpu = -1;  // pinned to; -1: not pinned
    bool memory_locked = false;
    int idle_exit_us = -1;  // asked of the kernel as long as the loop lives; -1: nothing was asked, or it refused
    std::vector<MissingPrivilege> missing;

    [[nodiscard]] bool degraded() const noexcept { return !missing.empty(); }
};

/// A PREEMPT_RT kernel says so in uname's version; /sys/kernel/realtime is missing on some.
[[nodiscard]] bool is_preempt_rt(const std::string& uname_version);

/// Release and version of the running kernel.
[[nodiscard]] std::string kernel_name();

/// The process: locks all memory, present and future, and keeps the allocator from giving any back, so that no page has
/// to be fetched in a tick. Call it before the thread is started and after everything large is allocated.
void prepare_process(RealtimeSetup& setup);

/// The calling thread: SCHED_FIFO at a priority (1..98), pinned to a processor (-1: choose_cpu() of
/// cpu_list.hpp), stack touched. Each refusal is added to setup.missing; the others still take effect.
void prepare_thread(RealtimeSetup& setup, int priority, int cpu);

/// A thread that looks after the loop: SCHED_FIFO at a priority where the kernel allows it, and on any processor but
/// the loop's (as for prepare_thread) if there is another. Where it is refused the thread goes on as it is.
void prepare_side_thread(int priority, int loop_cpu);

/// Keeps the calling thread off a processor for as long as this lives, if there is another one; -1: off none. Whatever
/// the thread starts meanwhile is kept off it too.
class AwayFrom {
  public:
    explicit AwayFrom(int cpu);
    AwayFrom(const AwayFrom&) = delete;
    AwayFrom& operator=(const AwayFrom&) = delete;
    ~AwayFrom();

  private:
    cpu_set_t before_{};
    bool left_ = false;
};

/// Bytes of stack of such a thread.
inline constexpr std::size_t kSideStackBytes = std::size_t{1} << 20;

/// Bytes of stack that the real-time thread has, of which glibc takes its thread-local storage, a sanitizer's included;
/// and that it touches: a tick needs a fraction of it.
inline constexpr std::size_t kStackBytes = std::size_t{4} << 20;
inline constexpr std::size_t kTouchedStackBytes = std::size_t{1} << 19;

}  // namespace haptic::rt
