#include "commands/replay_command.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands/run_files.hpp"
#include "haptic/clock.hpp"
#include "haptic/report.hpp"
#include "haptic/ring.hpp"
#include "haptic/text_file.hpp"
#include "measure/recording.hpp"
#include "measure/replay.hpp"
#include "measure/run_report.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"

namespace haptic::rt {
namespace {

constexpr std::uint64_t kTicksPerDrain = 1000;  // of the replay's own recording; its queues hold twice as many

/// The settings of --config, else those of the recording, with the assignments applied.
Config load_replay_config(const RunOptions& options, const std::filesystem::path& recording) {
    std::optional<std::filesystem::path> file = options.config;
    if (!file && std::filesystem::exists(config_file_of(recording))) {
        file = config_file_of(recording);
    } else if (!file) {
        spdlog::warn("{} is missing: replaying with the default settings", config_file_of(recording).string());
    }
    return load_config(file, options.assignments);
}

nlohmann::json differences_json(const ReplayResult& result) {
    nlohmann::json columns = nlohmann::json::object();
    for (const auto& [name, difference] : result.columns) {
        columns[name] = {{"first_tick", difference.first_tick},
                         {"line", difference.line},
                         {"recorded", difference.recorded},
                         {"replayed", difference.replayed},
                         {"largest", difference.largest}};
    }
    return {{"ticks", result.ticks},
            {"frames", result.frames},
            {"identical", result.identical()},
            {"differing_ticks", result.differing_ticks},
            {"compared_columns", result.compared_columns},
            {"columns", columns}};
}

void print(const ReplayResult& result, std::int64_t recorded_ns, std::int64_t took_ns) {
    std::printf("replayed %llu ticks and %llu frames, %.3f s of recording in %.3f s\n",
                static_cast<unsigned long long>(result.ticks), static_cast<unsigned long long>(result.frames),
                seconds(recorded_ns), seconds(took_ns));
    // Verdict, then the first difference, then all differing columns.
    if (result.identical()) {
        std::printf("identical: %zu columns of every tick\n", result.compared_columns);
        return;
    }
    const auto& [name, first] = result.first();
    std::printf("DIFFERS in %llu ticks, first in tick %llu (line %zu), column %s: recorded %s, now %s\n",
                static_cast<unsigned long long>(result.differing_ticks),
                static_cast<unsigned long long>(first.first_tick), first.line, name.c_str(), first.recorded.c_str(),
                first.replayed.c_str());
    for (const auto& [column, difference] : result.columns) {
        std::printf("  %-14s from tick %llu on, by at most %.3g\n", column.c_str(),
                    static_cast<unsigned long long>(difference.first_tick), difference.largest);
    }
}

/// Session of the ring to which the replay publishes its states; private, so that it cannot disturb a running rt-core.
std::string private_session() {
    return "replay-" + std::to_string(getpid());
}

void run_all(Replay& replay, const RunOptions& options, const Settings& settings, Results& results) {
    Recorder recorder(options.record ? std::max<std::size_t>(settings.queue_ticks, 2 * kTicksPerDrain) : 2,
                      options.record ? 2 * kTicksPerDrain : 2);
    std::optional<RecordFile> record;
    if (options.record) {
        record.emplace(*options.record, recorder);
    }
    ProgressBar progress("replaying");
    // Replay tick by tick, writing the new recording in batches.
    while (replay.step(record ? &recorder : nullptr)) {
        if (replay.result().ticks % kTicksPerDrain == 0) {
            if (record) {
                record->drain();
            }
            progress.show(replay.share());
        }
        if (options.duration_s && replay.recorded_ns() >= nanoseconds(*options.duration_s)) {
            break;
        }
    }
    if (record) {
        results.write([&record] { record->close(); });
    }
}

}  // namespace

int replay_command(const RunOptions& options) {
    if (options.hand) {
        throw Refusal("--hand: a replay uses the hand of its recording");
    }
    const std::filesystem::path recording = replayed_recording(options);
    const Config config = load_replay_config(options, recording);
    Settings settings = read_settings(config);
    FileUses files = files_of_run(options);
    add_device_files(files, config);
    files.require_distinct();
    // Not whether a real device was recorded, which the recording's settings have replaced: set_for_device().
    settings.tick.safety.prove = settings.prove == Prove::Always;
    // Replay with a private ring.
    RingWriter<DeviceState> states(private_session());
    Replay replay(recording, settings.tick, states, &monotonic_now_ns);
    if (options.record) {
        save_config_for(*options.record, config);
    }
    const std::int64_t start_ns = monotonic_now_ns();
    Results results;
    run_all(replay, options, settings, results);
    const std::int64_t took_ns = monotonic_now_ns() - start_ns;

    const ReplayResult& result = replay.result();
    if (result.ticks == 0) {
        throw CsvError(recording.string() + ": the recording has no ticks");
    }
    // Report like a run, with the differences added.
    RunResult run;
    run.state = replay.tick().safety_state();
    run.faults = replay.tick().faults();
    run.duration_s = seconds(replay.recorded_ns());
    run.geometry = settings.tick.geometry;
    if (options.report) {
        nlohmann::json report = make_report(run, replay.tick().instruments());
        report["replay"] = differences_json(result);
        results.write([&] { write_report(*options.report, report); });
    }
    print(result, replay.recorded_ns(), took_ns);
    for (const std::string& name : fault_names(run.faults & ~std::uint32_t{HAPTIC_FAULT_STOP})) {
        std::printf("FAULT: %s\n", name.c_str());
    }
    const bool other_settings = options.config || !options.assignments.empty();
    for (const std::string& problem : results.problems()) {
        spdlog::error("{}", problem);
    }
    return results.status(result.identical() || other_settings ? kExitDone : kExitDiffers);
}

void save_config_for(const std::filesystem::path& recording, const Config& config) {
    if (std::filesystem::exists(recording) && !std::filesystem::is_regular_file(recording)) {
        return;  // a recording to a pipe keeps no settings
    }
    write_text(config_file_of(recording),
               "# Settings of the recording " + recording.filename().string() + ".\n" + config.toml());
}

}  // namespace haptic::rt
