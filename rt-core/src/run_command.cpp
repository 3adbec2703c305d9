#include "run_command.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/mman.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "haptic/clock.hpp"
#include "haptic/report.hpp"
#include "haptic/ring.hpp"
#include "haptic/rt/crash_guard.hpp"
#include "haptic/rt/recording.hpp"
#include "haptic/rt/run_report.hpp"
#include "haptic/rt/settings.hpp"
#include "open_device.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kPollNs = 20'000'000;

/// SIGINT, SIGTERM and SIGHUP wait to be asked for, in every thread that is created from here on.
class StopSignals {
  public:
    StopSignals() {
        sigemptyset(&set_);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
            sigaddset(&set_, signal);
        }
        pthread_sigmask(SIG_BLOCK, &set_, nullptr);
    }
    /// Waits for one, at most so long. The signal's number, 0 for none.
    [[nodiscard]] int wait(std::int64_t at_most_ns) const {
        const timespec time{at_most_ns / kNanosecondsPerSecond, at_most_ns % kNanosecondsPerSecond};
        const int signal = sigtimedwait(&set_, nullptr, &time);
        return signal > 0 ? signal : 0;  // EAGAIN and EINTR: none yet
    }

  private:
    sigset_t set_{};
};

Settings load_settings(const RunOptions& options) {
    Config config = options.config ? Config::load(*options.config) : Config();
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    return read_settings(config);
}

/// Says what the kernel refused and how to grant it. A real device is not driven by a loop that may be late.
void judge_setup(const RealtimeSetup& setup, bool real) {
    for (const MissingPrivilege& one : setup.missing) {
        spdlog::warn("degraded: {}", one.what);
        spdlog::warn("  it needs {}", one.needs);
        spdlog::warn("  {}", one.remedy);
    }
    if (setup.degraded() && real) {
        throw Refusal("a real device is not driven without real-time privileges: see above for what is missing");
    }
    if (setup.degraded()) {
        spdlog::warn("going on because the device is emulated");
    }
}

std::filesystem::path black_box_path(const RunOptions& options) {
    if (options.report) {
        return std::filesystem::path(*options.report).replace_extension("fault.csv");
    }
    if (options.record) {
        return std::filesystem::path(*options.record).replace_extension("fault.csv");
    }
    return "rt-core-" + options.session + ".fault.csv";
}

/// Waits for the end, writing the recording meanwhile.
void supervise(RealtimeLoop& loop, const StopSignals& signals, std::optional<RecordFile>& record,
               const std::optional<double>& duration_s) {
    const std::int64_t start_ns = monotonic_now_ns();
    bool announced = false;
    bool stopping = false;
    while (!loop.finished()) {
        const int signal = signals.wait(kPollNs);
        const bool over = duration_s && monotonic_now_ns() - start_ns >= nanoseconds(*duration_s);
        if ((signal != 0 || over) && !stopping) {
            spdlog::info("stopping: {}", signal != 0 ? "asked to by a signal" : "the duration is over");
            loop.request_stop();
            stopping = true;
        }
        if (!announced && loop.safety_state() == SafetyState::Running) {
            spdlog::info("running");
            announced = true;
        }
        if (record) {
            record->drain();
        }
    }
}

/// Everything that outlives the loop, in the order in which it has to go.
RunResult run_loop(const RunOptions& options, const Settings& settings, const StopSignals& signals,
                   Instruments& instruments) {
    const std::unique_ptr<OpenedDevice> device = open_device(options, settings);
    RingReader<ContactFrame> frames(options.session);
    RingWriter<DeviceState> states(options.session);
    Tick tick(settings.tick, device->board(), frames, states, &monotonic_now_ns);
    device->follow(tick);
    Recorder recorder(options.record ? settings.queue_ticks : 2, options.record ? settings.queue_frames : 2);
    std::optional<RecordFile> record;
    if (options.record) {
        record.emplace(*options.record, recorder);
    }

    const CrashGuard guard(device->board());
    RunResult result;
    prepare_process(result.setup);
    RealtimeLoop loop(settings.loop, tick, std::move(result.setup));
    result.setup = loop.setup();
    judge_setup(result.setup, device->real());
    spdlog::info("session {}: {} Hz on {}; keep the grip still at the centre", options.session,
                 static_cast<double>(kNanosecondsPerSecond) / static_cast<double>(settings.loop.period_ns),
                 device->description());
    const std::int64_t start_ns = monotonic_now_ns();
    loop.start(options.record ? &recorder : nullptr);
    supervise(loop, signals, record, options.duration_s);
    loop.join();

    result.duration_s = seconds(monotonic_now_ns() - start_ns);
    result.usage = loop.usage();
    result.state = tick.safety_state();
    result.faults = tick.faults();
    result.records_dropped = recorder.dropped();
    result.frames_dropped = recorder.frames_dropped();
    instruments = tick.instruments();
    if (record) {
        record->close();
    }
    if (!result.held()) {
        const std::filesystem::path box = black_box_path(options);
        write_black_box(box, tick.black_box());
        spdlog::error("faulted: the last {} ticks are in {}", tick.black_box().size(), box.string());
    }
    return result;
}

}  // namespace

int run_command(const RunOptions& options) {
    const Settings settings = load_settings(options);
    const StopSignals signals;
    const auto instruments = std::make_unique<Instruments>();
    const RunResult result = run_loop(options, settings, signals, *instruments);
    if (options.report) {
        write_report(*options.report, make_report(result, *instruments));
    }
    std::fputs(summary(result, *instruments).c_str(), stdout);
    return result.held() ? 0 : kExitFaulted;
}

}  // namespace haptic::rt
