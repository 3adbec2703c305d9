// Particle collisions: ellipsoids of different bodies against each other, and all particles against the ground (thesis,
// Algorithm 3, EllipsoidCollisionDetections), but for what the surfaces of sheets do.
//
// Pairs are found once in a step of length h, along the paths from the positions x at its start to the predicted
// positions u. Either particle may also stop on its way, because an impact changes where both end. Each pair keeps a
// plane with normal n that separates the two where they first touch (src/collision/ellipsoids.hpp). With r = h1(n) +
// h2(n), the constraint
//
//     n.(u1 - u2) >= r + min(0, d + h push_out_speed, (1 - h / 20 ms) d),   d = n.(x1 - x2) - r
//
// keeps the pair on the side where it started, however fast it is. An initial overlap does not get deeper, and is
// resolved slowly, no faster than push_out_speed, so nothing pops. The plane is fitted again when the pair first
// violates it. Within a step a contact takes back what it pushed too much, down to zero. So bodies that rebound from
// their own deformation are held no harder than needed: restitution is 0, except for the energy stored in the
// deformation.
//
// An impact has to spread from the particles that it hits to the whole body within a few iterations. If bodies meet so
// fast that one would pass through the other first, the step is divided into sub-steps.
//
// Friction undoes the slip of the whole sub-step along the plane, if static_friction permits, otherwise as much as
// dynamic_friction does. A body with a material moves as a whole by forces that act where it touches
// (src/collision/body_contacts.hpp), with Coulomb's law; these keep linear and, of two free solids, angular momentum to
// rounding. Others follow M. Macklin et al., "Unified Particle Physics for Real-Time Applications", 2014, equation 24:
// limits are those of the displacement along the normal, displacements are in inverse proportion to the masses, which
// keeps linear momentum to rounding, and particles are pushed as points, so rolling counts as slipping. Pinned
// particles do not move. Particles of the same body do not collide as ellipsoids.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Settings of the collisions of one model.
struct CollisionSettings {
    bool between_bodies = true;
    bool surfaces = true;           // do not pass through themselves or, with between_bodies, one another
    double thickness = 0.0;         // m, kept between sheets; 0: a tenth of their mean edge
    bool ground = false;            // the half-space below ground_height is solid
    double ground_height = 0.0;     // m
    double static_friction = 0.0;   // coefficient, 0 .. 10
    double dynamic_friction = 0.0;  // coefficient, 0 .. static_friction
    double push_out_speed = 0.1;    // m/s, maximum speed at which an initial overlap is resolved
    int max_substeps = 8;           // 1 .. 100, sub-steps of a step in which bodies meet fast
};

/// Counts of the last sub-step.
struct CollisionCounts {
    std::size_t near = 0;     // pairs with overlapping boxes
    std::size_t planes = 0;   // pairs with a plane
    std::size_t active = 0;   // pairs that push each other, and particles that the ground pushes
    std::size_t dropped = 0;  // pairs beyond the capacity: these are not kept apart
};

/// Collisions of the bodies of one model. Allocates everything on construction.
class ParticleCollisions final : public SolverContacts {
  public:
    /// Monotonic clock in ns, for the caller's measurements; the simulation does not depend on it.
    using ClockFunction = std::int64_t (*)();

    /// The widest vectors that this machine has.
    static constexpr std::size_t kWidest = 0;

    /// `sheets`: bodies that SurfaceContacts keeps apart from one another and above the ground. Throws
    /// std::invalid_argument for a model that check() refuses, settings out of range, or a number of lanes that this
    /// machine lacks. Results do not depend on the number of lanes.
    ParticleCollisions(const ParticleModel& model, const CollisionSettings& settings, ClockFunction clock = nullptr,
                       std::size_t lanes = kWidest, std::span<const ParticleRange> sheets = {});
    ~ParticleCollisions() override;

    /// Numbers of lanes that this machine supports, in rising order.
    [[nodiscard]] static std::vector<std::size_t> usable_lanes();

    /// Number of sub-steps such that approaching bodies come nearer by at most three mean semi-axes in each.
    [[nodiscard]] int substeps(const ParticleModel& start, double step) const override;
    void begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) override;
    void search(const ParticleModel& start, const PredictedMotion& predicted, double h) override;
    void project(const ParticleModel& start, const MovingParticles& now, double h) override;
    /// Makes a bounded number of extra passes while contacts are still deep, then adds the total pushes.
    void finish(const ParticleModel& start, const MovingParticles& now, double h) override;

    [[nodiscard]] CollisionCounts counts() const noexcept;
    /// ns spent in this class since the last call; 0 without a clock.
    [[nodiscard]] std::int64_t take_time() noexcept;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::sim
