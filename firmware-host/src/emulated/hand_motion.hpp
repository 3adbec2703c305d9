// The hand that holds the grip: where it is on its track, whether it waits, and its way back.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include <haptic/pose_track.hpp>
#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::device {

class HandMotion {
  public:
    HandMotion(PoseTrack track, bool waits) : track_(std::move(track)), returns_from_(track_.at(0)), waits_(waits) {}

    /// So much time goes by.
    void advance(std::int64_t passed_ns) HAPTIC_RT {
        const std::int64_t of_return_ns = std::max<std::int64_t>(std::min(kReturnNs - since_held_ns_, passed_ns), 0);
        since_held_ns_ += passed_ns;
        if (!waits_) {
            time_ns_ += passed_ns - of_return_ns;
        }
    }
    /// Begins to follow the track.
    void release() HAPTIC_RT { waits_ = false; }
    /// Goes back to the beginning of its track, where it waits.
    void hold() HAPTIC_RT {
        returns_from_ = pose();
        since_held_ns_ = 0;
        time_ns_ = 0;
        waits_ = true;
    }
    [[nodiscard]] bool waits() const HAPTIC_RT { return waits_; }

    /// Where it was so long before now; before it was released, at the beginning of its track. Of what was before the
    /// last hold() only the last pose is known.
    [[nodiscard]] Pose pose(std::int64_t before_now_ns = 0) const HAPTIC_RT {
        const std::int64_t returning_ns = since_held_ns_ - before_now_ns;
        if (returning_ns < kReturnNs) {
            const double way = static_cast<double>(std::max<std::int64_t>(returning_ns, 0)) / kReturnNs;
            return interpolate(returns_from_, track_.at(0), way * way * (3.0 - 2.0 * way));  // begins and ends gently
        }
        return track_.at(waits_ ? time_ns_ : std::max<std::int64_t>(time_ns_ - before_now_ns, 0));
    }

  private:
    static constexpr std::int64_t kReturnNs = 500'000'000;

    PoseTrack track_;
    Pose returns_from_;
    std::int64_t time_ns_ = 0;                // on the track
    std::int64_t since_held_ns_ = kReturnNs;  // and at the beginning of the track for ever before
    bool waits_;
};

}  // namespace haptic::device
