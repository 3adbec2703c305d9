// What is felt follows what the frames say, no faster than the surfaces move.
//
// A simulation of 30 to 100 steps a second says something new with each frame: another contact, another normal, another
// damping, a plane that is not where its velocity would have brought it. The hand must not feel the seams. With e the
// wrench that a frame asks for at this tick, and F the one that is felt,
//
//     |dF| <= 1.5 sum k |u_i| / N + (1 N/s) T          u_i: way of particle i relative to its surface in this tick
//
// and F goes toward e as far as that allows; torque likewise, times the lever of the outermost particle, with the
// stiffness that makes the torque. Where the planes stay as they are announced, this never bites on the
// spring: the proxy is the projection x of the goal g onto a convex set, g -> x - g moves no farther than g does
// (firmly nonexpansive), and a plane that moves on takes x along by its own way. So F is e, without any lag, from one
// seam to the next; half of the surface's speed is left for catching up, and 1 mN a millisecond where all is at rest. A
// frame's damping has to keep to the same bound.
// Where nothing is touched any more, what is left goes to zero within `release_s`, whatever the motion.
// @source bound: |dF| <= 1.5 k v T + 1 mN for each sample of 1 kHz; for joining controllers without a step, "bumpless
// transfer", Åström and Hägglund 1995.
#pragma once

#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

/// What a frame asks for at a tick.
struct WantedWrench {
    Wrench wrench;
    double travel = 0.0;             // N, sum k |u_i| / N over the particles in contact, or over all where none is
    double torque_travel = 0.0;      // N, the same with the stiffness that makes the torque
    double stiffening = 0.0;         // N, that the coupling's own change since the last tick makes; on top of the bound
    double torque_stiffening = 0.0;  // N, likewise
    double lever = 0.0;              // m, of the outermost particle: times it the bounds of torque
    bool in_contact = false;         // some particle
};

class WrenchFollower {
  public:
    /// release_s: s, in which what is felt ends where nothing is touched any more.
    explicit WrenchFollower(double release_s) : release_s_(release_s) {}

    /// The wrench to be felt `elapsed_s` after the last one. Exactly the wanted one where the bound allows.
    Wrench follow(const WantedWrench& wanted, double elapsed_s) HAPTIC_RT;
    /// The next wanted wrench is taken at once: whoever calls this joins them in another way.
    void leap() HAPTIC_RT { leaps_ = true; }

  private:
    double release_s_;
    Wrench felt_;
    double release_ = 0.0;  // N/s, in free motion
    bool leaps_ = true;
};

}  // namespace haptic::rt
