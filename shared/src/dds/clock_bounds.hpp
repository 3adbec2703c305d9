// Clock bounds: the offset between the monotonic clocks of two machines, with bounds that hold whatever the network
// does.
//
// A query leaves here at t0, arrives there at t1, is answered there at t2, and the answer arrives here at t3. Neither
// way takes less than no time, so the offset (clock there minus clock here) is at least t2 - t3 and at most t1 - t0
// (Cristian 1989). Every exchange gives such an interval; the intersection of all holds the offset. Between exchanges
// the interval grows by the rate at which the clocks may drift apart.
#pragma once

#include <cstdint>
#include <optional>

namespace haptic {

/// Times of a query and its answer, ns.
struct ClockExchange {
    std::int64_t sent_ns = 0;      // t0, clock here
    std::int64_t received_ns = 0;  // t1, clock there
    std::int64_t replied_ns = 0;   // t2, clock there
    std::int64_t returned_ns = 0;  // t3, clock here
};

struct ClockOffset {
    std::int64_t offset_ns = 0;       // clock there minus clock here
    std::int64_t uncertainty_ns = 0;  // the true offset is at most this far away
};

class ClockBounds {
  public:
    /// Quartz drifts by at most 50 ppm each; more is a clock that was set or a machine that was suspended.
    static constexpr double kMaxDrift = 100e-6;

    /// Takes an exchange into account. One that contradicts the others restarts the bounds. False: impossible times,
    /// ignored.
    bool add(const ClockExchange& exchange) noexcept;

    /// The offset at a time here; none before the first exchange.
    [[nodiscard]] std::optional<ClockOffset> at(std::int64_t now_ns) const noexcept;

    /// Relative rate of the clock there against the clock here, since the last restart; none in the first ten seconds.
    [[nodiscard]] std::optional<double> drift() const noexcept;
    /// ns, shortest time on the network of an exchange, both ways together.
    [[nodiscard]] std::int64_t shortest_ns() const noexcept { return shortest_ns_; }
    [[nodiscard]] std::uint64_t exchanges() const noexcept { return exchanges_; }
    [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }

  private:
    struct Bounds {
        std::int64_t low_ns = 0;
        std::int64_t high_ns = 0;
        std::int64_t at_ns = 0;  // time here
    };
    [[nodiscard]] Bounds bounds_at(std::int64_t now_ns) const noexcept;

    Bounds bounds_;
    Bounds first_;  // since the last restart, once they had narrowed: the drift is measured from there
    std::uint64_t since_restart_ = 0;  // exchanges
    std::int64_t shortest_ns_ = 0;
    std::uint64_t exchanges_ = 0;
    std::uint64_t restarts_ = 0;
};

}  // namespace haptic
