// Elastic bodies: one implicit step of all bodies with a material, and their answer to forces within it.
//
// A sub-step of length h begins at x0 = x + h v, where a body would be without forces. There its energy E has the
// gradient of elasticity.hpp, with the rotations that belong to x0, and one quasi-Newton step
//
//     x0 + A^-1 (f - grad E(x0)),   A = M / h^2 + sum kappa V b b^T + pairs
//
// goes to the minimum of the incremental potential (x - x0)^T M (x - x0) / (2 h^2) + E(x) - f x. kappa bounds the
// stress per strain in every direction, so A does not depend on the rotations: it is the same matrix for x, y and z,
// and is factorised once.
//
// Such a step damps a vibration as a material would whose damping is h. That much of the material's damping tau is left
// to the step; what is more, tau - h, adds as much times the rate of the strain, and the factor 1 + (tau - h) / h in A.
//
// The energy of the pairs is quadratic and A contains all of it, so the pairs cancel when the same step is solved for
// the positions instead of the correction:
//
//     A x = M x0 / h^2 + f + sum (kappa V F b - grad E_element(x0)).
//
// This is how solids move that have no pinned particle and no more damping than the step's own: both would bring a part
// of the pairs back. Their positions are relative to one of their particles, so that rounding is that of the body's
// size. Sheets keep the correction: they bend 1e6 times more easily than they stretch, which would magnify the rounding
// of whole positions.
//
// At rest x = x0, hence grad E = f: stiffness is exactly that of the material, whatever the step, in one pass. In
// motion kappa makes slow what is softer than kappa and faster than a few sub-steps, waves shorter than the way of
// sound in h. A correction never exceeds the distance to the minimum along an eigenvector of the true stiffness, so the
// step is stable for every h.
//
// A force p at some particles within the sub-step, as a contact's, moves the body by A^-1 p, and its linear momentum by
// h p. A contact problem with this answer is exact at rest too. A resists rotations of the whole body as if they were
// strains; ParticleSolver restores the angular momentum of a sheet, and inertia_relief.hpp lets forces turn a solid.
// @source T. Liu, S. Bouaziz, L. Kavan, "Quasi-Newton Methods for Real-Time Simulation of Hyperelastic Materials",
// 2017; S. Bouaziz, S. Martin, T. Liu, L. Kavan, M. Pauly, "Projective Dynamics: Fusing Constraint Projections for Fast
// Simulation", 2014. Differs: one step from x0, which keeps rotations free, and co-rotated elements of any size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dynamics/inertia_relief.hpp"
#include "dynamics/stiffness_factor.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/particles.hpp"
#include "simd/elastic.hpp"

namespace haptic::sim {

class ElasticBodies {
  public:
    /// Takes the elements and pairs of the model, and which particles are pinned. `lanes` is the number of elements
    /// side by side; it changes no bit. `workers` share the work and outlive this object; null: the caller's thread
    /// does it. Precondition: model.check(). Throws std::invalid_argument for lanes that the machine does not have.
    ElasticBodies(const ParticleModel& model, std::size_t lanes, Workers* workers = nullptr);

    [[nodiscard]] bool empty() const noexcept { return bodies_.empty(); }
    /// Whether all bodies of the model are elastic.
    [[nodiscard]] bool have_all() const noexcept { return have_all_; }
    /// Whether all bodies of the model are elastic solids.
    [[nodiscard]] bool all_are_solid() const noexcept { return all_are_solid_; }
    /// The elastic body of a particle; empty if it has none.
    [[nodiscard]] ParticleRange body_of(std::uint32_t particle) const noexcept;
    /// Whether the particle belongs to a solid without pinned particles.
    [[nodiscard]] bool is_of_free_solid(std::uint32_t particle) const noexcept;

    /// Takes the factors for sub-steps of length h, s, from those of the last few lengths, or factorises. No
    /// allocation.
    void prepare(double h);

