// The file of `--hand`: what the hand that holds an emulated grip does.
#pragma once

#include <filesystem>

#include "haptic/pose_track.hpp"

namespace haptic::device {

/// The track of a recording, which may begin anywhere: the hand starts at the centre and moves to the first pose in
/// half a second. A recording that begins at the centre is taken as it is. Throws CsvError.
[[nodiscard]] PoseTrack hand_from_centre(const std::filesystem::path& file);

}  // namespace haptic::device
