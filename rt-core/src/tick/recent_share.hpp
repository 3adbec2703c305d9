// Recent share: the share of recent time for which a condition held, as a leaky bucket.
//
//     s <- s + (held / elapsed - s) (1 - exp(-elapsed / window))
//
// A condition that holds from now on reaches the share s after -window ln(1 - s); one that holds for a part of every
// short cycle reaches that part. Only time counts, not ticks: a gap weighs as much as the ticks that it replaced.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic::rt {

class RecentShare {
  public:
    /// window_ns: time constant, positive.
    explicit RecentShare(std::int64_t window_ns) HAPTIC_RT : window_ns_(static_cast<double>(window_ns)) {}

    /// Takes the time since the last call and the part of it for which the condition held; limited to 0..elapsed_ns.
    void update(std::int64_t held_ns, std::int64_t elapsed_ns) HAPTIC_RT {
        if (elapsed_ns <= 0) {
            return;
        }
        const double share = std::clamp(static_cast<double>(held_ns) / static_cast<double>(elapsed_ns), 0.0, 1.0);
        value_ += (share - value_) * (1.0 - std::exp(-static_cast<double>(elapsed_ns) / window_ns_));
    }
    void reset() HAPTIC_RT { value_ = 0.0; }

    /// 0..1.
    [[nodiscard]] double value() const HAPTIC_RT { return value_; }

  private:
    double window_ns_;
    double value_ = 0.0;
};

}  // namespace haptic::rt
