// Real-time setup of the process and its threads: memory locking, SCHED_FIFO, processor affinity, stack; and the remedy
// for each privilege that the kernel refuses.
#pragma once

#include <pthread.h>
#include <sched.h>

#include <cstddef>
#include <string>
#include <vector>

namespace haptic::rt {

inline constexpr int kHighestPriority = 98;  // of SCHED_FIFO; 99 is used by kernel threads

/// A request that the kernel refused.
struct MissingPrivilege {
    std::string what;    // the consequence, such as "memory is not locked"
    std::string needs;   // the limit or capability that would allow it
    std::string remedy;  // the command or configuration lines that grant it
};

/// Actual real-time state of the process and the loop's thread; part of the report.
struct RealtimeSetup {
    std::string kernel;  // release and version from uname
    bool preempt_rt = false;
    std::string policy = "SCHED_OTHER";
    int priority = 0;
    int cpu = -1;  // processor that the thread is pinned to; -1: not pinned
    bool memory_locked = false;
    int idle_exit_us = -1;  // limit of the idle exit latency while the loop lives; -1: not requested, or refused
    std::vector<MissingPrivilege> missing;

    [[nodiscard]] bool degraded() const noexcept { return !missing.empty(); }
};

/// Recognises a PREEMPT_RT kernel by uname's version, because /sys/kernel/realtime is missing on some.
[[nodiscard]] bool is_preempt_rt(const std::string& uname_version);

/// Release and version of the running kernel.
[[nodiscard]] std::string kernel_name();

/// Prepares the process: locks all present and future memory and keeps freed memory, so that no tick page-faults. Call
/// after everything large is allocated and before the thread is started. A refusal is added to setup.missing.
void prepare_process(RealtimeSetup& setup);

/// Prepares the calling thread as the loop's: touches its stack, pins it to a processor (-1: choose_cpu() of
/// cpu_list.hpp), sets SCHED_FIFO at a priority up to kHighestPriority. Each refusal is added to setup.missing; the
/// rest still takes effect.
void prepare_thread(RealtimeSetup& setup, int priority, int cpu);

/// Prepares the calling thread as one that supervises the loop: SCHED_FIFO at a priority or, where RLIMIT_RTPRIO ends
/// below it, one or two lower, and any processor except the loop's (as in prepare_thread) if there is another. Returns
/// the priority granted; 0: none, ordinary scheduling.
[[nodiscard]] int prepare_side_thread(int priority, int loop_cpu);

/// RAII change of the calling thread's processor affinity, inherited by whatever it starts meanwhile. No change if cpu
/// is -1, if the kernel refuses, or if Exclude would leave no processor.
class ScopedAffinity {
  public:
    enum class Change { Include, Exclude };
    ScopedAffinity(int cpu, Change change);
    ScopedAffinity(const ScopedAffinity&) = delete;
    ScopedAffinity& operator=(const ScopedAffinity&) = delete;
    ~ScopedAffinity();

  private:
    cpu_set_t before_{};
    bool changed_ = false;
};

/// Creates a thread with a stack of stack_bytes. Throws std::system_error with `what`.
[[nodiscard]] pthread_t create_thread(void* (*entry)(void*), void* argument, std::size_t stack_bytes, const char* what);

/// Stack size of a supervising thread, bytes.
inline constexpr std::size_t kSideStackBytes = std::size_t{1} << 20;

/// Stack size of the real-time thread, bytes, which includes glibc's and the sanitizers' thread-local storage; and the
/// part of it that is touched in advance. A tick needs a fraction of either.
inline constexpr std::size_t kStackBytes = std::size_t{4} << 20;
inline constexpr std::size_t kTouchedStackBytes = std::size_t{1} << 19;

}  // namespace haptic::rt
