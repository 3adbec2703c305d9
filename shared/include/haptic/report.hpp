// JSON report of a run, as both processes write it.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "haptic/histogram.hpp"
#include "haptic/period_histogram.hpp"

namespace haptic {

/// {min, p50, p99, p999, max} in microseconds, and count.
[[nodiscard]] nlohmann::json summary_us(const Histogram& histogram);
[[nodiscard]] nlohmann::json summary_us(const PeriodHistogram& histogram);

/// The non-empty buckets as [[lower_us, upper_us, count], ...], for plots.
[[nodiscard]] nlohmann::json buckets_us(const Histogram& histogram);
[[nodiscard]] nlohmann::json buckets_us(const PeriodHistogram& histogram);

/// Writes a temporary file and renames it to `file`. Throws std::runtime_error that names the file.
void write_report(const std::filesystem::path& file, const nlohmann::json& report);

}  // namespace haptic
