// The report of a measurement as one HTML page that needs nothing else: tables, and plots as inline SVG.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace haptic::rt {

/// Of one report. Throws std::runtime_error if it is no report of a measurement.
[[nodiscard]] std::string measure_page(const nlohmann::json& report);

/// Of two, the second drawn over the first. Throws likewise.
[[nodiscard]] std::string comparison_page(const nlohmann::json& first, const nlohmann::json& second);

}  // namespace haptic::rt