    struct Motion {
        const ParticleModel& start;  // the state at the beginning of the sub-step
        double drag_factor;
        Row* position;     // m: in x0 + h^2 f / m, where all forces lead to, out at the end of the sub-step
        Row* orientation;  // w, x, y, z: in as predicted, out the elements' rotations
    };
    /// Moves the elastic particles that are awake. Calls moved(particles) after moving each solid without pinned ones,
    /// on the thread that moved it, and `beside` once meanwhile, on any thread: they must not call the workers.
    template <class Moved, class Beside>
    void step(const Motion& motion, const Moved& moved, const Beside& beside) noexcept {
        const auto move_by_forces = [&](Body& body, Workers& workers) {
            if (motion.start.asleep[body.particles.begin] != 0) {
                body.turning_is_asked = false;
                body.asker = nullptr;
                return;
            }
            find_forces(body, motion, workers);
            move_body(body, motion);
            if (body.loose) {
                moved(body.particles);
            }
        };
        if (bodies_.size() == 1) {  // all threads share it
            beside();
            move_by_forces(bodies_[0], workers_);
            return;
        }
        // `beside` last, where another thread begins: most bodies stay with the caller, whose contacts push them next.
        const auto move = [&](std::size_t b) { move_by_forces(bodies_[b], *alone_); };
        workers_.for_each(bodies_.size(), move, beside);
    }
    void step(const Motion& motion) noexcept {
        step(motion, [](const ParticleRange&) {}, [] {});
    }

    /// Replaces four forces on each particle of an elastic body, 1, by the displacements that they cause in the
    /// sub-step, m/N. `columns`: one row per particle of the body. Different bodies may be asked at the same time.
    void respond(const ParticleRange& body, std::span<Row> columns) noexcept;
    /// How a solid without pinned particles turns with forces in a sub-step.
    struct Turning {
        InertiaRelief relief;
        std::span<Row> answers;  // s^2 m, Q: one row per particle of the body
    };
    /// Who waits for that.
    class Asker {
      public:
        Asker() = default;
        Asker(const Asker&) = delete;
        Asker& operator=(const Asker&) = delete;
        virtual ~Asker() = default;
        /// Called in the step when the body has moved and its turning is known, for different bodies at the same time.
        virtual void answered(std::size_t which) noexcept = 0;
    };
    /// Begins a sub-step: how the body turned in the last one does not count any more.
    void forget_turning(const ParticleRange& body) noexcept;
    /// Has the next step() find how the body turns, which takes little time beside what it solves anyway.
    void find_turning_in_step(const ParticleRange& body) noexcept;
    /// The same, and tells the asker, who must live until then. `which`: of the asker's bodies.
    void find_turning_in_step(const ParticleRange& body, Asker& asker, std::size_t which) noexcept;
    /// How the body turns in the sub-step that begins at `start`: found now, if step() has not found it. Different
    /// bodies may be asked at the same time.
    [[nodiscard]] const Turning& turning(const ParticleRange& body, const ParticleModel& start) noexcept;

    [[nodiscard]] const ElasticKernels& kernels() const noexcept { return kernels_; }
    [[nodiscard]] Workers& workers() const noexcept { return workers_; }
    /// The particles that take an element's rotation.
    [[nodiscard]] std::span<const std::uint32_t> turning() const noexcept { return turning_; }

  private:
    /// Storage of ElasticBatches.
    struct Elements {
        std::size_t first = 0;  // its first place in pull_
        std::vector<ElasticBatch> batch;
        LaneArray<std::uint32_t> centre;
        LaneArray<double> shear;
        LaneArray<double> lame;
        LaneArray<double> bound;
        LaneArray<double> damping;
        LaneArray<double> spread;
        LaneArray<std::uint32_t> member;
        LaneArray<double> gradient;
    };
    struct Body {
        ParticleRange particles;
        ParticleRange free{};    // range of free_
        ParticleRange solids{};  // range of its batches
        ParticleRange triangles{};
        ParticleRange turning{};                    // range of turning_
        std::unique_ptr<StiffnessFactor> factor{};  // of A over the free particles
        bool loose = false;                         // a solid without pinned particles
        bool solvable = true;                       // with the last factors made
        // In this sub-step, of one that is loose.
        Turning turning_by_forces{};
        bool turning_is_known = false;
        bool turning_is_asked = false;  // of the next step
        Asker* asker = nullptr;         // null: nobody waits for it
        std::size_t which = 0;
    };

