// Snapshot capture: copies what the viewers are shown out of the simulation, between two steps.
#pragma once

#include "haptic/sim/simulation.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim::view {

/// Describes the scene, except for its parameters and the length of a recording, which the caller fills in.
[[nodiscard]] SceneDescription describe(const Simulation& simulation);

/// Sizes a snapshot, so that capture() does not allocate.
void make_room(const Simulation& simulation, SceneSnapshot& out);

/// Captures the state after a step: bodies as the next step finds them, the tool as this step left it, the planes as
/// they were sent. Leaves `out.run` unchanged. Does not allocate once the snapshot has been sized.
void capture(const Simulation& simulation, const StepResult& result, SceneSnapshot& out);

/// The plotted quantities of one step.
[[nodiscard]] StepSample sample_of(const StepResult& result) noexcept;

}  // namespace haptic::sim::view
