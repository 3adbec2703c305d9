#include "commands/run_command.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>

#include <haptic/report.hpp>
#include "measure/run_report.hpp"
#include "commands/replay_command.hpp"
#include "commands/run.hpp"

namespace haptic::rt {

int run_command(const RunOptions& options) {
    if (options.device.starts_with("replay:")) {
        return replay_command(options);
    }
    const Config config = load_config(options);
    const Settings settings = read_settings(config);
    if (options.record) {
        write_config_beside(*options.record, config);
    }
    const StopSignals signals;
    return Run(options, settings, signals).execute([&options](const RunResult& result, const Instruments& instruments) {
        if (options.report) {
            write_report(*options.report, make_report(result, instruments));
        }
        std::fputs(summary(result, instruments).c_str(), stdout);
        return result.held() ? 0 : kExitFaulted;
    });
}

}  // namespace haptic::rt
