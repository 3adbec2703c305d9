// Position-based dynamics of oriented particles: time stepping and constraint projection of one body or many.
//
// One step of length h, with f the force on each particle (thesis, Algorithm 3, lines 9 to 24):
//
//     v <- v + h (f / m + gravity);   u <- x + h v;   rotate orientations by h w
//     repeat `iterations` times: project every link, every group, then contacts, directly on u (Gauss-Seidel)
//     v <- (u - x) / h;   w <- rotation / h;   x <- u
//
// Link: with rest length d, its ends move along their line in inverse proportion to their masses, by stiffness times
// the error (M. Müller et al., "Position Based Dynamics", 2007, equations 10 and 11).
//
// Link with a compliance: a spring (M. Macklin, M. Müller, N. Chentanez, "XPBD: Position-Based Simulation of Compliant
// Constrained Dynamics", 2016, equations 17 and 18). With C the stretch and s = compliance / h^2, a projection adds
// (C - s lambda) / (w_a + w_b + s) to the multiplier lambda of this sub-step, which is h^2 times the tension. After
// convergence C is compliance times tension, whatever the number of iterations and the length of the step. Shorter
// sub-steps converge sooner and help more than iterations (Macklin et al., "Small Steps in Physics Simulation", 2019).
// Stiffness is then the fraction of that increment which a projection adds; leave it at 1.
//
// Group: with masses m, rest offsets q from the rest centroid and present offsets p from the centroid c, its moment
// matrix is A = sum m p q^T + sum m r^2 / 5 R, where R are the particles' orientations as matrices (Müller & Chentanez
// 2011, equations 10 to 12; thesis, section 4.1.2). T, the rotational part of A, gives each member the goal c + T q;
// the member moves the fraction `stiffness` of the distance to it, and the centre particle takes T as its orientation.
// Because the fit counts orientations, the goals may rotate the group as a whole, which no inner force can do. That
// rotation, theta = I^-1 sum m p x d, is subtracted, so that every projection keeps linear and angular momentum up to
// the rounding of float.
//
// Group with a compliance, s^2: its energy is 1/2 sum m |d|^2 / compliance, with d the vector from a member to its
// goal. A displaced member is pulled back at the rate compliance^-1/2, rad/s, whatever its mass. The best fit minimises
// this energy, so its gradient may treat the goals as constant, and XPBD displaces each member by (d - s e) / (1 + s),
// with e its displacement by this group so far in the sub-step and s = compliance / h^2. Since e is that of earlier
// iterations, a group may gain angular momentum here, of the order of the motion within a sub-step; the correction
// below removes it.
//
// Both loops follow a graph colouring: constraints of one colour share no particle and are projected side by side, in
// the lanes of vector registers, without changing any bit of the result. State is double, projections are float
// (src/simd/projection.hpp): shapes are accurate to 2^-24 of the size of a group.
//
// Momentum: projecting at u while momentum is defined at x is the implicit Euler method, which dissipates angular
// momentum at the rate of the motion within a step. For a body without pinned particles the step adds the loss back, as
// a rigid rotation of the velocities, and the linear momentum lost to rounding as a translation. A body's momenta then
// change only by forces and contacts. A solid with a material gets back what its elastic step has lost before contacts
// act. They change its momenta by exactly their forces (src/dynamics/inertia_relief.hpp), so nothing is to be returned
// afterwards: it would move what friction holds, and a fish would creep along the ground. `shape_damping` draws the
// velocities toward the rigid motion with the body's momenta and so conserves both (Müller et al. 2007, section 3.5).
//
// Bodies with a material have neither links nor groups; src/dynamics/elastic_bodies.hpp has their step, one in each
// sub-step, before the projections. Where all bodies have one, `iterations` is 1: contacts find the forces that agree
// with the materials themselves.
//
// Bodies that sleep (ParticleModel::asleep) stay where they are, and nothing is computed for them. The caller wakes
// them before a step in which something may touch them.
//
// Pinned particles follow their own velocities, whatever pulls at them: x + h v, rotated by h w. Both velocities keep
// the values that were set, 0 for a fixed particle.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Most equal parts of a step that a scene may ask for.
inline constexpr int kMaxSubsteps = 100;

