// Cyclictest: runs cyclictest (rt-tests) in the pauses of the loop, on the loop's processor with its policy, priority
// and period, for comparison.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "commands/run.hpp"
#include "measure/measure_report.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {

/// Adds the JSON output of `cyclictest --nsecs` to a result. Throws std::runtime_error if it cannot be parsed.
void add_cyclictest(const std::string& json, CyclictestResult& result);

class Cyclictest {
  public:
    /// Throws Refusal if cyclictest is not installed.
    Cyclictest();
    /// Builds the command: scheduled like the loop's thread, one cycle per period_ns, for duration_s.
    void prepare(const RealtimeSetup& setup, std::int64_t period_ns, double duration_s);
    /// Runs it once; returns false if a signal ended it early. Throws std::runtime_error if it fails.
    [[nodiscard]] bool run(const StopSignals& signals);
    [[nodiscard]] const CyclictestResult& result() const noexcept { return result_; }

  private:
    std::string program_;
    std::vector<std::string> command_;
    int cpu_ = -1;
    double duration_s_ = 1.0;  // whole seconds, as cyclictest requires
    CyclictestResult result_;
};

}  // namespace haptic::rt
