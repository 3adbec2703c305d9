// Measurement page: the report of a measurement as one self-contained HTML page with tables and inline SVG plots.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace haptic::rt {

/// Page of one report. Throws std::runtime_error if it is not a measurement report.
[[nodiscard]] std::string measure_page(const nlohmann::json& report);

/// Page that compares two reports, the second drawn over the first. Throws std::runtime_error if either is not a
/// measurement report.
[[nodiscard]] std::string comparison_page(const nlohmann::json& first, const nlohmann::json& second);

}  // namespace haptic::rt
