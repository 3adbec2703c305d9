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
#include <haptic/clock.hpp>

namespace haptic::rt {
namespace {

constexpr int kKeptNs = 1'000'000;  // the most that cyclictest has buckets for
constexpr std::int64_t kPollNs = 20'000'000;
constexpr std::int64_t kLongestDelayNs = 30 * kNanosecondsPerSecond;  // of its end, on a machine that is very slow

/// A file that is gone at the end.
class TemporaryFile {
  public:
    TemporaryFile() : path_(std::filesystem::temp_directory_path() / "rt-core-cyclictest-XXXXXX") {
        std::string name = path_.string();
        const int file = mkstemp(name.data());
        if (file < 0) {
            throw std::runtime_error(path_.string() + ": no temporary file for cyclictest's result can be made");
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

/// Lets what the calling thread starts run on a processor too, as long as it lives: cyclictest takes none that its
/// parent may not use, and an isolated one is not among those.
class Admit {
  public:
    explicit Admit(int cpu) {
        CPU_ZERO(&before_);
        if (cpu < 0 || cpu >= CPU_SETSIZE || sched_getaffinity(0, sizeof before_, &before_) != 0) {
            return;
        }
        cpu_set_t more = before_;
        CPU_SET(static_cast<std::size_t>(cpu), &more);
        admitted_ = pthread_setaffinity_np(pthread_self(), sizeof more, &more) == 0;
    }
    Admit(const Admit&) = delete;
    Admit& operator=(const Admit&) = delete;
    ~Admit() {
        if (admitted_) {
            pthread_setaffinity_np(pthread_self(), sizeof before_, &before_);
        }
    }

  private:
    cpu_set_t before_{};
    bool admitted_ = false;
};

std::string text_of(const std::filesystem::path& file) {
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
        std::uint64_t kept = 0;
        for (const auto& [latency_ns, count] : thread.at("histogram").items()) {
            const std::int64_t duration_ns = std::stoll(latency_ns);
            for (std::uint64_t i = 0; i < count.get<std::uint64_t>(); ++i) {
                result.wakeup.record(duration_ns);
            }
            kept += count.get<std::uint64_t>();
        }
        // What was longer than it keeps it only counts: all of it stands as the longest.
        const auto cycles = thread.at("cycles").get<std::uint64_t>();
        for (; kept < cycles; ++kept) {
            result.wakeup.record(thread.at("max").get<std::int64_t>());
            ++result.beyond;
        }
    } catch (const std::exception& error) {
        throw std::runtime_error(std::string("cyclictest's result cannot be read: ") + error.what());
    }
}

Cyclictest::Cyclictest() : program_(find_program("cyclictest", "rt-tests")) {}

void Cyclictest::prepare(const RealtimeSetup& setup, std::int64_t period_ns, double duration_s) {
    cpu_ = setup.cpu;
    duration_s_ = std::max(1.0, std::round(duration_s));
    const bool fifo = setup.policy == "SCHED_FIFO";
    command_ = {program_,
                "--quiet",
                "--default-system",  // what holds for the loop holds for it: this process keeps the machine as it is
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
    result_.command = in_words(command_);
}

bool Cyclictest::run(const StopSignals& signals) {
    const TemporaryFile file;
    std::vector<std::string> command = command_;
    command.push_back("--json=" + file.path().string());
    const Admit admit(cpu_);
    ChildProcess child(command);
    const std::int64_t begin_ns = monotonic_now_ns();
    while (true) {
        if (const std::optional<int> status = child.ended()) {
            if (*status != 0) {
                throw std::runtime_error("cyclictest failed with status " + std::to_string(*status) + ": " +
                                         in_words(command));
            }
            add_cyclictest(text_of(file.path()), result_);
            return true;
        }
        if (signals.wait(kPollNs) != 0) {
            return false;
        }
        if (monotonic_now_ns() - begin_ns > nanoseconds(duration_s_) + kLongestDelayNs) {
            throw std::runtime_error("cyclictest does not end: " + in_words(command));
        }
    }
}

}  // namespace haptic::rt
