// Where the commands that run for long say what happens.
#pragma once

#include <string>

namespace haptic::sim {

/// From here on what is logged goes to stderr, each line after "host-sim: ".
void log_to_stderr();

/// Logs a warning, unless it is empty.
void warn_of(const std::string& warning);

}  // namespace haptic::sim
