// Warning about bodies whose vibrations the sub-steps of a scene are too long for.
#pragma once

#include <string>

#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

/// Sub-steps change no stiffness; but motion that is faster than they are is damped, and the user may not expect it.
/// Says so, and what would resolve it; "" if the sub-steps are short enough.
[[nodiscard]] std::string unresolved_motion(const Simulation& simulation);

}  // namespace haptic::sim
