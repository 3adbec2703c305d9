// Position-based dynamics of a model of oriented particles, of one body or many.
//
// One step of length h, with f the force on each particle (thesis, Algorithm 3, lines 9 to 24):
//
//     v <- v + h (f / m + gravity);   u <- x + h v;   orientations turn by h w
//     repeat `iterations` times: project every link, then every group, each at once onto u (Gauss-Seidel)
//     v <- (u - x) / h;   w <- turn / h;   x <- u
//
// A link of rest length d moves its ends along their line, in inverse proportion to their masses, by stiffness times
// its error (M. Müller et al., "Position Based Dynamics", 2007, equations 10 and 11).
//
// A link with a compliance is a spring instead (M. Macklin, M. Müller, N. Chentanez, "XPBD: Position-Based Simulation
// of Compliant Constrained Dynamics", 2016, equations 17 and 18): with C its stretch and s = compliance / h^2 a
// projection adds (C - s p) / (w_a + w_b + s) to the pull p that it has exerted in this sub-step, h^2 times the
// tension. Once the iterations have converged, C is compliance times tension, however many they are and however long
// the step. They do so the sooner the shorter a sub-step is, which serves better than more iterations (Macklin et al.,
// "Small Steps in Physics Simulation", 2019). Stiffness is then the part of that which a projection adds, and best left
// at 1.
//
// A group with masses m, rest offsets q from its rest centroid and present offsets p from its centroid c has the moment
// matrix A = sum m p q^T + sum m r^2 / 5 R, with R the particles' orientations as matrices (Müller & Chentanez 2011,
// equations 10 to 12). Its rotational part T gives each member the goal c + T q, of which it goes `stiffness` of the
// way; the centre particle takes T as its orientation. A fit that also counts orientations may turn the group as a
// whole, which no inner force can do; that turn, theta = I^-1 sum m p x d, is taken out again, so that every
// projection keeps linear and angular momentum to rounding, which is that of float.
//
// A group with a compliance, s^2, has the energy 1/2 sum m |d|^2 / compliance, d being what a member lacks to its goal:
// a member that is displaced is drawn back at the rate compliance^-1/2, rad/s, whatever its mass. Since the best fit
// is where that energy is least, its gradient takes the goals as constant, and XPBD makes of each member's displacement
// (d - s e) / (1 + s), e being what this group has displaced it by in this sub-step and s = compliance / h^2. As e is
// that of earlier iterations, a group may gain angular momentum here, of the order of the motion within a sub-step;
// what follows below takes it back.
//
// Both loops run in the order of a graph colouring: constraints of one colour share no particle, so that they are done
// side by side, in the lanes of vector registers, without a change in any bit of the result. The state is double, a
// projection is float (src/projection.hpp says of what): shapes are kept to 2^-24 of the size of a group.
//
// Projection at u while the momentum is counted at x is the implicit Euler method, which turns angular momentum into
// nothing at the rate of the motion within a step. For a body of which nothing is pinned, the step puts it back as one
// rigid turn of the velocities, and what projections round off the linear momentum as one shift, so that what is left
// of a body's momenta is what forces and contacts gave it. Damping
// (`settling`) draws the velocities toward those of a rigid body with the body's momenta and so keeps both (Müller et
// al. 2007, section 3.5).
//
// Particles that are pinned go where their velocities lead them, whatever pulls at them: x + h v, turned by h w. Both
// velocities stay what they were set to, 0 for what does not move at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct SolverSettings {
    double step = 0.01;                 // s
    int substeps = 1;                   // equal parts into which a step is divided, if contacts do not ask for more
    int iterations = 5;                 // passes over the constraints in each sub-step
    int rotation_iterations = 2;        // steps of the extraction, from the predicted orientation
    Vec3 gravity{0.0, -9.81, 0.0};      // m/s^2
    double drag = 0.0;                  // 1/s, rate at which velocities decay; 0 keeps momentum
    double settling = 0.0;              // 1/s, rate at which motion other than that of a rigid body decays
    bool keep_angular_momentum = true;  // see above; has no effect on a body with pinned particles
};

