// A hand as a list of poses over time: what `--hand`, `--input` and the emulated board follow.
//
// The file is a recording with the columns time_s, x_m, y_m, z_m and, all or none, qw, qx, qy, qz; others are ignored.
// Between rows the position is interpolated linearly and the orientation along the shortest arc; before the first and
// after the last row the pose is held.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

/// A fraction of the way: the position on the straight line, the orientation along the shortest arc.
[[nodiscard]] Pose interpolate(const Pose& from, const Pose& to, double fraction) HAPTIC_RT;

class PoseTrack {
  public:
    /// Holds still at the given pose.
    explicit PoseTrack(const Pose& still = {});
    /// Times in seconds, strictly increasing, one pose each. Throws std::invalid_argument.
    PoseTrack(std::vector<double> times_s, std::vector<Pose> poses);
    /// Throws CsvError: as CsvTable::load, or times that do not increase, or a quaternion that is not of unit length.
    [[nodiscard]] static PoseTrack load(const std::filesystem::path& file);

    /// The pose at a time since the track's zero. Bounded by log2 of the number of rows.
    [[nodiscard]] Pose at(std::int64_t time_ns) const HAPTIC_RT;
    /// Time of the last row, s; 0 for a hand that holds still.
    [[nodiscard]] double duration_s() const noexcept;

  private:
    std::vector<double> times_s_;
    std::vector<Pose> poses_;
};

}  // namespace haptic
