// Hand balance: lets the bodies receive what the hand receives.
//
// The device may render a frame with less stiffness than the scene asks for, fade or limit the wrench, and follows the
// hand at its own rate, so that its force differs from that of the simulation. It reports the stiffness and the part of
// the wrench that it renders, and the impulse that the hand has received (DeviceFeedback). The bodies are pushed with
// that stiffness, and the difference between the two impulses is owed to them: half of it is paid in each step,
//
//     owed <- owed + felt - given,   paid in the step: owed / 2
//
// with felt and given the impulses of the last step. Only their difference along the force counts: across it the hand
// feels what the strings cannot avoid. The debt of a step is settled within a few; while nothing touches, it decays.
#pragma once

#include <optional>

#include "haptic/sim/simulation.hpp"
#include "haptic/sim/workspace.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class HandBalance {
  public:
    /// What the bodies receive in a step.
    struct Share {
        double gain = 1.0;       // 0..1, part of the coupling's stiffness
        Vec3 owed_force{0.0};    // N, scene, on the tool: force of what is paid in this step
        Vec3 hand_impulse{0.0};  // N*s, device frame: received by the hand since the last step; 0 without a device
    };
    /// At the beginning of a step. `stiffness` (N/m, scene) is that of the scene's coupling, `gain` the clutch's.
    Share begin_step(const std::optional<DeviceFeedback>& feedback, const Workspace& workspace, double stiffness,
                     double gain, double step_s) noexcept;
    /// At its end: the mean force on the tool, the opposite of that on the bodies (N, scene).
    void end_step(const Vec3& force, double step_s) noexcept;

  private:
    std::optional<Vec3> last_impulse_;  // N*s, device frame, of the last feedback
    Vec3 owed_{0.0};                    // N*s, scene
    Vec3 given_{0.0};                   // N*s, scene, in the last step
    double limit_ = 0.0;                // N*s, largest debt
};

}  // namespace haptic::sim
