// External programs that draw: gnuplot and povray, run to their end with text in and text out.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace haptic {

struct ExternalResult {
    bool found = false;      // the program is installed
    bool succeeded = false;  // it ended with status 0
    std::string output{};
    std::string errors{};
};

/// Runs a program of PATH in a folder with `input` as its standard input, default scheduling and default signals.
/// Blocks until it ends, so it is nothing for a real-time thread. Throws std::system_error if the machine has no memory
/// for it.
[[nodiscard]] ExternalResult run_external(std::vector<std::string> command, const std::string& input,
                                          const std::filesystem::path& folder);

}  // namespace haptic
