// Contacts of surfaces whose vertices are particles, with themselves and with one another: cloth that never passes
// through cloth.
//
// Invariant: at the end of every sub-step a vertex and a triangle, or two edges, that share no vertex are at least a
// small gap apart, and on the straight paths that lead there they never touch. So nothing that has not crossed ever
// crosses. Two mechanisms:
//
// Contacts keep features a thickness apart, with equal and opposite forces at their nearest points and Coulomb friction
// (surface_forces.hpp). They make cloth lie on cloth. They are approximate, as all projected constraints are.
//
// secure() guarantees the invariant. A pair is proved apart by a fixed direction along which its gap is positive at
// both ends of the sub-step: the gap is the least of linear functions of time. Where no such direction is found,
// conservative advancement (Mirtich 1996) tells how much of the way is safe. What would come too near is first pushed
// apart. What still does becomes a zone (impact_zones.hpp), which loses a part of the motion within it, at last all of
// it; zones that touch unite. At worst everything stands still or moves alike, which always keeps the invariant. Where
// features are too near already, as edits may leave them, they may not come nearer. Features that touch at rest are
// left alone.
//
// Of the pairs that may meet (sheet_pairs.hpp) those are chosen, for the rounds of a sub-step, that may come too near
// before a round moves a vertex by its reach; a round checks what the last one moved. Results do not depend on it.
// @source R. Bridson, R. Fedkiw, J. Anderson, "Robust Treatment of Collisions, Contact and Friction for Cloth
// Animation", 2002 (contacts first, then a guarantee); M. Li et al., "Codimensional Incremental Potential Contact",
// 2021 (positive distance as invariant); the proof by linear gaps is our own
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "collision/feature_pairs.hpp"
#include "collision/impact_zones.hpp"
#include "collision/sheet_pairs.hpp"
#include "collision/surface_features.hpp"
#include "collision/surface_forces.hpp"
#include "collision/vertex_masses.hpp"
#include "dynamics/stage_clock.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {

/// Counts since construction.
struct SurfaceContactCounts {
    std::uint64_t searches = 0;  // for pairs
    std::uint64_t pairs = 0;     // found, of all searches
    std::uint64_t contacts = 0;  // of all sub-steps
    std::uint64_t unsafe = 0;    // pairs that contacts alone would not have kept apart
    std::uint64_t rounds = 0;    // over unsafe pairs
    std::uint64_t held = 0;      // vertices in zones, of all sub-steps
    std::uint64_t united = 0;    // sub-steps in which everything had to move alike
};

/// While the surfaces sleep, all of them at the same time, nothing is done for them.
class SurfaceContacts final : public SolverContacts {
  public:
    /// Throws std::invalid_argument for surfaces with indices out of range, a thickness that is neither 0 nor between a
    /// micrometre and the mean edge, and lanes that this machine lacks. Results do not depend on the number of lanes.
    SurfaceContacts(const ParticleModel& model, std::span<const ParticleSurface> surfaces,
                    const CollisionSettings& settings, StageClock::Function clock = nullptr,
                    std::size_t lanes = ParticleCollisions::kWidest);

    /// m, that secure() guarantees.
    [[nodiscard]] double least_gap() const noexcept { return least_gap_; }
    [[nodiscard]] const SurfaceFeatures& features() const noexcept { return features_; }
    /// Whether features of the particle touch or cross at rest: SheetPairs::leaves_alone().
    [[nodiscard]] bool leaves_alone(std::size_t particle, bool of_two) const noexcept {
        return pairs_.leaves_alone(particle, of_two);
    }

    void begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) override;
    void project(const ParticleModel& start, const MovingParticles& now, double h) override;
    void finish(const ParticleModel& start, const MovingParticles& now, double h) override;
    [[nodiscard]] bool secures() const noexcept override { return true; }
    [[nodiscard]] std::span<const std::uint32_t> secure(const ParticleModel& start, const MovingParticles& now,
                                                        double h) override;

    [[nodiscard]] SurfaceContactCounts counts() const noexcept;
    /// ns spent in this class since the last call; 0 without a clock.
    [[nodiscard]] std::int64_t take_time() noexcept { return clock_.take(); }

  private:
    [[nodiscard]] std::span<const std::uint32_t> vertices() const noexcept { return features_.vertices(); }
    [[nodiscard]] std::optional<SurfaceContact> renewed(const SurfaceContact& last, const ParticleModel& start) const;
    [[nodiscard]] std::optional<SurfaceContact> between(PairKind kind, const PairVertices& vertex,
                                                        const std::array<double, 4>& weight, const Vec3& normal,
                                                        double distance) const;
    [[nodiscard]] SurfaceContact on_ground(std::uint32_t vertex, const ParticleModel& start) const;
    void find_contacts(const ParticleModel& start, const Row* position);
    void add_contacts(FeaturePairs& pairs);
    [[nodiscard]] double push_out(double missing) const noexcept;
    [[nodiscard]] bool find_unsafe(const Row* position);
    void begin_rounds(const MovingParticles& now) noexcept;
    void end_rounds(const MovingParticles& now);
    void prove(std::uint32_t list, std::uint32_t at, const Row* position);
    void choose_loose(const Row* position);
    void open_moved(const Row* position);
    void find_sinking(const Row* position);
    void unite_all(const MovingParticles& now) noexcept;
    void push_unsafe(const MovingParticles& now) noexcept;
    void push_from_ground(std::uint32_t vertex, const MovingParticles& now) noexcept;
    void unite_unsafe(bool at_once) noexcept;

    /// A pair that may come too near, or a vertex that would sink below the ground, and the part of the way that is
    /// safe.
    struct Unsafe {
        std::uint32_t list;  // of pairs_, or kGround
        std::uint32_t pair;  // or the vertex
        double part;
    };
    static constexpr std::uint32_t kGround = 2;

    SurfaceFeatures features_;
    double thickness_;  // m
    double least_gap_;  // m
    CollisionSettings settings_;
    SheetPairs pairs_;
    const FeatureKernels& kernels_;
    SurfaceContactCounts counts_;
    StageClock clock_;
    VertexMasses masses_;
    SurfaceForces forces_;
    FeaturePairs candidates_{PairKind::VertexTriangle};
    // Of the sub-step, per particle.
    double h_ = 0.0;  // s
    bool asleep_ = false;
    bool contacts_known_ = false;
    std::vector<Row> asked_;  // m, where the sub-step would lead
    std::vector<Row> wish_;   // m, the same after pushes
    ImpactZones zones_;
    std::vector<Row> checked_at_;        // m, where pairs were checked last
    std::vector<Row> all_checked_at_;    // m, where they were all checked last
    std::vector<double> round_reach_;    // m, from there
    std::vector<std::uint8_t> is_open_;  // 1: pairs with the vertex are open
    std::vector<Unsafe> unsafe_;
    // Indices of pairs: those that rounds may bring too near, and those to check next unless all are open.
    std::array<std::vector<std::uint32_t>, 2> loose_{};
    std::array<std::vector<std::uint32_t>, 2> open_{};
    bool all_are_open_ = true;
    std::vector<std::uint32_t> moved_;
};

}  // namespace haptic::sim
