// A recorded run made again, step by step: the same scene, the same hand, the same changes at the same steps.
#pragma once

#include <cstdint>
#include <optional>

#include "app/recorded_run.hpp"
#include <haptic/sim/scene.hpp>
#include <haptic/sim/simulation.hpp>

namespace haptic::sim {

class Replay {
  public:
    /// `as_recorded`: the scene is the record's own, so each row is a step, and what was changed is changed again.
    /// Else the hand is followed over time, at the scene's own rate. `clock` times the stages. Throws
    /// std::invalid_argument, ConfigError.
    Replay(const Scene& scene, const RecordedRun& record, bool as_recorded, Simulation::ClockFunction clock = nullptr);

    /// Makes the next step; false: the record is at its end.
    bool step(StepResult& result);

    [[nodiscard]] const Simulation& simulation() const noexcept { return simulation_; }
    /// The row at which the proxy first was elsewhere than recorded; none so far, or nothing to compare with.
    [[nodiscard]] std::optional<std::uint64_t> diverged_at() const noexcept { return diverged_at_; }

  private:
    void make_changes();

    const RecordedRun& record_;
    const RecordNotes* notes_;  // null: the hand is followed over time
    Simulation simulation_;
    std::uint64_t row_ = 0;
    std::size_t changes_made_ = 0;
    std::optional<std::uint64_t> diverged_at_;
};

}  // namespace haptic::sim
