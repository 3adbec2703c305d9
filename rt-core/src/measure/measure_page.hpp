// Measurement page: the report of a measurement as one self-contained HTML page with tables and the plots of
// haptic/plot.hpp.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace haptic::rt {

/// Page of one report. `redraw` tells the reader of a page without plots, where gnuplot was missing, how to draw them
/// on another machine. Throws std::runtime_error if it is not a measurement report.
[[nodiscard]] std::string measure_page(const nlohmann::json& report, const std::string& redraw);

/// Page that compares two reports, the second drawn over the first. Throws std::runtime_error if either is not a
/// measurement report.
[[nodiscard]] std::string comparison_page(const nlohmann::json& first, const nlohmann::json& second,
                                          const std::string& redraw);

}  // namespace haptic::rt
