// Kernel watch: samples the kernel's counters of the loop's processor (interrupts, stolen time, run-queue wait) ten
// times a second from another thread, so that each late tick can be attributed to the window of 0.1 s around it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include "process/timing_log.hpp"

namespace haptic::rt {

/// Counters of one processor at one time, or the difference of two samples. -1 where the kernel has no such counter.
struct ProcessorCounts {
    std::vector<std::uint64_t> interrupts;  // in the order of KernelWatch::names()
    std::int64_t stolen_ms = -1;            // taken by the hypervisor for other guests; resolution 10 ms
    std::int64_t queued_us = -1;            // sum over all threads of their wait for the processor
};

/// Counters of a window in which an event occurred that is to be explained.
struct KernelWindow {
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
    ProcessorCounts counts;
};

/// A file of the kernel that is read from its start again and again. It stays open: closing a file makes the kernel
/// free it through RCU, whose grace periods keep the scheduler's tick alive.
class KernelFile {
  public:
    explicit KernelFile(const std::filesystem::path& path);
    KernelFile(const KernelFile&) = delete;
    KernelFile& operator=(const KernelFile&) = delete;
    ~KernelFile();

    /// Its present text; empty if the file is missing.
    [[nodiscard]] std::string read() const;

  private:
    int descriptor_;
};

class KernelWatch {
  public:
    static constexpr std::int64_t kWindowNs = 100'000'000;

    /// `proc` is the folder of the files to read: interrupts, stat, schedstat. Any of them may be missing.
    explicit KernelWatch(int cpu, const std::filesystem::path& proc = "/proc");

    /// Starts a new window, for example after a pause; what was counted since the last poll is dropped.
    void restart(std::int64_t now_ns);
    /// Call periodically: closes the window once it is kWindowNs long, and takes the log's events.
    void poll(std::int64_t now_ns, TimingLog& log);
    /// Closes the last window, so that the last ticks have theirs too.
    void finish(std::int64_t now_ns, TimingLog& log);

    /// The window around a tick of the log; nullptr if it was not kept.
    [[nodiscard]] const KernelWindow* window_of(std::int64_t at_ns) const noexcept;
    /// Names of the interrupts.
    [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }
    /// Sum of all windows.
    [[nodiscard]] const ProcessorCounts& total() const noexcept { return total_; }
    /// Total length of all windows, s.
    [[nodiscard]] double watched_s() const noexcept;

  private:
    struct Candidate {
        KernelWindow window;
        bool wanted = false;  // an event lies in it
    };

    [[nodiscard]] ProcessorCounts read();
    void read_interrupts(ProcessorCounts& counts);
    void close_window(std::int64_t now_ns);
    void take_events(TimingLog& log);
    /// Retires all windows except the last `still_open`: keeps the wanted ones, drops the others.
    void retire_windows(std::size_t still_open);

    int cpu_;
    KernelFile interrupts_;
    KernelFile stat_;
    KernelFile schedstat_;
    std::vector<std::string> names_;
    ProcessorCounts last_;
    ProcessorCounts total_;
    std::int64_t begin_ns_ = 0;
    std::int64_t watched_ns_ = 0;
    std::deque<Candidate> recent_;  // a tick's event may arrive after its window was closed
    std::vector<KernelWindow> kept_;
};

/// "local timer interrupts 101, virtio1-req.0 37": interrupts that came at least 20 times in a window, and at least
/// twice as often as on average in the run; at most three, the most frequent first.
[[nodiscard]] std::string unusual_interrupts(const KernelWindow& window, const KernelWatch& watch);

}  // namespace haptic::rt
