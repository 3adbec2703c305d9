#include "commands/run_command.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "commands/replay_command.hpp"
#include "commands/run.hpp"
#include "haptic/report.hpp"
#include "measure/run_report.hpp"

namespace haptic::rt {

Config load_config(const std::optional<std::filesystem::path>& file, const std::vector<std::string>& assignments) {
    Config config = file ? Config::load(*file) : Config();
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return config;
}

int run_command(const RunOptions& options) {
    if (options.device.starts_with("replay:")) {
        return replay_command(options);
    }
    const Config config = load_config(options.config, options.assignments);
    const Settings settings = read_settings(config);
    if (options.record) {
        save_config_for(*options.record, config);
    }
    const StopSignals signals;
    return Run(options, settings, signals).execute([&options](const RunResult& result, const Instruments& instruments) {
        if (options.report) {
            write_report(*options.report, make_report(result, instruments));
        }
        std::fputs(summary(result, instruments).c_str(), stdout);
        return result.succeeded() ? 0 : kExitFaulted;
    });
}

}  // namespace haptic::rt
