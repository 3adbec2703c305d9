// Edge capture: reads the edges of a GPIO line, with the kernel's time stamps, in a separate thread. If the line is
// wired to a probe, it observes a loop from outside its process.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "haptic/gpio.hpp"
#include "haptic/histogram.hpp"

namespace haptic {

class EdgeCapture {
  public:
    /// Starts immediately. `capacity`: number of edges for which memory is allocated and touched now; a 1 kHz loop
    /// makes 1000 or 2000 per second, 16 bytes each. `prepare` is called first in the thread, to set its priority and
    /// CPU; it may be empty. Throws std::system_error if the thread cannot be created.
    EdgeCapture(std::unique_ptr<EdgeSource> line, std::size_t capacity, std::function<void()> prepare = {});
    EdgeCapture(const EdgeCapture&) = delete;
    EdgeCapture& operator=(const EdgeCapture&) = delete;
    ~EdgeCapture();

    /// Reads the edges that the kernel still holds and ends the thread. Idempotent.
    void stop();

    // Valid after stop():
    [[nodiscard]] std::span<const Edge> edges() const noexcept { return {edges_.data(), count_}; }
    /// Edges beyond the capacity.
    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
    /// Error that ended the reading early; empty if none.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  private:
    static void* thread_entry(void* self);
    void capture();
    void keep(std::span<const Edge> edges);

    std::unique_ptr<EdgeSource> line_;
    std::function<void()> prepare_;
    std::vector<Edge> edges_;
    std::size_t count_ = 0;
    std::uint64_t dropped_ = 0;
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
    Histogram period;    // ns, between consecutive rising edges
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

/// `edges` in order of capture. Periods and high times that span a detectably lost edge are excluded. An edge whose
/// loss is not detectable looks like a missed deadline; compare with Probe::edges(), the number of edges made. The
/// result has 90 kB, because of its histograms.
[[nodiscard]] EdgeStatistics edge_statistics(std::span<const Edge> edges, const EdgeExpectation& expected);

}  // namespace haptic
