// Peer run: runs one peer tool (measure/peer_tool.hpp) in the pauses of the loop and collects what it finds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "commands/run.hpp"
#include "measure/peer_tool.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {

/// The tools of `--peers`: all of them, or those named.
struct PeerChoice {
    const PeerTool* tool;
    bool by_name;  // it must be there; one of "all" may be missing
};
/// Throws Refusal for a name that is no tool's.
[[nodiscard]] std::vector<PeerChoice> chosen_peers(const std::vector<std::string>& names);

class PeerRun {
  public:
    /// Looks for the program and the kernel's tracer. If one is missing, the result says so. Throws Refusal if it was
    /// asked for by name.
    explicit PeerRun(const PeerChoice& choice);

    /// False if something is missing, or a turn has failed.
    [[nodiscard]] bool available() const noexcept { return result_.missing.empty() && result_.failure.empty(); }
    /// Builds the command: scheduled like the loop's thread, for duration_s, rounded to seconds.
    void prepare(const RealtimeSetup& setup, std::int64_t period_ns, double duration_s);
    /// Runs a turn, if one is due; returns false if a signal ended it early. After one that fails there are no more:
    /// the result has what was found until then.
    [[nodiscard]] bool run(const StopSignals& signals);

    [[nodiscard]] const PeerTool& tool() const noexcept { return *tool_; }
    [[nodiscard]] const PeerResult& result() const noexcept { return result_; }

  private:
    /// Throws std::runtime_error if the tool fails.
    [[nodiscard]] bool run_turn(const StopSignals& signals);

    const PeerTool* tool_;
    std::vector<std::string> command_;
    int cpu_ = -1;
    int duration_s_ = 1;
    bool ran_ = false;
    PeerResult result_;
};

}  // namespace haptic::rt
