// Reads the edges of a line, with the kernel's time stamps, in a thread of its own: the loop as it is seen from outside
// of its process, where the line is wired to a probe's.
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
    /// Begins at once. `room`: edges for which memory is taken, and touched, now; a 1 kHz loop makes 1000 or 2000 a
    /// second, 16 bytes each. `prepare` is called first in the thread, for its priority and processor; it may be empty.
    /// Throws std::system_error if there is no thread to be had.
    EdgeCapture(std::unique_ptr<EdgeSource> line, std::size_t room, std::function<void()> prepare = {});
    EdgeCapture(const EdgeCapture&) = delete;
    EdgeCapture& operator=(const EdgeCapture&) = delete;
    ~EdgeCapture();

    /// Takes what the kernel still has, and ends the thread. Any number of times.
    void stop();

    // After stop():
    [[nodiscard]] std::span<const Edge> edges() const noexcept { return {edges_.data(), count_}; }
    /// Edges that found no room.
    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
    /// Why the line could not be read any more; empty if it could to the end.
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

struct EdgeExpectation {
    std::int64_t period_ns = 1'000'000;  // of the loop
    std::int64_t deadline_ns = -1;       // any one of the loop's deadlines, CLOCK_MONOTONIC; -1: not known
    EdgeKind kind = EdgeKind::Both;      // that were captured
};

/// What the edges of a probe's line say of the loop that makes them.
struct EdgeStatistics {
    Histogram period;    // ns, from a rising edge to the next
    Histogram high;      // ns, from a rising edge to its falling edge: how long the loop's work took; of EdgeKind::Both
    Histogram lateness;  // ns, of a rising edge after the deadline before it; empty where no deadline is known
    std::uint64_t rising = 0;
    std::uint64_t falling = 0;
    std::uint64_t lost = 0;          // of EdgeKind::Both, that must have been between two in the same direction
    std::uint64_t long_periods = 0;  // 1.5 times what is expected, or more: a missed deadline, or an edge that was lost
    std::int64_t first_ns = 0;       // time of the first and of the last edge
    std::int64_t last_ns = 0;
    std::int64_t longest_at_ns = 0;  // when the longest period ended
};

/// `edges` in the order in which they came. Periods and times up that an edge known to be lost made longer are left
/// out. An edge whose loss does not show cannot be told from a missed deadline: Probe::edges() says how many there
/// should be.
/// Its histograms make the result 90 kB.
[[nodiscard]] EdgeStatistics edge_statistics(std::span<const Edge> edges, const EdgeExpectation& expected);

}  // namespace haptic
