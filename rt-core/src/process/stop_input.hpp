// A stop button that is wired to this machine, not to the board: a line that says stop, and the thread that looks at
// it.
#pragma once

#include <pthread.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

namespace haptic::rt {

class StopLine {
  public:
    virtual ~StopLine() = default;
    /// Whether the line says stop now. Throws std::runtime_error if it cannot be read, which counts as stop.
    [[nodiscard]] virtual bool says_stop() = 0;
};

/// The line of a GPIO chip.
struct GpioStopSettings {
    std::string chip;            // label, name (gpiochip0) or path; empty: no stop line
    int line = 0;                // offset in the chip
    bool stop_when_high = true;  // the level that means stop, to which the line is pulled: so a broken wire is a stop
};

/// Throws std::runtime_error that says what is wrong and what to do: no such chip or line, or it is in use.
/// With a button that opens (normally closed, to ground) and stop_when_high, the button, a broken wire and a plug
/// pulled out are all a stop. The chip is asked to pull the line to that level; where it cannot do so (the kernel does
/// not say), a resistor must.
[[nodiscard]] std::unique_ptr<StopLine> open_gpio_stop_line(const GpioStopSettings& settings);

/// Looks at a line every kLookNs, and says stop once, within that time and what the scheduler adds to it.
class StopWatch {
  public:
    static constexpr std::int64_t kLookNs = 5'000'000;  // ns

    /// `stop` is called from the watching thread, at most once. Throws std::system_error if there is no thread to be
    /// had.
    StopWatch(std::unique_ptr<StopLine> line, std::function<void()> stop);
    StopWatch(const StopWatch&) = delete;
    StopWatch& operator=(const StopWatch&) = delete;
    ~StopWatch();

    [[nodiscard]] bool stopped() const noexcept { return stopped_.load(); }
    /// Why, once stopped() is true.
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

  private:
    static void* thread_entry(void* self);
    void watch();
    [[nodiscard]] bool look();

    std::unique_ptr<StopLine> line_;
    std::function<void()> stop_;
    std::atomic<bool> stopped_{false};
    std::string reason_;  // written before stopped_
    std::mutex mutex_;
    std::condition_variable wake_;
    bool ending_ = false;  // under the mutex
    pthread_t thread_{};
};

}  // namespace haptic::rt
