// Pose track: the motion of a hand as a list of poses over time. `--hand`, `--input` and the emulated board follow it.
//
// File format: a recording with the columns time_s, x_m, y_m, z_m and optionally qw, qx, qy, qz (all or none); other
// columns are ignored. Between rows the position is interpolated linearly and the orientation along the shortest arc
// (slerp). Before the first and after the last row the pose is constant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

/// Interpolates at a fraction 0..1: position linearly, orientation along the shortest arc.
[[nodiscard]] Pose interpolate(const Pose& from, const Pose& to, double fraction) HAPTIC_RT;

class PoseTrack {
  public:
    /// Constant pose.
    explicit PoseTrack(const Pose& still = {});
    /// Times, s, strictly increasing, one per pose. Throws std::invalid_argument.
    PoseTrack(std::vector<double> times_s, std::vector<Pose> poses);
    /// Throws CsvError: as CsvTable::load(), times that do not increase, or a quaternion that is not of unit length.
    [[nodiscard]] static PoseTrack load(const std::filesystem::path& file);

    /// Pose at a time since the track's zero. O(log rows).
    [[nodiscard]] Pose at(std::int64_t time_ns) const HAPTIC_RT;
    /// Time of the last row, s; 0 for a constant pose.
    [[nodiscard]] double duration_s() const noexcept;

  private:
    std::vector<double> times_s_;
    std::vector<Pose> poses_;
};

}  // namespace haptic
