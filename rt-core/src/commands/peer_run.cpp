#include "commands/peer_run.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "commands/child_process.hpp"
#include "haptic/clock.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kMaxDelayNs = 30 * kNanosecondsPerSecond;  // tolerated after its nominal end, on slow machines
constexpr std::int64_t kMaxEndingNs = 5 * kNanosecondsPerSecond;  // for a tool that was interrupted

/// RAII temporary file.
class TemporaryFile {
  public:
    TemporaryFile() : path_(std::filesystem::temp_directory_path() / "rt-core-peer-XXXXXX") {
        std::string name = path_.string();
        const int file = mkstemp(name.data());
        if (file < 0) {
            throw std::runtime_error(path_.string() + ": cannot create a temporary file for a tool's result");
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

/// First line of what a tool printed, for an error.
std::string first_line(const std::string& text) {
    return text.substr(0, std::min(text.find('\n'), text.size()));
}

/// Why a tool cannot run here, and what to do; empty if it can.
std::string missing(const PeerTool& tool, std::string& program) {
    try {
        program = find_program(std::string(tool.program), std::string(tool.package));
    } catch (const Refusal& refusal) {
        return refusal.what();
    }
    return missing_tracer(tool.tracer);
}

/// Ends a tool as Ctrl-C does, so that it takes back what it has set in the kernel: rtla's threads would stay there.
void interrupt(ChildProcess& child) {
    const std::int64_t begin_ns = monotonic_now_ns();
    while (!child.exit_status() && monotonic_now_ns() - begin_ns < kMaxEndingNs) {
        child.interrupt();  // again, because a tool that is still starting ignores it
        usleep(100'000);
    }
}

}  // namespace

std::vector<PeerChoice> chosen_peers(const std::vector<std::string>& names) {
    const auto named = [&](std::string_view name) {
        return std::find(names.begin(), names.end(), name) != names.end();
    };
    std::vector<PeerChoice> chosen;
    std::string known = "all";
    for (const PeerTool& tool : peer_tools()) {
        if (named(tool.name) || named("all")) {
            chosen.push_back({.tool = &tool, .by_name = named(tool.name)});
        }
        known.append(", ").append(tool.name);
    }
    for (const std::string& name : names) {
        if (name != "all" && std::none_of(chosen.begin(), chosen.end(),
                                          [&](const PeerChoice& choice) { return choice.tool->name == name; })) {
            std::string problem = "--peers " + name;
            throw Refusal(
                problem.append(": is no tool that can be run beside the loop; the choices are ").append(known));
        }
    }
    return chosen;
}

PeerRun::PeerRun(const PeerChoice& choice) : tool_(choice.tool) {
    std::string program;
    result_.missing = missing(*tool_, program);
    if (choice.by_name && !available()) {
        throw Refusal(std::string(tool_->name) + ": " + result_.missing);
    }
    command_ = {program};
}

void PeerRun::prepare(const RealtimeSetup& setup, std::int64_t period_ns, double duration_s) {
    cpu_ = setup.cpu;
    if (cpu_ < 0 && !tool_->own_thread && available()) {
        result_.missing = "the loop is not pinned, and it would measure every processor; see loop.cpu";
        spdlog::warn("{} is not run: {}", tool_->name, result_.missing);
        return;
    }
    duration_s_ = std::max(tool_->least_s, static_cast<int>(std::lround(duration_s)));
    const std::vector<std::string> words =
        tool_->arguments({.setup = setup, .period_ns = period_ns, .duration_s = duration_s_});
    command_.insert(command_.end(), words.begin(), words.end());
    result_.command = command_text(command_);
}

bool PeerRun::run(const StopSignals& signals) {
    if (!available() || (tool_->once && ran_)) {
        return true;
    }
    try {
        return run_turn(signals);
    } catch (const std::runtime_error& error) {
        // The loop's own measurement may have run for hours.
        result_.failure = error.what();
        spdlog::warn("{}; it is not run again", result_.failure);
        return true;
    }
}

bool PeerRun::run_turn(const StopSignals& signals) {
    spdlog::info("{} for {} s", tool_->name, duration_s_);
    const TemporaryFile printed;
    const TemporaryFile written;
    const TemporaryFile& output = tool_->result_option.empty() ? printed : written;
    std::vector<std::string> command = command_;
    if (!tool_->result_option.empty()) {
        command.push_back(std::string(tool_->result_option) + written.path().string());
    }
    // A tool uses only processors that its parent may use, and an isolated one is usually not among those. One that
    // measures with threads of the kernel shall stay away from them.
    const ScopedAffinity own(cpu_,
                             tool_->own_thread ? ScopedAffinity::Change::Include : ScopedAffinity::Change::Exclude);
    ChildProcess child(command, printed.path());
    const std::int64_t begin_ns = monotonic_now_ns();
    while (true) {
        // Collect the result once it has ended; end it early on a signal or a timeout.
        if (const std::optional<int> status = child.exit_status()) {
            if (*status != 0) {
                throw std::runtime_error(std::string(tool_->name) + " failed with status " + std::to_string(*status) +
                                         ": " + first_line(content_of(printed.path())) + ": " + command_text(command));
            }
            tool_->parse(content_of(output.path()), result_);
            ran_ = true;
            return true;
        }
        if (signals.wait(StopSignals::kPollNs) != 0) {
            interrupt(child);
            return false;
        }
        if (monotonic_now_ns() - begin_ns > duration_s_ * kNanosecondsPerSecond + kMaxDelayNs) {
            interrupt(child);
            throw std::runtime_error(std::string(tool_->name) + " does not terminate: " + command_text(command));
        }
    }
}

}  // namespace haptic::rt
