#include "commands/cyclictest.hpp"

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "commands/child_process.hpp"
#include "haptic/clock.hpp"

namespace haptic::rt {
namespace {

constexpr int kKeptNs = 1'000'000;  // largest histogram that cyclictest accepts, one bucket per ns
constexpr std::int64_t kMaxDelayNs = 30 * kNanosecondsPerSecond;  // tolerated after its nominal end, on slow machines

/// RAII temporary file.
class TemporaryFile {
  public:
    TemporaryFile() : path_(std::filesystem::temp_directory_path() / "rt-core-cyclictest-XXXXXX") {
        std::string name = path_.string();
        const int file = mkstemp(name.data());
        if (file < 0) {
            throw std::runtime_error(path_.string() + ": cannot create a temporary file for cyclictest's result");
        }
        close(file);
        path_ = name;
    }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;
    ~TemporaryFile() {
        std::error_code ignored;
        std::filesystem::remove(path_, ignored);
    }
    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

  private:
    std::filesystem::path path_;
};

std::string content_of(const std::filesystem::path& file) {
    const std::ifstream stream(file);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
}

}  // namespace

void add_cyclictest(const std::string& json, CyclictestResult& result) {
    try {
        const nlohmann::json report = nlohmann::json::parse(json);
        const nlohmann::json& thread = report.at("thread").at("0");
        // Histogram {"latency in ns": count} of the only thread.
        std::uint64_t kept = 0;
        for (const auto& [latency_ns, count] : thread.at("histogram").items()) {
            const std::int64_t duration_ns = std::stoll(latency_ns);
            for (std::uint64_t i = 0; i < count.get<std::uint64_t>(); ++i) {
                result.wakeup.record(duration_ns);
            }
            kept += count.get<std::uint64_t>();
        }
        // Cycles beyond the histogram have no latency of their own: record each with the maximum.
        const auto cycles = thread.at("cycles").get<std::uint64_t>();
        for (; kept < cycles; ++kept) {
            result.wakeup.record(thread.at("max").get<std::int64_t>());
            ++result.overflowed;
        }
    } catch (const std::exception& error) {
        throw std::runtime_error(std::string("cannot parse cyclictest's result: ") + error.what());
    }
}

Cyclictest::Cyclictest() : program_(find_program("cyclictest", "rt-tests")) {}

void Cyclictest::prepare(const RealtimeSetup& setup, std::int64_t period_ns, double duration_s) {
    cpu_ = setup.cpu;
    duration_s_ = std::max(1.0, std::round(duration_s));
    // Same policy, priority, period and processor as the loop.
    const bool fifo = setup.policy == "SCHED_FIFO";
    command_ = {program_,
                "--quiet",
                "--default-system",  // no tuning of its own: it shall run under the same conditions as the loop
                "--nsecs",
                "--histogram=" + std::to_string(kKeptNs),
                "--interval=" + std::to_string(period_ns / 1000),
                "--duration=" + std::to_string(std::lround(duration_s_)),
                fifo ? "--policy=fifo" : "--policy=other",
                "--priority=" + std::to_string(fifo ? setup.priority : 0)};
    if (setup.cpu >= 0) {
        command_.push_back("--affinity=" + std::to_string(setup.cpu));
    }
    if (setup.memory_locked) {
        command_.emplace_back("--mlockall");
    }
    result_.command = command_text(command_);
}

bool Cyclictest::run(const StopSignals& signals) {
    const TemporaryFile file;
    std::vector<std::string> command = command_;
    command.push_back("--json=" + file.path().string());
    // cyclictest uses only processors that its parent may use, and an isolated one is usually not among those.
    const ScopedAffinity include(cpu_, ScopedAffinity::Change::Include);
    ChildProcess child(command);
    const std::int64_t begin_ns = monotonic_now_ns();
    while (true) {
        // Collect the result once it has ended; end it early on a signal or a timeout.
        if (const std::optional<int> status = child.exit_status()) {
            if (*status != 0) {
                throw std::runtime_error("cyclictest failed with status " + std::to_string(*status) + ": " +
                                         command_text(command));
            }
            add_cyclictest(content_of(file.path()), result_);
            return true;
        }
        if (signals.wait(StopSignals::kPollNs) != 0) {
            return false;
        }
        if (monotonic_now_ns() - begin_ns > nanoseconds(duration_s_) + kMaxDelayNs) {
            throw std::runtime_error("cyclictest does not terminate: " + command_text(command));
        }
    }
}

}  // namespace haptic::rt
