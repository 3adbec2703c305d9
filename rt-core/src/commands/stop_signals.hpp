// Stop signals: the signals that request an orderly stop, as a thread waits for them.
#pragma once

#include <csignal>
#include <cstdint>

namespace haptic::rt {

/// Blocks the signals that request an orderly stop, in this thread and in every thread that it creates from here on, so
/// that wait() can collect them. They include SIGTSTP (Ctrl-Z), because a suspended process leaves its motors pulling.
/// SIGPIPE, SIGTTIN and SIGTTOU, which would suspend or kill a process for writing to a closed pipe or a terminal, are
/// ignored.
class StopSignals {
  public:
    /// How long a caller waits at a time that watches something else too.
    static constexpr std::int64_t kPollNs = 20'000'000;

    StopSignals();
    StopSignals(const StopSignals&) = delete;
    StopSignals& operator=(const StopSignals&) = delete;
    /// Discards the signals that nobody collected. From here on a signal ends the process again.
    ~StopSignals();

    /// Waits at most this long for a signal; returns its number, or 0 for none.
    [[nodiscard]] int wait(std::int64_t at_most_ns) const;
    /// True once wait() has returned a signal.
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }

  private:
    sigset_t set_{};
    sigset_t before_{};
    mutable bool stopped_ = false;
};

}  // namespace haptic::rt