    void find_bodies(const ParticleModel& model);
    void batch_elements(const ParticleModel& model);
    [[nodiscard]] ParticleRange add_batches(const ParticleModel& model, std::size_t body,
                                            std::span<const std::uint32_t> elements, Elements& to);
    void list_pairs(const ParticleModel& model);
    void list_shares(const ParticleModel& model);
    void assemble(const ParticleModel& model);
    [[nodiscard]] ElasticBatches batches_of(const Elements& elements, const Body& body, std::size_t begin,
                                            std::size_t end) noexcept;
    void find_forces(const Body& body, const Motion& motion, Workers& workers) noexcept;
    void move_body(Body& body, const Motion& motion) noexcept;
    /// Whether a step solves for the body's positions, not for a correction of x0.
    [[nodiscard]] bool solves_positions(const Body& body) const noexcept { return body.loose && !damped_; }
    /// m, from which positions of the body are solved for.
    [[nodiscard]] static const Vec3& origin_of(const Body& body, const Motion& motion) noexcept {
        return motion.start.position[body.particles.begin];
    }
    void begin_step(const Body& body, const Motion& motion) noexcept;
    void sum_forces(const Body& body, std::size_t begin, std::size_t end) noexcept;
    [[nodiscard]] std::span<Row> take_forces(const Body& body, std::span<const Row> columns) noexcept;
    void give_displacements(const Body& body, std::span<Row> columns) const noexcept;

    const ElasticKernels& kernels_;
    const std::unique_ptr<Workers> alone_ = std::make_unique<Workers>(1);  // the caller's thread
    Workers& workers_;
    std::vector<Body> bodies_;
    std::vector<std::uint32_t> body_of_particle_;  // kNone: not elastic
    bool have_all_ = true;
    bool all_are_solid_ = true;
    std::vector<std::uint32_t> free_;  // particles that are not pinned, body by body
    std::vector<std::uint32_t> turning_;
    double h_ = 0.0;            // s
    double own_damping_ = 0.0;  // s, of the step
    bool damped_ = false;       // something has more
    // The least and the most in the model, s.
    double least_damping_ = 0.0;
    double most_damping_ = 0.0;
    // The last lengths of sub-steps, s, by slot of the factors, since contacts may change it from step to step.
    std::vector<double> steps_;
    std::size_t slot_ = 0;    // of the present one
    std::size_t oldest_ = 0;  // of these
    Elements solids_;
    Elements triangles_;
    std::vector<std::uint32_t> place_;  // of each element's first member in pull_; each next one follows by `lanes`
    // Storage of ForceSums.
    std::vector<std::uint32_t> first_share_;
    std::vector<std::uint32_t> share_;
    std::vector<std::uint32_t> first_pair_;
    std::vector<std::uint32_t> other_;
    std::vector<double> pair_stiffness_;
    std::vector<double> pair_damping_;
    LaneArray<Row> pull_;  // N, per slot and lane of all batches, solids first
    // Scratch, per particle, with padding.
    LaneArray<Row> at_;        // m, x0
    LaneArray<Row> velocity_;  // m/s, (x0 - x) / h
    LaneArray<Row> turn_;      // orientations
    LaneArray<Row> given_;     // N
    // Per element of free_.
    LaneArray<Row> sides_;
    LaneArray<Row> asked_sides_;
    LaneArray<Row> turning_answers_;  // per particle: m r, kg m, then Q, s^2 m
};

}  // namespace haptic::sim
