// Wrench follower: tracks the wrench that the contact frames ask for, no faster than the surfaces move.
//
// A simulation of 30 to 100 steps a second changes something with each contact frame: another contact, another normal,
// another damping, a plane that is not where its velocity would have taken it. The hand must not feel these steps. With
// e the wrench that the frame asks for at this tick, and F the rendered one, F moves towards e subject to
//
//     |dF| <= 1.5 sum k |u_i| / N + (1 N/s) T     u_i: displacement of particle i relative to its surface in this tick
//
// The same bound holds for the torque, times the moment arm of the outermost particle, with the stiffness that makes
// the torque. While planes move as announced, the bound never limits the spring force: the proxy is the projection x of
// the goal g onto a convex set, so x - g changes by no more than g does (firm nonexpansiveness), and a moving plane
// carries x by its own displacement. F therefore equals e, without lag, between two changes. The remaining half of the
// surface's speed serves to catch up, plus 1 mN per millisecond at rest. The damping force has to respect the same
// bound.
// After contact has ended, the remaining wrench goes to zero within release_s, whatever the motion.
// @source The bound |dF| <= 1.5 k v T + 1 mN per sample at 1 kHz; joining controllers without a step is "bumpless
// transfer", Åström and Hägglund 1995.
#pragma once

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

/// The wrench that a contact frame asks for at a tick, and how much of its change is due to motion and to stiffness.
struct WantedWrench {
    Wrench wrench;
    double force_of_motion = 0.0;      // N, sum k |u_i| / N over the particles in contact, or over all if none is
    double torque_of_motion = 0.0;     // N, the same with the stiffness that makes the torque
    double force_of_stiffness = 0.0;   // N, change due to the coupling's own change since the last tick; allowed on top
    double torque_of_stiffness = 0.0;  // N, the same with the stiffness that makes the torque
    double max_moment_arm = 0.0;       // m, of the outermost particle; multiplies the bounds of the torque
    bool in_contact = false;           // some particle is
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

}  // namespace haptic::rt
