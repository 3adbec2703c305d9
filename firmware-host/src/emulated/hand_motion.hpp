// Hand motion: the pose of the hand that holds the grip. The hand waits at the start of its track, follows it, or
// returns to its start; meanwhile it trembles.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "haptic/device/tremor.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

class HandMotion {
  public:
    HandMotion(PoseTrack track, bool waits, const TremorSettings& tremor = {})
        : track_(std::move(track)), tremor_(tremor), return_start_(track_.at(0)), waits_(waits) {}

    /// Advances by an amount of time.
    void advance(std::int64_t passed_ns) HAPTIC_RT {
        age_ns_ += passed_ns;
        // The time spent returning does not count on the track.
        const std::int64_t of_return_ns = std::max<std::int64_t>(std::min(kReturnNs - since_held_ns_, passed_ns), 0);
        since_held_ns_ += passed_ns;
        if (!waits_) {
            time_ns_ += passed_ns - of_return_ns;
        }
    }
    /// Starts to follow the track.
    void release() HAPTIC_RT { waits_ = false; }
    /// Returns to the start of the track and waits there.
    void hold() HAPTIC_RT {
        return_start_ = steady_pose(0);
        since_held_ns_ = 0;
        time_ns_ = 0;
        waits_ = true;
    }
    [[nodiscard]] bool waits() const HAPTIC_RT { return waits_; }
    /// On the track.
    [[nodiscard]] std::int64_t time_ns() const HAPTIC_RT { return time_ns_; }

    /// Pose at `before_now_ns` before the present: the start of the track before the release, and the last pose before
    /// the last hold().
    [[nodiscard]] Pose pose(std::int64_t before_now_ns = 0) const HAPTIC_RT {
        return tremor_.applied_to(steady_pose(before_now_ns), age_ns_ - before_now_ns);
    }

  private:
    static constexpr std::int64_t kReturnNs = 500'000'000;

    /// Without the tremor.
    [[nodiscard]] Pose steady_pose(std::int64_t before_now_ns) const HAPTIC_RT {
        const std::int64_t returning_ns = since_held_ns_ - before_now_ns;
        if (returning_ns < kReturnNs) {
            // Smoothstep 3 s^2 - 2 s^3: starts and ends with zero velocity.
            const double progress = static_cast<double>(std::max<std::int64_t>(returning_ns, 0)) / kReturnNs;
            return interpolate(return_start_, track_.at(0), progress * progress * (3.0 - 2.0 * progress));
        }
        return track_.at(waits_ ? time_ns_ : std::max<std::int64_t>(time_ns_ - before_now_ns, 0));
    }

    PoseTrack track_;
    Tremor tremor_;
    Pose return_start_;
    std::int64_t age_ns_ = 0;                 // all time that has passed, which the tremor follows
    std::int64_t time_ns_ = 0;                // on the track
    std::int64_t since_held_ns_ = kReturnNs;  // initially: the return is complete
    bool waits_;
};

}  // namespace haptic::device
