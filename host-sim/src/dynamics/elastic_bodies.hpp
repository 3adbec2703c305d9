// Elastic bodies: one implicit step of all bodies with a material, and their answer to forces within it.
//
// A sub-step of length h begins at x0 = x + h v, where a body would be without forces. There its energy E has the
// gradient of elasticity.hpp, with the rotations that belong to x0, and one quasi-Newton step
//
//     x0 + A^-1 (f - grad E(x0)),   A = M / h^2 + sum kappa V b b^T + pairs
//
// goes to the minimum of the incremental potential (x - x0)^T M (x - x0) / (2 h^2) + E(x) - f x. Damping adds tau times
// the rate of the strain, and the factor 1 + tau / h in A. kappa bounds the stress per strain in every direction, so A
// does not depend on the rotations: it is the same matrix for x, y and z, and is factorised once.
//
// At rest x = x0, hence grad E = f: stiffness is exactly that of the material, whatever the step, in one pass. In
// motion kappa makes slow what is softer than kappa and faster than a few sub-steps, waves shorter than the way of
// sound in h. A correction never exceeds the distance to the minimum along an eigenvector of the true stiffness, so the
// step is stable for every h.
//
// A force p at some particles within the sub-step, as a contact's, moves the body by A^-1 p, and its linear momentum by
// h p. A contact problem with this answer is exact at rest too. A resists rotations of the whole body as if they were
// strains; ParticleSolver restores the angular momentum.
// @source T. Liu, S. Bouaziz, L. Kavan, "Quasi-Newton Methods for Real-Time Simulation of Hyperelastic Materials",
// 2017; S. Bouaziz, S. Martin, T. Liu, L. Kavan, M. Pauly, "Projective Dynamics: Fusing Constraint Projections for Fast
// Simulation", 2014. Differs: one step from x0, which keeps rotations free, and co-rotated elements of any size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dynamics/stiffness_factor.hpp"
#include "haptic/sim/particles.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

class ElasticBodies {
  public:
    /// Takes the elements and pairs of the model, and which particles are pinned. Precondition: model.check().
    explicit ElasticBodies(const ParticleModel& model);

    [[nodiscard]] bool empty() const noexcept { return bodies_.empty(); }
    /// The elastic body of a particle; empty if it has none.
    [[nodiscard]] ParticleRange body_of(std::uint32_t particle) const noexcept;

    /// Factorises for sub-steps of length h, s, unless it has.
    void prepare(double h);

    /// Moves the elastic particles from the positions that all forces lead to, x0 + h^2 f / m, in `position`, to the
    /// end of the sub-step. `start`: the state at its beginning; `orientation`: as predicted (w, x, y, z), replaced by
    /// the elements' rotations.
    void step(const ParticleModel& start, double drag_factor, Row* position, Row* orientation) noexcept;

    /// Replaces four forces on each particle of an elastic body, 1, by the displacements that they cause in the
    /// sub-step, m/N. `columns`: one row per particle of the body.
    void respond(const ParticleRange& body, std::span<Row> columns) noexcept;

  private:
    struct Element {
        std::uint32_t centre;  // particle
        std::uint32_t first;   // of its members
        std::uint32_t count;
        double volume, shear, lame, damping;
        Mat3 spread;
    };
    struct Member {
        std::uint32_t particle;
        Vec3 gradient;  // of a triangle: in its own axes
    };
    struct Neighbour {
        std::uint32_t particle;
        double stiffness;  // N/m
        double viscosity;  // N s/m
    };
    struct Body {
        ParticleRange particles;
        std::vector<std::uint32_t> free{};  // particles that are not pinned
        std::unique_ptr<StiffnessFactor> factor{};
    };

    void factorise(Body& body, double h) const;
    void add_solid_forces(const Element& element, Row* orientation) noexcept;
    void add_triangle_forces(const Element& element) noexcept;
    void add_pair_forces(const Body& body) noexcept;

    std::vector<Element> elements_;
    std::vector<Member> members_;
    std::vector<std::size_t> first_neighbour_;  // per particle; one more at the end
    std::vector<Neighbour> neighbours_;
    std::vector<Body> bodies_;
    std::vector<std::uint32_t> body_of_particle_;  // kNone: not elastic
    std::vector<double> mass_;
    double h_ = 0.0;  // s
    // Scratch, per particle.
    std::vector<Vec3> at_;        // m, x0
    std::vector<Vec3> velocity_;  // m/s, (x0 - x) / h
    std::vector<Vec3> force_;     // N
    LaneArray<Row> sides_;
};

}  // namespace haptic::sim
