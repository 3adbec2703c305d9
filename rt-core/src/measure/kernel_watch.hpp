// What the kernel counts of the processor that the loop runs on: interrupts, stolen time, and how long threads waited
// for it. Looked at ten times a second from another thread, so that a late tick has the tenth of a second around it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include "process/timing_log.hpp"

namespace haptic::rt {

/// Counters of one processor at one time, or their difference. -1 where the kernel does not tell.
struct ProcessorCounts {
    std::vector<std::uint64_t> interrupts;  // by the names of KernelWatch::names()
    std::int64_t stolen_ms = -1;            // that a hypervisor gave to others; counted in steps of 10 ms
    std::int64_t queued_us = -1;            // that threads waited for the processor, all together
};

/// Counters between two looks in which something happened that is to be explained.
struct KernelWindow {
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
    ProcessorCounts counts;
};

class KernelWatch {
  public:
    static constexpr std::int64_t kWindowNs = 100'000'000;

    /// `proc` is where the files are that are read: interrupts, stat, schedstat. Any of them may be missing.
    explicit KernelWatch(int cpu, std::filesystem::path proc = "/proc");

    /// Begins to count anew, as after a pause: what was since the last look belongs to nobody.
    void restart(std::int64_t now_ns);
    /// From time to time; looks no more often than is useful. Takes the log's events.
    void look(std::int64_t now_ns, TimingLog& log);
    /// At the end, so that the last ticks have their window too.
    void finish(std::int64_t now_ns, TimingLog& log);

    /// The window around a tick that the log has; nullptr if it was not kept.
    [[nodiscard]] const KernelWindow* window_of(std::int64_t at_ns) const noexcept;
    [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }
    /// Of all windows together, and their length in s.
    [[nodiscard]] const ProcessorCounts& total() const noexcept { return total_; }
    [[nodiscard]] double watched_s() const noexcept;

  private:
    struct Candidate {
        KernelWindow window;
        bool wanted = false;
    };

    [[nodiscard]] ProcessorCounts read();
    void read_interrupts(ProcessorCounts& counts);
    void close(std::int64_t now_ns);
    void take_events(TimingLog& log);
    /// Keeps what is wanted of all windows but the last `still_open`, and forgets the rest.
    void settle(std::size_t still_open);

    int cpu_;
    std::filesystem::path proc_;
    std::vector<std::string> names_;
    ProcessorCounts last_;
    ProcessorCounts total_;
    std::int64_t begin_ns_ = 0;
    std::int64_t watched_ns_ = 0;
    std::deque<Candidate> recent_;  // a tick's event may come after the window that it is in
    std::vector<KernelWindow> kept_;
};

/// "local timer interrupts 101, virtio1-req.0 37": what came at least twice as often in a window as in the run, and not
/// just a few times; at most three, the most frequent first.
[[nodiscard]] std::string unusual_interrupts(const KernelWindow& window, const KernelWatch& watch);

}  // namespace haptic::rt
