// The hand that holds the grip: where it is on its track, whether it waits.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "haptic/pose_track.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

class HandMotion {
  public:
    HandMotion(PoseTrack track, bool waits) : track_(std::move(track)), waits_(waits) {}

    /// So much time goes by.
    void advance(std::int64_t passed_ns) HAPTIC_RT {
        if (!waits_) {
            time_ns_ += passed_ns;
        }
    }
    /// Begins to follow the track.
    void release() HAPTIC_RT { waits_ = false; }
    [[nodiscard]] bool waits() const HAPTIC_RT { return waits_; }

    /// Where it was so long before now; before it was released, at the beginning of its track.
    [[nodiscard]] Pose pose(std::int64_t before_now_ns = 0) const HAPTIC_RT {
        return track_.at(waits_ ? time_ns_ : std::max<std::int64_t>(time_ns_ - before_now_ns, 0));
    }

  private:
    PoseTrack track_;
    std::int64_t time_ns_ = 0;  // on the track
    bool waits_;
};

}  // namespace haptic::device
