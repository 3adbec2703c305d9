// Stop line: a stop button wired to this machine (not to the board), and the thread that polls it.
#pragma once

#include <pthread.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "process/supervision.hpp"

namespace haptic::rt {

class StopLine {
  public:
    virtual ~StopLine() = default;
    /// True if the line is in its stop state. Throws std::runtime_error if it cannot be read, which counts as a stop.
    [[nodiscard]] virtual bool says_stop() = 0;
};

/// A line of a GPIO chip.
struct GpioStopSettings {
    std::string chip;            // label, name (gpiochip0) or path; empty: no stop line
    int line = 0;                // offset in the chip
    bool stop_when_high = true;  // level that means stop; the line is biased to it, so that a broken wire is a stop
};

/// Opens the line. Throws std::runtime_error with cause and remedy: no such chip or line, or it is in use.
///
/// With a normally closed button to ground and stop_when_high, pressing the button, a broken wire and an unplugged
/// connector all mean stop. The chip is asked to bias the line to the stop level. Not every chip can, and the kernel
/// does not report it; then an external resistor must do it.
[[nodiscard]] std::unique_ptr<StopLine> open_gpio_stop_line(const GpioStopSettings& settings);

/// The thread that reads a stop line.
struct StopLineThread {
    int priority = 81;  // SCHED_FIFO; a refusal is reported by StopLineMonitor::priority()
    int loop_cpu = -1;  // processor to avoid, as LoopSettings::cpu
    Supervision supervision = {};
};

/// Polls a stop line every kPollNs, and calls `stop` once. The latency is at most kPollNs plus the scheduler's delay.
class StopLineMonitor {
  public:
    static constexpr std::int64_t kPollNs = 5'000'000;  // ns

    /// Starts the thread, which calls `stop` at most once. Throws std::system_error if it cannot be created.
    StopLineMonitor(std::unique_ptr<StopLine> line, std::function<void()> stop, const StopLineThread& thread = {});
    StopLineMonitor(const StopLineMonitor&) = delete;
    StopLineMonitor& operator=(const StopLineMonitor&) = delete;
    ~StopLineMonitor();

    [[nodiscard]] bool stopped() const noexcept { return stopped_.load(); }
    /// SCHED_FIFO priority of its thread; 0: it was refused. Waits until the thread has asked.
    [[nodiscard]] int priority() const noexcept;
    /// Reason of the stop; valid once stopped() is true.
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

  private:
    static constexpr int kUnknown = -1;

    static void* thread_entry(void* self);
    void monitor();
    /// True if the line means stop or cannot be read; sets reason_.
    [[nodiscard]] bool poll();

    std::unique_ptr<StopLine> line_;
    std::function<void()> stop_;
    StopLineThread settings_;
    std::atomic<int> priority_{kUnknown};
    std::atomic<bool> stopped_{false};
    std::string reason_;  // written before stopped_
    std::mutex mutex_;
    std::condition_variable wake_;
    bool ending_ = false;  // guarded by mutex_
    pthread_t thread_{};
};

}  // namespace haptic::rt
