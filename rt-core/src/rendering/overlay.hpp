// Overlay: a wrench that a third program adds beside the contact, within bounds of its own; off by default.
//
// Its size is limited, keeping the direction, and its rate, so that it rises from zero to the largest size, and falls
// back, in no less than `ramp`. An overlay that is older than `timeout` counts as zero. So it fades linearly and within
// `ramp`, whether its sender has fallen silent, or the program between them has died.
#pragma once

#include <cstdint>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "rendering/limits.hpp"

namespace haptic::rt {

struct OverlaySettings {
    double max_force = 0.0;                // N
    double max_torque = 0.0;               // N*m
    std::int64_t timeout_ns = 50'000'000;  // ns, age up to which an overlay counts
    std::int64_t ramp_ns = 100'000'000;    // ns, from zero to the largest size

    [[nodiscard]] bool on() const HAPTIC_RT { return max_force > 0.0 || max_torque > 0.0; }
};

class Overlay {
  public:
    explicit Overlay(const OverlaySettings& settings);

    /// Takes a received overlay. Returns false if it is refused: a number is not finite, or its arrival lies ahead by
    /// more than the time-out.
    bool accept(const WrenchOverlay& received, std::int64_t now_ns) HAPTIC_RT;
    /// The wrench to add now, device frame. elapsed_ns: since the last call.
    [[nodiscard]] Wrench render(std::int64_t now_ns, std::int64_t elapsed_ns) HAPTIC_RT;
    /// Forgets what was received, and rises from zero again.
    void reset() HAPTIC_RT;

  private:
    std::int64_t timeout_ns_;
    WrenchLimiter limiter_;
    Wrench newest_;
    std::int64_t arrival_ns_ = 0;
};

}  // namespace haptic::rt