/// The equation of a body with a material cannot be solved with the digits of a double: for the length of a sub-step
/// the body is too stiff for its mass.
class TooStiff : public std::invalid_argument {
  public:
    /// `particle`: one of the body.
    TooStiff(std::uint32_t particle, double substep_s);
    [[nodiscard]] std::uint32_t particle() const noexcept { return particle_; }

  private:
    std::uint32_t particle_;
};

struct SolverSettings {
    double step = 0.01;           // s
    int substeps = 1;             // equal parts of a step; 0: as many as the materials need; contacts may ask for more
    int iterations = 5;           // passes over the constraints in each sub-step
    int rotation_iterations = 2;  // of extracting T, starting from the predicted orientation
    Vec3 gravity{0.0, -9.81, 0.0};      // m/s^2
    double drag = 0.0;                  // 1/s, decay rate of velocities; 0 keeps momentum
    double shape_damping = 0.0;         // 1/s, decay rate of motion other than rigid motion
    bool keep_angular_momentum = true;  // see above; no effect on a body with pinned particles
    double sleep_after = 0.5;           // s in place after which bodies of a Simulation sleep; 0: never, else >= 0.2
    int threads = 1;                    // that share the work, 1 .. 256; 0: one per usable processor, up to 8
};

struct MovingParticles;  // src/simd/projection.hpp
struct PredictedMotion;  // the same
class ElasticBodies;     // src/dynamics/elastic_bodies.hpp
class Workers;           // src/dynamics/workers.hpp

/// Contacts of particles, as the solver calls them within a sub-step of length h, s. `start` is the state at its
/// beginning.
class SolverContacts {
  public:
    SolverContacts() = default;
    SolverContacts(const SolverContacts&) = delete;
    SolverContacts& operator=(const SolverContacts&) = delete;
    virtual ~SolverContacts() = default;
    /// Smallest number of sub-steps for a step, s.
    [[nodiscard]] virtual int substeps(const ParticleModel& /*start*/, double /*step*/) const { return 1; }
    /// Called once, first. `elastic` answers for the bodies with a material until finish() has returned. `now` has the
    /// positions to which forces lead; may add the displacements by forces that are known in advance, h^2 f / m.
    virtual void begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) = 0;
    /// Called once, after begin() of all contacts and before the constraints: finds what may touch where forces lead
    /// the particles, without what begin() has added. Needs nothing of `elastic`: bodies with a material move
    /// meanwhile, on other threads.
    virtual void search(const ParticleModel& /*start*/, const PredictedMotion& /*predicted*/, double /*h*/) {}
    /// Called after the constraints in each iteration: resolves penetrations by moving the positions in `now`. Where
    /// all bodies are solids with a material, the last contacts are left to finish(): nothing follows with which they
    /// would have to agree.
    virtual void project(const ParticleModel& start, const MovingParticles& now, double h) = 0;
    /// Called once, after the last iteration. May move positions; adds to `now.pushed` each particle's displacement by
    /// these contacts in this sub-step, with that in begin(), as if it had moved alone.
    virtual void finish(const ParticleModel& start, const MovingParticles& now, double h) = 0;
    /// Whether secure() may move anything.
    [[nodiscard]] virtual bool secures() const noexcept { return false; }
    /// Called once if any of the contacts secures(), when `now` has the positions that the sub-step would lead to and
    /// nobody else moves them any more. May move them, and returns the particles for which it did, valid until the next
    /// call; adds to `now.pushed`, which is 0, their displacements by what does not belong to their bodies. What else
    /// free bodies lose of their momenta returns to them as velocity. Only one of several contacts may move anything.
    [[nodiscard]] virtual std::span<const std::uint32_t> secure(const ParticleModel& /*start*/,
                                                                const MovingParticles& /*now*/, double /*h*/) {
        return {};
    }
};

