#include "commands/run_command.hpp"

#include <nlohmann/json.hpp>

#include "commands/replay_command.hpp"
#include "commands/run.hpp"
#include "commands/run_files.hpp"
#include "haptic/report.hpp"
#include "measure/run_report.hpp"
#include "process/force_profiles.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {

Config load_config(const std::optional<std::filesystem::path>& file, const std::vector<std::string>& assignments) {
    Config config = file ? Config::load(*file) : Config();
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return config;
}

Config load_run_config(const RunOptions& options) {
    Config config = load_config(options.config, options.assignments);
    if (options.profile) {
        config.set("safety.profile=\"" + *options.profile + "\"");
    } else if (options.device != "emulated" && !config.has("safety.profile")) {
        config.set(std::string("safety.profile=\"") + kDefaultProfile + "\"");
    }
    return config;
}

int run_command(const RunOptions& options) {
    if (options.device.starts_with("replay:")) {
        return replay_command(options);
    }
    Config config = load_run_config(options);
    const Settings settings = read_settings(config);
    FileUses files = files_of_run(options);
    add_device_files(files, config);
    files.require_distinct();
    if (options.record) {
        set_for_device(config, settings, options.device != "emulated");
        save_config_for(*options.record, config);
    }
    const StopSignals signals;
    RunOutput output;
    const auto conclude = [&](const RunResult& result, const Instruments& instruments, Results& results) {
        if (options.report) {
            results.write([&] { write_report(*options.report, make_report(result, instruments)); });
        }
        output.print(summary(result, instruments));
        return result.succeeded() ? kExitDone : kExitFaulted;
    };
    // The device and its guard are released before the output is waited for.
    const int status = Run(options, settings, signals, output).execute(conclude);
    return output.finish(signals, status);
}

}  // namespace haptic::rt
