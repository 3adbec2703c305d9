// What a viewer is shown of a simulation: copied out of it between two steps.
#pragma once

#include "haptic/sim/simulation.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim::view {

/// Everything but the parameters and the length, which are the run's.
[[nodiscard]] SceneDescription describe(const Simulation& simulation);

/// Makes room in a snapshot, so that capture() does not allocate.
void make_room(const Simulation& simulation, SceneSnapshot& out);

/// The moment after a step with this input and result: bodies as the next step finds them, the tool as this one left
/// it, the planes as they were sent. Leaves `out.run` alone. Does not allocate where there is room.
void capture(const Simulation& simulation, const StepResult& result, SceneSnapshot& out);

[[nodiscard]] StepSample sample_of(const StepResult& result) noexcept;

}  // namespace haptic::sim::view