/// Forces that change within a step, as those that follow the particles.
class SolverForces {
  public:
    SolverForces() = default;
    SolverForces(const SolverForces&) = delete;
    SolverForces& operator=(const SolverForces&) = delete;
    virtual ~SolverForces() = default;
    /// Called once for each body in each sub-step, of length h, s, that begins `elapsed` after the step, s; for several
    /// bodies at once, on any thread. `start` has the state of this body at the beginning of the sub-step. Returns N,
    /// per particle of the body, or nothing for no force; valid until the next call for the body.
    [[nodiscard]] virtual std::span<const Vec3> at(const ParticleModel& start, const ParticleRange& body,
                                                   double elapsed, double h) noexcept = 0;
};

class ParticleSolver {
  public:
    /// The widest vectors that the machine has.
    static constexpr std::size_t kWidest = 0;
    /// Of a body's index in the model. Must not throw.
    using BodyFunction = std::function<void(std::size_t body)>;

    /// Colours and orders the model's constraints. `lanes` is the number projected side by side: one of usable_lanes(),
    /// or kWidest. It does not affect the result. Throws std::invalid_argument for a model that check() refuses, for
    /// settings out of range, or for lanes that the machine does not have.
    ParticleSolver(const ParticleModel& model, const SolverSettings& settings, std::size_t lanes = kWidest);
    ParticleSolver(ParticleSolver&&) noexcept;
    ParticleSolver& operator=(ParticleSolver&&) noexcept;
    ~ParticleSolver();

    /// Increasing; 1 and 4 everywhere, on x86-64 also 8 (AVX2) and 16 (AVX-512F).
    [[nodiscard]] static std::vector<std::size_t> usable_lanes();

    /// Advances the model by settings().step. Rest shape and constraints must be those given to the constructor.
    /// `force` is in N, per particle, constant over the step; an empty span means no force. `contacts` are projected in
    /// their order, so that the last ones hold best; null elements are skipped.
    void step(ParticleModel& model, std::span<const Vec3> force, std::initializer_list<SolverContacts*> contacts = {});
    /// The same with forces that change from one sub-step to the next. Calls `at_end` once for each body as soon as it
    /// is where the step leads it, on any thread, while others may still move.
    void step(ParticleModel& model, SolverForces& forces, std::initializer_list<SolverContacts*> contacts = {},
              const BodyFunction& at_end = {});

    /// Changes step, s, sub-steps and iterations from the next step on. Throws std::invalid_argument as the constructor
    /// does, and then changes nothing.
    void set_steps(double step, int substeps, int iterations);

    /// Equal parts into which a step is divided, unless contacts ask for more.
    [[nodiscard]] int substeps() const noexcept;
    /// Whether any body lacks a material, or has constraints, so that `iterations` counts.
    [[nodiscard]] bool iterates() const noexcept;

    [[nodiscard]] const SolverSettings& settings() const noexcept { return settings_; }
    /// The threads of the solver, for other work while no step runs.
    [[nodiscard]] Workers& workers() noexcept { return *workers_; }
    [[nodiscard]] std::size_t lanes() const noexcept;
    [[nodiscard]] std::size_t group_colours() const noexcept;
    [[nodiscard]] std::size_t link_colours() const noexcept;

  private:
    struct ProjectionState;

    struct Body {
        ParticleRange particles;
        bool is_free = true;  // no particle is pinned
    };

    void predict(const ParticleModel& model, const ParticleRange& body, std::span<const Vec3> force, double h);
    void stay(const ParticleModel& model, const ParticleRange& body);
    void restore_momenta(const ParticleModel& model, const ParticleRange& body, double h, Vec3* velocity) noexcept;
    void find_velocities_of(ParticleModel& model, const Body& body, double h);
    void take_secured(ParticleModel& model, std::span<const std::uint32_t> moved, double h);
    void take_positions_of(ParticleModel& model, const Body& body, double h);
    void damp_shape(ParticleModel& model, const ParticleRange& body, double h) const;
    void restore_secured(ParticleModel& model, const ParticleRange& body);

    SolverSettings settings_;
    double faithful_step_;  // s, see faithful_step()
    std::vector<Body> bodies_;
    std::unique_ptr<Workers> workers_;
    std::unique_ptr<ProjectionState> state_;

    // Scratch, per particle.
    std::vector<Vec3> predicted_;  // m/s, velocity after forces and contacts, before constraints
};

}  // namespace haptic::sim