struct MovingParticles;  // src/projection.hpp

/// Contacts of particles as the solver sees them, in the course of a sub-step of length h, s. `start` is the state at
/// its beginning.
class SolverContacts {
  public:
    SolverContacts() = default;
    SolverContacts(const SolverContacts&) = delete;
    SolverContacts& operator=(const SolverContacts&) = delete;
    virtual ~SolverContacts() = default;
    /// Into how many sub-steps a step, s, has to be divided at least.
    [[nodiscard]] virtual int substeps(const ParticleModel& /*start*/, double /*step*/) const { return 1; }
    /// Once, before the constraints: finds what may touch, from where forces lead.
    virtual void find(const ParticleModel& start, const MovingParticles& predicted, double h) = 0;
    /// After the constraints in each iteration: moves the places in `now` out of one another.
    virtual void project(const ParticleModel& start, const MovingParticles& now, double h) = 0;
    /// Once, after the last iteration. May move places still, and writes all of `now.pushed`: by how much each particle
    /// has been moved since find().
    virtual void finish(const ParticleModel& start, const MovingParticles& now, double h) = 0;
};

class ParticleSolver {
  public:
    /// As many constraints side by side as the machine has lanes for.
    static constexpr std::size_t kWidest = 0;

    /// Orders the model's constraints. `lanes` is how many of them are projected side by side: one of usable_lanes() or
    /// kWidest. It makes no difference to the result. Throws std::invalid_argument for a model that check() refuses,
    /// settings out of their range, or lanes that the machine does not have.
    ParticleSolver(const ParticleModel& model, const SolverSettings& settings, std::size_t lanes = kWidest);
    ParticleSolver(ParticleSolver&&) noexcept;
    ParticleSolver& operator=(ParticleSolver&&) noexcept;
    ~ParticleSolver();

    /// Increasing; 1 and 4 everywhere, on x86-64 also 8 (AVX2) and 16 (AVX-512F).
    [[nodiscard]] static std::vector<std::size_t> usable_lanes();

    /// Advances the model, which has to be the one given to the constructor as far as its rest shape and constraints
    /// go. `force` is in N, per particle, constant over the step; an empty span is no force.
    void step(ParticleModel& model, std::span<const Vec3> force, SolverContacts* contacts = nullptr);

    /// Only the constraints: settings().iterations passes over positions and orientations as the model has them. No
    /// time passes, so nothing has a velocity, weight or momentum; settings().step only says how far compliances give
    /// way. Particles whose `held` is not 0 are put back where they were after each pass; an empty span holds none.
    void project(ParticleModel& model, std::span<const std::uint8_t> held = {});

    /// Takes over where the model's particles are at rest now: of its groups the shape, of its links the distance. All
    /// else of the constraints is as it was given to the constructor. No allocation.
    void set_rest_shape(const ParticleModel& model) noexcept;

    /// From the next step on. Throws std::invalid_argument, and changes nothing, for what the constructor refuses.
    void set_pace(double step, int iterations);

    [[nodiscard]] const SolverSettings& settings() const noexcept { return settings_; }
    [[nodiscard]] std::size_t lanes() const noexcept;
    [[nodiscard]] std::size_t group_colours() const noexcept;
    [[nodiscard]] std::size_t link_colours() const noexcept;

  private:
    struct Projecting;

    struct Whole {
        ParticleRange particles;
        bool is_free = true;  // nothing is pinned
    };

    void predict(ParticleModel& model, std::span<const Vec3> force, double h);
    void count_pushes(double h);
    void update(ParticleModel& model, double h);
    void settle(ParticleModel& model, const ParticleRange& body, double h) const;
    void restore_momenta(ParticleModel& model, const ParticleRange& body, double h);

    SolverSettings settings_;
    std::vector<Whole> bodies_;        // of the model
    std::unique_ptr<Projecting> now_;  // constraints, and the particles in the course of a step

    // Scratch, per particle.
    std::vector<Vec3> predicted_;  // velocity after forces and contacts, before constraints
};

}  // namespace haptic::sim
