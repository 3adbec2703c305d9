// Log: what a program says while it works, one line on stderr each.
#pragma once

#include <string>

namespace haptic {

/// Makes spdlog's default logger one that writes lines "PROGRAM LEVEL: TEXT" to stderr, coloured on a terminal.
void log_to_stderr(const std::string& program);

/// Logs a warning, unless the text is empty.
void warn_unless_empty(const std::string& warning);

}  // namespace haptic
