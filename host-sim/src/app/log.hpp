// Log of the long-running commands.
#pragma once

#include <string>

namespace haptic::sim {

/// Sends the log to stderr, each line prefixed by "host-sim: ".
void log_to_stderr();

/// Logs a warning, unless the text is empty.
void warn_unless_empty(const std::string& warning);

}  // namespace haptic::sim
