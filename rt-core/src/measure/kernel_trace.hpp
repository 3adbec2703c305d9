// Kernel trace: what the kernel did around a late tick, recorded by its own tracer (tracefs, ftrace) in a ring buffer
// that runs all the time and is stopped once the tick has been late.
//
// It records which thread ran where (sched_switch), what woke whom (sched_waking), interrupts, and the page faults and
// lock waits of the loop's thread. The kernel writes each event in a fraction of a microsecond; nothing happens in the
// loop's thread.
// @source Linux, Documentation/trace/ftrace.rst and events.rst.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

namespace haptic::rt {

class KernelTrace {
  public:
    static constexpr const char* kTracefs = "/sys/kernel/tracing";

    /// Starts to record, in a buffer of its own. Throws std::runtime_error, with what to do, if the kernel has no
    /// tracer or does not let this user have it.
    explicit KernelTrace(const std::filesystem::path& tracefs = kTracefs);
    KernelTrace(const KernelTrace&) = delete;
    KernelTrace& operator=(const KernelTrace&) = delete;
    /// Gives the buffer back to the kernel.
    ~KernelTrace();

    /// Records the page faults and lock waits of this thread too, where the kernel has such events.
    void follow(int thread);
    /// Ends recording: what is in the buffer stays.
    void stop() noexcept;
    /// The recorded lines in [from, to], ns of CLOCK_MONOTONIC, as the kernel writes them, in order of time. Call after
    /// stop().
    [[nodiscard]] std::string lines(std::int64_t from_ns, std::int64_t to_ns) const;

  private:
    [[nodiscard]] bool enable(const std::string& event, const std::string& filter = {}) const;

    std::filesystem::path instance_;
};

/// Where the processor's number, "[001] ", begins in a line of the trace; npos if it is none. Before it stands the name
/// of a thread, which may contain anything else.
[[nodiscard]] std::size_t processor_in(const std::string& line) noexcept;
inline constexpr std::size_t kProcessorLength = 6;
/// Time of a line of the trace, ns; -1 if it is none.
[[nodiscard]] std::int64_t time_of_line(const std::string& line);

}  // namespace haptic::rt
