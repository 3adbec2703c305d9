// Trace explanation: from a kernel trace, what the loop's thread did between a deadline and the end of its late tick,
// and which thread or interrupt made it late.
//
// The thread is followed through that time: asleep, ready for its processor, or running. Each part is charged to
// somebody: while it slept, to what woke it late; while it was ready, to what its processor ran instead. The largest
// part beyond what is usual is the cause.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace haptic::rt {

enum class TraceCause : std::uint8_t {
    LateTimer,          // the timer interrupt that wakes the thread came late
    HigherPriority,     // a thread of higher priority used the processor
    KernelSection,      // a thread of lower priority kept the processor: the kernel did not preempt it
    PriorityInversion,  // the thread waited for a lock that a thread of lower priority held
    LateWaker,          // the thread that wakes it from its exchange waited for a processor itself
    Device,             // the device answered late
    PageFault,          // a page was not in memory
    Interrupts,         // interrupts took the time while the thread ran
    OtherProcessor,     // the thread ran on another processor than it was pinned to
    Unseen              // the thread ran; the trace has nothing that took the time
};
/// Name as used in the report.
[[nodiscard]] const char* name_of(TraceCause cause) noexcept;

/// A late tick whose trace is explained. Times in ns of CLOCK_MONOTONIC.
struct TracedTick {
    int thread = 0;  // the loop's
    int cpu = -1;    // that it is pinned to; -1: none
    std::int64_t deadline_ns = 0;
    std::int64_t end_ns = 0;
    std::int64_t usual_ns = 0;     // from deadline to end, of a usual tick
    std::int64_t page_faults = 0;  // as the kernel counted them
};

/// What the thread did in one part of the time.
struct TracePart {
    enum class State : std::uint8_t { Asleep, Ready, Running };
    State state = State::Running;
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
    int cpu = -1;
    std::string by;  // what its processor ran most, or what woke it
};

struct TraceExplanation {
    TraceCause cause = TraceCause::Unseen;
    std::int64_t lost_ns = 0;      // of the lateness, by this cause
    std::string thread;            // "name-number" of the thread or interrupt that caused it; empty: none
    std::string why;               // a sentence
    std::vector<TracePart> parts;  // from the deadline to the end
};

/// Explains a late tick from the lines of its trace, which should begin some milliseconds before the deadline. Lines
/// that are not understood are ignored.
[[nodiscard]] TraceExplanation explain_trace(const std::string& lines, const TracedTick& tick);

}  // namespace haptic::rt
