// Collisions of particles of different bodies, as ellipsoids, and of all particles with the ground (thesis, Algorithm
// 3, EllipsoidCollisionDetections).
//
// Pairs are found once in a step of length h, along the ways from the places x at its start to the predicted ones u, as
// if each of the two might also stop on its way: a blow changes where both get to. Each pair keeps a plane of normal n
// that parts the two where they first touch (src/ellipsoids.hpp), so that with r = h1(n) + h2(n)
//
//     n.(u1 - u2) >= r + min(0, n.(x1 - x2) - r + h push_out_speed)
//
// holds the side on which the pair was at the start, however fast it is. What overlaps at the start does not get
// deeper, and is moved apart no faster than push_out_speed: nothing pops. The plane is laid anew when a pair first
// violates it. Within a step, a contact gives back what it pushed too much, down to nothing, so that it holds bodies
// that rebound from their own deformation no harder than needed: restitution is 0 but for what bodies store while they
// are deformed.
//
// A blow has to get from the particles that take it to the whole body within a few iterations. Where bodies meet so
// fast that one would be through the other before that, the step is divided into sub-steps.
//
// Friction is that of M. Macklin et al., "Unified Particle Physics for Real-Time Applications", 2014, equation 24, with
// the normal displacement d and the slip of the whole step instead of one iteration's: the slip of the two centres
// along the plane is undone if that takes at most static_friction d, else by dynamic_friction d. Particles are pushed
// as points: rolling off one another they slip.
//
// All displacements are in inverse proportion to masses, equal and opposite in momentum to rounding. Pinned particles
// do not yield. Particles of the same body do not collide.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct CollisionSettings {
    bool between_bodies = true;
    bool ground = false;            // the half-space below ground_height is solid
    double ground_height = 0.0;     // m
    double static_friction = 0.0;   // coefficients, 0 .. 10
    double dynamic_friction = 0.0;  // at most the static one
    double push_out_speed = 0.1;    // m/s, at which what overlaps is moved apart
    int most_substeps = 8;          // 1 .. 100, into which a step is divided where bodies meet fast
};

/// What happened in the last sub-step.
struct CollisionCounts {
    std::size_t near = 0;     // pairs whose boxes overlap
    std::size_t planes = 0;   // pairs that have a plane
    std::size_t pressed = 0;  // those that push one another, and particles that the ground pushes
    std::size_t dropped = 0;  // pairs for which there was no room: they are not kept apart
};

/// The collisions of the bodies of one model. All that is needed is allocated when it is made.
class ParticleCollisions final : public SolverContacts {
  public:
    /// Monotonic time in ns, for the caller's own measurements; nothing that is simulated depends on it.
    using ClockFunction = std::int64_t (*)();

    /// The most lanes that this machine has.
    static constexpr std::size_t kWidest = 0;

    /// Throws std::invalid_argument for a model that check() refuses, settings out of their range, or lanes that this
    /// machine does not have. Results do not depend on lanes.
    ParticleCollisions(const ParticleModel& model, const CollisionSettings& settings, ClockFunction clock = nullptr,
                       std::size_t lanes = kWidest);
    ~ParticleCollisions() override;

    /// Increasing.
    [[nodiscard]] static std::vector<std::size_t> usable_lanes();

    /// So many that bodies on the way to each other come nearer by three mean semi-axes a sub-step at most.
    [[nodiscard]] int substeps(const ParticleModel& start, double step) const override;
    void find(const ParticleModel& start, const MovingParticles& predicted, double h) override;
    void project(const ParticleModel& start, const MovingParticles& now, double h) override;
    /// Also passes over contacts that are still deep, a bounded number of times.
    void finish(const ParticleModel& start, const MovingParticles& now, double h) override;

    [[nodiscard]] CollisionCounts counts() const noexcept;
    /// ns spent here since the last call, by the clock; 0 without one.
    [[nodiscard]] std::int64_t take_time() noexcept;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::sim
