// Wrench follower: tracks the wrench that the contact frames ask for, no faster than the surfaces move.
//
// A simulation of 30 to 100 steps a second changes something with each contact frame: another contact, another normal,
// a plane that is not where its velocity would have taken it. The hand must not feel these steps. With E the wrench
// that the frame asks for at this tick, and F the rendered one, F moves towards E subject to
//
//     |dF| <= 1.5 max(min(|dE|, k U), k s mean |u_i|) + (1 N/s) T
//
// dE is the change of the springs' force since the last tick that the frame itself announces: the difference between
// its springs now and its springs at the pose and time of the last tick. u_i is the displacement in this tick of a
// proxy relative to its surface, the mean is over the proxies in contact, and U is the root mean square over all of
// them. s is the share of the stiffness k that the present contacts have; this term lets the wrench catch up while the
// hand slides along a surface, where dE is zero. The remaining half serves to catch up, plus 1 mN per millisecond at
// rest. The torque has the same bound, with the moment arm of the outermost proxy, times sqrt(k_t / k) if the tool
// rotates against a larger stiffness.
//
// Planes that move as announced are followed without lag, because |dE| <= k U. The forces l of the contact problem are
// a projection in the metric of its compliance W: depths that differ by db give |dl|_W^2 <= dl . db (firm
// nonexpansiveness). No tool is more rigid than a rigid one, W >= J S^-1 J^T, with J the rows' derivatives by the pose
// and S the stiffness of the grip's springs. So for a motion x of the hand relative to all surfaces, and the change dw
// of the wrench, dw^T S^-1 dw <= dl . db = dw . x, hence dw^T S^-1 dw <= x^T S x = k U^2 and |dE| <= k U. With friction
// this holds while proxies stick. Surfaces that move apart can announce more, for example at the edge of two planes:
// then k U limits.
//
// After contact has ended, the remaining wrench goes to zero within release_s, whatever the motion.
// @source The bound |dF| <= 1.5 k v T + 1 mN per sample at 1 kHz; joining controllers without a step is "bumpless
// transfer", Åström and Hägglund 1995.
#pragma once

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

/// The wrench that a contact frame asks for at a tick, and how much of its change is due to motion and to stiffness.
struct WantedWrench {
    Wrench wrench;
    Wrench announced{};                // dE, of force and torque
    double force_of_motion = 0.0;      // N, k s mean |u_i|
    double max_force_of_motion = 0.0;  // N, k U
    double force_of_stiffness = 0.0;   // N, change due to the coupling's own change since the last tick; allowed on top
    double torque_of_stiffness = 0.0;  // N*m, the same
    double max_moment_arm = 0.0;       // m, of the outermost proxy
    bool in_contact = false;           // some proxy is
};

class WrenchFollower {
  public:
    /// release_s: s, in which the wrench goes to zero after contact has ended.
    explicit WrenchFollower(double release_s) : release_s_(release_s) {}

    /// The wrench to render `elapsed_s` after the last one. Equal to the wanted one, bit for bit, where the bound
    /// allows.
    Wrench follow(const WantedWrench& wanted, double elapsed_s) HAPTIC_RT;
    /// Takes the next wanted wrench at once. The caller must avoid the step by other means.
    void restart() HAPTIC_RT { restarts_ = true; }

  private:
    double release_s_;
    Wrench output_;
    double release_rate_ = 0.0;  // N/s, out of contact; 0: in contact
    bool restarts_ = true;
};

}  // namespace haptic
