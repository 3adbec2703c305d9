// Edge capture: reads the edges of a GPIO line, with the kernel's time stamps, in a separate thread. If the line is
// wired to a probe, it observes a loop from outside its process.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "haptic/gpio.hpp"
#include "haptic/histogram.hpp"
#include "haptic/period_histogram.hpp"

namespace haptic {

class EdgeCapture {
  public:
    /// Takes edges in the order in which they came, in the thread. Nothing is kept here, so a capture may last for
    /// days.
    using Take = std::function<void(std::span<const Edge>)>;

    /// Starts immediately. `prepare` is called first in the thread, to set its priority and CPU; it may be empty.
    /// Throws std::system_error if the thread cannot be created.
    EdgeCapture(std::unique_ptr<EdgeSource> line, Take take, std::function<void()> prepare = {});
    EdgeCapture(const EdgeCapture&) = delete;
    EdgeCapture& operator=(const EdgeCapture&) = delete;
    ~EdgeCapture();

    /// Reads the edges that still come, until there is none for 0.2 s, and ends the thread. Idempotent.
    void stop();

    /// Error that ended the reading early; empty if none. Valid after stop().
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  private:
    static void* thread_entry(void* self);
    void capture();

    std::unique_ptr<EdgeSource> line_;
    Take take_;
    std::function<void()> prepare_;
    std::string problem_;
    std::atomic<bool> ending_{false};
    pthread_t thread_{};
    bool joined_ = false;
};

/// Known properties of the observed loop.
struct EdgeExpectation {
    std::int64_t period_ns = 1'000'000;  // of the loop
    std::int64_t deadline_ns = -1;       // any one of the loop's deadlines, CLOCK_MONOTONIC; -1: unknown
    EdgeKind kind = EdgeKind::Both;      // of the captured edges
};

/// Timing of a loop, derived from the edges of its probe.
struct EdgeStatistics {
    PeriodHistogram period;  // ns, between consecutive rising edges
    Histogram high;      // ns, from a rising edge to its falling edge: duration of the loop's work; EdgeKind::Both only
    Histogram lateness;  // ns, from the preceding deadline to a rising edge; empty if no deadline is known
    std::uint64_t rising = 0;
    std::uint64_t falling = 0;
    std::uint64_t lost = 0;          // edges missing between two in the same direction; EdgeKind::Both only
    std::uint64_t long_periods = 0;  // 1.5 expected periods or longer: a missed deadline or a lost edge
    std::int64_t first_ns = 0;       // time of the first edge
    std::int64_t last_ns = 0;        // time of the last edge
    std::int64_t longest_at_ns = 0;  // end of the longest period
};

/// Makes statistics of edges while they come. Periods and high times that span a detectably lost edge are excluded. An
/// edge whose loss is not detectable looks like a missed deadline; compare with Probe::edges(), the number of edges
/// made. Has 140 kB, because of its histograms.
class EdgeMeter {
  public:
    explicit EdgeMeter(const EdgeExpectation& expected) : expected_(expected) {
        statistics_.period = PeriodHistogram(expected.period_ns);
    }
    /// Adds edges in order of capture.
    void add(std::span<const Edge> edges);
    /// One of the loop's deadlines from here on, as a loop that was started again has others; -1: unknown.
    void expect_deadline(std::int64_t deadline_ns) noexcept { expected_.deadline_ns = deadline_ns; }
    [[nodiscard]] const EdgeStatistics& statistics() const noexcept { return statistics_; }

  private:
    void take_rise(std::int64_t time_ns);
    void take_fall(std::int64_t time_ns);

    EdgeExpectation expected_;
    EdgeStatistics statistics_;
    std::int64_t rise_ns_ = -1;  // the last rising edge, if measurements may start from it; -1: none
    bool fallen_ = false;        // its falling edge was seen
    bool was_rising_ = false;    // the last edge
};

}  // namespace haptic
