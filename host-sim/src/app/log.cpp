#include "app/log.hpp"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <utility>

namespace haptic::sim {

void log_to_stderr() {
    auto logger = std::make_shared<spdlog::logger>("host-sim", std::make_shared<spdlog::sinks::stderr_sink_st>());
    logger->set_pattern("host-sim: %v");
    spdlog::set_default_logger(std::move(logger));
}

void warn_unless_empty(const std::string& warning) {
    if (!warning.empty()) {
        spdlog::warn("{}", warning);
    }
}

}  // namespace haptic::sim
