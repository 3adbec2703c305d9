#include "program/log.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <string>

#include "program/progress_bar.hpp"

namespace haptic {

void log_to_stderr(const std::string& program) {
    spdlog::set_default_logger(spdlog::stderr_color_mt(program));
    // A line takes the place of a progress bar, which is drawn again below it.
    spdlog::set_pattern((stderr_shows_progress() ? std::string(kEraseLine) : "") + "%n %^%l%$: %v");
}

void warn_unless_empty(const std::string& warning) {
    if (!warning.empty()) {
        spdlog::warn("{}", warning);
    }
}

}  // namespace haptic
