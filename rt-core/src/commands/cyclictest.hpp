// cyclictest (rt-tests) in the pauses of the loop: on its processor, with its policy, priority and period.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "measure/measure_report.hpp"
#include "process/realtime_setup.hpp"
#include "commands/run.hpp"

namespace haptic::rt {

/// Adds what cyclictest wrote with --json and --nsecs to a result. Throws std::runtime_error if it cannot be read.
void add_cyclictest(const std::string& json, CyclictestResult& result);

class Cyclictest {
  public:
    /// Throws Refusal if there is no cyclictest.
    Cyclictest();
    /// As the loop's thread is scheduled, every period_ns for so long.
    void prepare(const RealtimeSetup& setup, std::int64_t period_ns, double duration_s);
    /// Runs it once; false if a signal came meanwhile, which ends it. Throws std::runtime_error if it fails.
    [[nodiscard]] bool run(const StopSignals& signals);
    [[nodiscard]] const CyclictestResult& result() const noexcept { return result_; }

  private:
    std::string program_;
    std::vector<std::string> command_;
    int cpu_ = -1;
    double duration_s_ = 1.0;  // whole: cyclictest knows no other
    CyclictestResult result_;
};

}  // namespace haptic::rt
