// `rt-core measure`: how late the loop is, where its time goes, and why.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "commands/run_command.hpp"

namespace haptic::rt {

struct MeasureOptions {
    RunOptions run;
    double duration_s = 60.0;   // of the loop
    std::string load = "none";  // or "stress-ng", with arguments or without
    bool cyclictest = false;
    double alternate_s = 5.0;             // after which the loop and cyclictest take turns
    std::optional<std::string> loopback;  // as probes.loopback
    std::optional<std::filesystem::path> html;
    std::optional<std::filesystem::path> from;   // a report; nothing is measured
    std::vector<std::filesystem::path> compare;  // two reports; nothing is measured
};

/// Returns the exit status, as run_command(). Throws what it throws, and std::runtime_error for reports that cannot be
/// read.
int measure_command(const MeasureOptions& options);

}  // namespace haptic::rt
