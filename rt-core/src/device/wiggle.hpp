// Wiggle: encoder counts of a grip that a hand moves about, from which the geometry of the device is fitted.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "haptic/device/device_geometry.hpp"
#include "haptic/frames.hpp"

namespace haptic::rt {

/// Counts of all strings since the calibration, one sample.
using StringCounts = std::array<std::int64_t, kStrings>;
using Wiggle = std::vector<StringCounts>;

/// Reads a wiggle from a recording: the first stretch of rows in which the loop was running. Counts are unwrapped and
/// relative to the first row, where the grip was calibrated. Throws CsvError if there are no counters or no such rows.
[[nodiscard]] Wiggle load_wiggle(const std::filesystem::path& recording, const device::DeviceGeometry& geometry);

/// At most max_samples of the samples, spaced by movement of the strings, not by time: a resting grip adds nothing.
[[nodiscard]] Wiggle thinned(const Wiggle& wiggle, std::size_t max_samples);

}  // namespace haptic::rt
