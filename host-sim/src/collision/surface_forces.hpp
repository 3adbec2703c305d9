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
// extrapolated alike. Contacts that pushed in the last sub-step begin with that force, which acts with those that lead
// the sheets: at rest there is little left to find. If no sheet has a material, vertices move alone, by one pass each
// time that the solver asks for one, and contacts begin without a force.
//
// Contacts of sheets with particles of other bodies are in body_contacts.hpp, with the same A^-1.
// @source Y. Nesterov, "A method for solving a convex programming problem with convergence rate O(1/k^2)", 1983; H.
// Mazhar, T. Heyn, D. Negrut, A. Tasora, "Using Nesterov's Method to Accelerate Multibody Dynamics with Friction and
// Contact", 2015; B. O'Donoghue, E. Candes, "Adaptive Restart for Accelerated Gradient Schemes", 2015. Differs: the
// step is a Gauss-Seidel pass by masses, and the acceleration restarts where the error grows.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
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

    static constexpr PairKind kGroundKind = PairKind::VertexTriangle;
    /// Of a vertex that has to be above this height, m.
    [[nodiscard]] static SurfaceContact with_ground(std::uint32_t vertex, double height) noexcept {
        return {.kind = kGroundKind,
                .vertex = {vertex, vertex, vertex, vertex},
                .weight = {1.0, 0.0, 0.0, 0.0},
                .normal = Vec3(0.0, 1.0, 0.0),
                .min_separation = height};
    }
    [[nodiscard]] bool is_with_ground() const noexcept { return vertex[0] == vertex[3]; }
};

class SurfaceForces {
  public:
    /// The sheets are bodies of the model. `masses` must outlive this object. Rounds end when no contact needed more
    /// than `exact`, m, or after a number of them. There is room for so many contacts; more allocate.
    SurfaceForces(const ParticleModel& model, std::span<const ParticleSurface> sheets, const VertexMasses& masses,
                  FrictionCoefficients friction, double exact, std::size_t room);

    /// Begins a sub-step of length h, s. `elastic` has been prepared for it and has not moved its bodies yet. Warm
    /// start if `goes_on`: each contact that pushed in the last sub-step keeps its force if renewed(contact) still
    /// returns one. Adds the displacements by these forces to `position`, m.
    template <class Renewed>
    void begin(ElasticBodies& elastic, double h, bool goes_on, Row* position, const Renewed& renewed) {
        begin(elastic, h, goes_on);
        for (const Force& last : last_force_) {
            if (last.along > 0.0) {
                if (const std::optional<SurfaceContact> contact = renewed(last.of)) {
                    push_on(*contact, last, position);
                }
            }
        }
        last_h_ = h;
    }
    /// Whether the contact of these features has pushed on.
    [[nodiscard]] bool pushes_on(PairKind kind, const PairVertices& vertex) const noexcept;
    /// Adds a contact that has not.
    void add(const SurfaceContact& contact);
    /// Moves the sheets until the contacts agree. `start`: the positions at the start of the sub-step.
    void solve(const Row* start, Row* position) noexcept;
    /// Adds to `pushed` how each vertex would have moved alone by those forces in this sub-step for which
    /// counts(contact) holds, m: their momenta.
    template <class Counts>
    void add_pushes(Row* pushed, const Counts& counts) const noexcept {
        for (const Force& f : force_) {
            if (f.along > 0.0 && counts(f.of)) {
                displace_alone(f, f.along, f.across, pushed);
            }
        }
    }
    [[nodiscard]] std::size_t size() const noexcept { return force_.size(); }

  private:
    static constexpr std::uint32_t kNone = 0xffff'ffff;

    /// A contact and its force, as the displacement between the two points that it would cause if vertices moved alone.
    struct Force {
        SurfaceContact of;
        double inverse_mass = 0.0;  // 1/kg, of the points relative to each other
        double along = 0.0;         // m, along the normal, at least 0 after a pass
        Vec3 across{0.0};           // m, friction
        double last_along = 0.0;    // the same a round before
        Vec3 last_across{0.0};
        std::uint32_t next = kNone;  // that has pushed on, with the same first vertex
    };
    struct Sheet {
        ParticleRange particles;
        bool is_elastic = false;
    };

    void begin(ElasticBodies& elastic, double h, bool goes_on) noexcept;
    void push_on(const SurfaceContact& contact, const Force& last, Row* position);
    void displace_alone(const Force& force, double along, const Vec3& across, Row* rows) const noexcept;
    void extrapolate(double part, Row* position) noexcept;
    [[nodiscard]] double pass(const Row* start, Row* position) noexcept;
    [[nodiscard]] double project(Force& force, const Row* start, Row* position) const noexcept;
    void move(const Sheet& sheet, Row* position) noexcept;

    std::vector<Sheet> sheets_;
    bool some_are_elastic_ = false;
    const VertexMasses& masses_;
    FrictionCoefficients friction_;
    double exact_;  // m
    std::vector<Force> force_;
    std::vector<Force> last_force_;     // of the last sub-step
    std::vector<std::uint32_t> first_;  // per particle: the first force that has pushed on with it as first vertex
    bool forward_ = true;
    // Of the sub-step.
    ElasticBodies* elastic_ = nullptr;
    double h_ = 0.0;           // s
    double last_h_ = 0.0;      // s, of last_force_
    std::vector<Row> last_;    // m, per particle: where it was a round before
    std::vector<Row> alone_;   // m, per particle: where it would be if it moved alone
    std::vector<Row> answer_;  // N, then m, per particle
};

}  // namespace haptic::sim
