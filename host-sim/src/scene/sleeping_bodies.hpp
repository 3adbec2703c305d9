// Which bodies sleep: nothing is computed for what has come to rest until something comes near.
//
// A body that is awake has a place, where its particles were at some time. Once one of them is elsewhere by more than a
// little, or its surface has come as much nearer to them, the body has moved, and its place is where it is then. One
// that has stayed in its place for a while is quiet, however it trembles there. Bodies whose boxes overlap, widened by
// what they may move in a step and by how far their particles reach, belong together, and so do all sheets that
// collide. They sleep when all of them are quiet and the tool is not among them. What sleeps does not move, and wakes
// in the step in which something that is not quiet comes near. Then it has to stay in its place for as long again, and
// what the tool was near for as long since it has left: what was pressed, however little, takes its shape first.
//
// A body sleeps only where something holds it: on the ground, on others, or where it is pinned. What would stay in its
// place for so long without, as it falls too slowly, is not at rest, and keeps its momentum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/body_sweep.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/types.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {

struct Assembly;

class SleepingBodies {
  public:
    /// `collides`: per body, whether it is a sheet that collides with its surface. Bodies need no contact to be held:
    /// one that nothing holds falls out of its place in `settings.sleep_after`, or never sleeps.
    SleepingBodies(const Assembly& assembly, const SolverSettings& settings, std::span<const std::uint8_t> collides);

    /// Before a step, with the velocities that it starts with: writes which particles of the model sleep, and stops
    /// those that fall asleep. `tool`, m: where it may touch bodies in the step. `lag`, m, per body: how far its
    /// surface is from where its particles want it.
    void update(Assembly& assembly, const Aabb& tool, std::span<const double> lag, const SolverSettings& settings);
    /// A body has been put somewhere: it is not quiet, wherever that is.
    void disturb(std::size_t body) noexcept { quiet_for_[body] = 0.0; }

    /// 1 for each body that sleeps.
    [[nodiscard]] std::span<const std::uint8_t> asleep() const noexcept { return asleep_; }

  private:
    /// A body that can move, or is moved.
    struct Body {
        std::uint32_t index = 0;
        bool may_sleep = false;
        double reach = 0.0;     // m, of its particles
        double in_place = 0.0;  // m: it has moved if a particle has by more than this
        double lag = 0.0;       // m, of its surface in its place
    };

    void find_quiet(const Assembly& assembly, std::span<const double> lag, const SolverSettings& settings);
    void unite_neighbours(const Assembly& assembly, const SolverSettings& settings);
    void unite(std::uint32_t one, std::uint32_t other) noexcept;
    void fall_asleep(Assembly& assembly, std::uint32_t body) const;

    std::vector<Body> bodies_;
    std::vector<std::uint32_t> sheets_;  // of bodies_
    std::vector<Vec3> place_;            // m, per particle
    BodySweep sweep_;
    std::vector<Bounds> bounds_;  // of bodies_
    std::vector<BodyPair> near_;
    std::vector<std::uint32_t> parent_;   // of bodies_: one of each group is its own
    std::vector<std::uint8_t> is_awake_;  // of that one: the group
    std::vector<std::uint8_t> asleep_;    // per body of the assembly
    std::vector<double> quiet_for_;       // s, the same
};

}  // namespace haptic::sim
