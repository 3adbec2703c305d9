// Hand balance: lets the bodies receive what the hand receives.
//
// The device may render a frame with less stiffness than the scene asks for, fade or limit the wrench, and follows the
// hand at its own rate, so that its force differs from that of the simulation. It reports the stiffness and the part of
// the wrench that it renders, and the impulse that the hand has received from contact (DeviceFeedback). The bodies are
// pushed with that stiffness, and the difference between the two impulses is owed to them and paid in the next steps of
// length h,
//
//     owed <- owed + felt - given,   paid in the step: owed min(1/2, h / tau)
//
// with felt and given the impulses of the last step, and tau 0.1 s in contact, 0.02 s after it. What is felt answers
// forces of some ms ago, over a network of tens of ms: paid at once, the difference would make the bodies' springs
// answer as late, and a held fish swing until it is lost. The debt is a vector: when a contact turns from one side of a
// body to another, rt-core turns the force within some ms, and the bodies receive what the hand still feels from the
// old side. A simulation that falls behind real time counts what the hand feels in its own, slower time: the force is
// the same, and a late step pushes no harder. rt-core also ends a force within 50 ms of its contact. The particles that
// were pressed last receive that too; what would pull on them is forgotten.
#pragma once

#include <cstdint>
#include <limits>
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
        Vec3 hand_impulse{0.0};  // N*s, device frame: received by the hand in a step of the scene; 0 without a device
    };
    /// At the beginning of a step, time_ns on the device's clock. `stiffness` (N/m, scene) is that of the scene's
    /// coupling, `gain` the clutch's.
    Share begin_step(const std::optional<DeviceFeedback>& feedback, const Workspace& workspace, double stiffness,
                     double gain, double step_s, std::int64_t time_ns) noexcept;
    /// At its end: the mean force on the tool, the opposite of that on the bodies (N, scene), and whether anything
    /// touches.
    void end_step(const Vec3& force, bool in_contact, double step_s) noexcept;

  private:
    std::optional<Vec3> last_impulse_;  // N*s, device frame, of the last feedback
    std::int64_t last_time_ns_ = 0;     // beginning of the last step
    Vec3 owed_{0.0};                    // N*s, scene
    Vec3 given_{0.0};                   // N*s, scene, in the last step
    double limit_ = 0.0;                // N*s, largest debt
    double quiet_s_ = 0.0;              // s, in which neither hand nor bodies have felt anything
    double since_contact_s_ = std::numeric_limits<double>::infinity();  // s, since the last step with contact
};

}  // namespace haptic::sim
