// Replay: repeats a recorded run step by step, with the same scene, hand, and live changes.
#pragma once

#include <cstdint>
#include <optional>

#include "app/recorded_run.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

class Replay {
  public:
    /// `as_recorded`: the scene is the record's own; each row is a step and live changes are repeated. Otherwise the
    /// hand is followed over time at the scene's rate. `clock` times the stages. Throws std::invalid_argument,
    /// ConfigError.
    Replay(const Scene& scene, const RecordedRun& record, bool as_recorded, Simulation::ClockFunction clock = nullptr);

    /// Makes the next step. False at the end of the record.
    bool step(StepResult& result);

    [[nodiscard]] const Simulation& simulation() const noexcept { return simulation_; }
    /// First row whose proxy differs from the record; nullopt if none does, or the record has no proxy.
    [[nodiscard]] std::optional<std::uint64_t> diverged_at() const noexcept { return diverged_at_; }

  private:
    void make_changes();

    const RecordedRun& record_;
    const RecordNotes* notes_;  // null: follow the hand over time
    Simulation simulation_;
    std::uint64_t row_ = 0;
    std::size_t changes_made_ = 0;
    std::optional<std::uint64_t> diverged_at_;
};

}  // namespace haptic::sim
