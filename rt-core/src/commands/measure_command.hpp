// `rt-core measure`: measures the latency of the loop, the time of its stages, and the causes of late ticks.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "commands/run_command.hpp"

namespace haptic::rt {

struct MeasureOptions {
    RunOptions run;
    double duration_s = 60.0;                    // of the loop
    std::string load = "none";                   // or "stress-ng", with or without arguments
    std::vector<std::string> peers;              // tools that alternate with the loop, or "all"
    double alternate_s = 5.0;                    // duration of each turn of the loop and of a tool
    std::optional<std::string> loopback;         // like probes.loopback
    std::optional<double> break_above_us;        // ends the run at the first tick that ends later, and explains it
    std::optional<std::filesystem::path> trace;  // where the kernel's trace of that tick goes
    std::optional<std::filesystem::path> html;
    std::optional<std::filesystem::path> from;   // existing report to show instead of measuring
    std::vector<std::filesystem::path> compare;  // two existing reports to compare instead of measuring
};

/// Returns an exit status like run_command(). Throws the same exceptions, and std::runtime_error for reports that
/// cannot be read.
int measure_command(const MeasureOptions& options);

}  // namespace haptic::rt
