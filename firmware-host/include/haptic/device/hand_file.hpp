// Hand file: the recording of option --hand, which the hand of an emulated grip follows.
#pragma once

#include <filesystem>

#include "haptic/device/button_track.hpp"
#include "haptic/pose_track.hpp"

namespace haptic::device {

/// Loads a recording that may start anywhere: the hand starts at the centre and moves to the first pose within half a
/// second. A recording that starts at the centre is returned unchanged. Throws CsvError.
[[nodiscard]] PoseTrack hand_from_centre(const std::filesystem::path& file);

/// Its column `buttons` over the same time; not known if there is none. Throws CsvError, also for a value that is not a
/// whole number of 0 to 255.
[[nodiscard]] ButtonTrack buttons_of_hand(const std::filesystem::path& file);

}  // namespace haptic::device
