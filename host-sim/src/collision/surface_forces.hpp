// Forces of contacts between sheets, and between sheets and the ground.
//
// A contact keeps the nearest points of two features apart, n.(p1 - p2) >= min_separation, with a force between them
// and Coulomb friction. It moves a sheet as its elasticity lets it, by A^-1 (dynamics/elastic_bodies.hpp). Vertices
// moved by their masses alone would gain energy without end: to its own stress a sheet answers with the inertia h^2 A,
// in cotton tens of times the mass of a vertex, so that what a contact takes from a vertex comes back as strain.
//
// The forces are found in rounds. In each, a pass of projected Gauss-Seidel over a copy of the positions finds what
// would part the contacts if vertices moved alone; because h^2 A >= M that is never too much. Then the sheets move by
// these forces. The rounds are accelerated (Nesterov 1983): positions are linear in the forces, so both are
// extrapolated alike. Contacts begin with the forces that they had at the end of the last sub-step, which act with
// those that lead the sheets: at rest there is little left to find. Sheets without a material move vertex by vertex, in
// one pass each time that the solver asks for one, and begin without forces.
// @source Y. Nesterov, "A method for solving a convex programming problem with convergence rate O(1/k^2)", 1983; H.
// Mazhar, T. Heyn, D. Negrut, A. Tasora, "Using Nesterov's Method to Accelerate Multibody Dynamics with Friction and
// Contact", 2015; B. O'Donoghue, E. Candes, "Adaptive Restart for Accelerated Gradient Schemes", 2015. Differs: the
// step is a Gauss-Seidel pass by masses, and the acceleration restarts where the error grows.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/colliders.hpp"
#include "collision/surface_features.hpp"
#include "collision/vertex_masses.hpp"
#include "dynamics/elastic_bodies.hpp"

namespace haptic::sim {

/// Two features of sheets, or a vertex and the ground, that may come too near in a sub-step.
struct SurfaceContact {
    PairKind kind = PairKind::VertexTriangle;
    PairVertices vertex{};
    std::array<double, 4> weight{};  // of the nearest points at the start
    Vec3 normal{0.0};                // toward the first feature
    double min_separation = 0.0;     // m

    /// Of a vertex that has to be above this height, m.
    [[nodiscard]] static SurfaceContact with_ground(std::uint32_t vertex, double height) noexcept {
        return {.vertex = {vertex, vertex, vertex, vertex},
                .weight = {1.0, 0.0, 0.0, 0.0},
                .normal = Vec3(0.0, 1.0, 0.0),
                .min_separation = height};
    }
    [[nodiscard]] bool is_with_ground() const noexcept { return vertex[0] == vertex[3]; }
};

class SurfaceForces {
  public:
    /// `masses` must outlive this object. No contact is off by more than `exact`, m, after solve(), unless that takes
    /// too many rounds. There is room for so many contacts; more allocate.
    SurfaceForces(std::size_t particles, std::span<const ParticleSurface> sheets, const VertexMasses& masses,
                  FrictionCoefficients friction, double exact, std::size_t room);

    /// Forgets the forces of the last sub-step.
    void forget() noexcept;
    /// Begins a sub-step of length h, s, without contacts. `position`: where forces lead the particles, m; the forces
    /// remembered lead them further. `elastic` has been prepared for h and has not moved its bodies yet.
    void begin(ElasticBodies& elastic, double h, Row* position);
    /// Adds the contact if it is violated at these positions or has a remembered force.
    void add(const SurfaceContact& contact, const Row* position);
    /// Adds those with a remembered force that have not been added, as they were: their force may be too large.
    void add_others();
    /// Moves the sheets until the contacts agree; if none has a material, by one pass of several that the solver asks
    /// for. `start`: the positions at the start of the sub-step.
    void solve(const Row* start, Row* position) noexcept;
    /// Adds to `pushed` how each vertex would have moved alone by those forces in this sub-step for which
    /// counts(contact) holds, m: their momenta.
    template <class Counts>
    void add_pushes(Row* pushed, const Counts& counts) const noexcept {
        for (const Pushing& p : pushing_) {
            if (counts(p.of)) {
                push(p, p.push, p.friction, pushed);
            }
        }
    }
    [[nodiscard]] std::size_t size() const noexcept { return pushing_.size(); }

  private:
    /// A contact and its force, as the displacement that it would cause between the two points if vertices moved alone.
    struct Pushing {
        SurfaceContact of;
        double inverse_mass = 0.0;  // 1/kg, of the points relative to each other
        double push = 0.0;          // m, along the normal, at least 0 after a pass
        Vec3 friction{0.0};         // m, across it
        double last_push = 0.0;     // the same a round before
        Vec3 last_friction{0.0};
    };
    struct Remembered {
        SurfaceContact of;
        double along;  // N
        Vec3 across;   // N
        bool found;    // again, in this sub-step
    };

    void remember(double h, Row* position);
    [[nodiscard]] Remembered* remembered(const SurfaceContact& contact) noexcept;
    void add(const SurfaceContact& contact, Remembered& last);
    void push(const Pushing& contact, double along, const Vec3& across, Row* rows) const noexcept;
    void extrapolate(double part, Row* position) noexcept;
    [[nodiscard]] double pass(const Row* start, Row* position) noexcept;
    [[nodiscard]] double project(Pushing& contact, const Row* start, Row* position) const noexcept;
    [[nodiscard]] bool is_elastic(const ParticleRange& sheet) const noexcept;
    void move(const ParticleRange& sheet, Row* position) noexcept;

    std::vector<ParticleRange> sheets_;
    const VertexMasses& masses_;
    FrictionCoefficients friction_;
    double exact_;  // m
    std::vector<Pushing> pushing_;
    std::vector<Remembered> remembered_;  // by kind and vertices
    bool forward_ = true;
    // Of the sub-step.
    ElasticBodies* elastic_ = nullptr;
    bool some_are_elastic_ = false;
    double h_ = 0.0;           // s; until begin() that of the last one
    std::vector<Row> last_;    // m, per particle: where it was a round before
    std::vector<Row> alone_;   // m, per particle: where it would be if it moved alone
    std::vector<Row> answer_;  // N, then m, per particle
};

}  // namespace haptic::sim
