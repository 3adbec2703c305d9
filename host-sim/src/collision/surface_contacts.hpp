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
// Pairs are found by boxes around the straight paths that the vertices are expected to take in the next sub-steps, and
// found again when a vertex leaves its path by more than a slack, in the frame of their mean motion. Most features
// whose boxes overlap move alike, and stay apart: a direction along which their gap is wide enough at both ends of the
// paths proves it, because the paths are linear in time. Only the others are kept. Where these are many, those are
// chosen that may come within the thickness before a vertex has moved by its reach, and of these, for the rounds of a
// sub-step, those that may come too near before a round moves a vertex by another one; a round checks what the last one
// moved. A vertex that exceeds its reach makes the choice void. Results do not depend on it.
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

#include "collision/feature_blocks.hpp"
#include "collision/feature_pairs.hpp"
#include "collision/impact_zones.hpp"
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
    /// Whether features of the particle touch or cross at rest. Such particles are not kept apart from one another.
    [[nodiscard]] bool leaves_alone(std::size_t particle) const noexcept { return left_alone_[particle] != 0; }

    void begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) override;
    void project(const ParticleModel& start, const MovingParticles& now, double h) override;
    void finish(const ParticleModel& start, const MovingParticles& now, double h) override;
    [[nodiscard]] bool secures() const noexcept override { return true; }
    [[nodiscard]] std::span<const std::uint32_t> secure(const ParticleModel& start, const MovingParticles& now,
                                                        double h) override;

    [[nodiscard]] const SurfaceContactCounts& counts() const noexcept { return counts_; }
    /// ns spent in this class since the last call; 0 without a clock.
    [[nodiscard]] std::int64_t take_time() noexcept { return clock_.take(); }

  private:
    void find_room();
    [[nodiscard]] double thickness_of(const PairVertices& vertex) const noexcept;
    [[nodiscard]] bool are_of_one_surface(const PairVertices& vertex) const noexcept;
    [[nodiscard]] bool are_left_alone(const PairVertices& vertex) const noexcept;
    [[nodiscard]] bool are_lost(const Row* position) const noexcept;
    template <class Of>
    [[nodiscard]] Vec3 mean_of(const Of& of) const noexcept;
    [[nodiscard]] bool have_left_paths(const Row* position) const noexcept;
    [[nodiscard]] bool have_come_near(const Row* position) const noexcept;
    [[nodiscard]] bool know_pairs(const Row* position);
    [[nodiscard]] int steady_substeps(const Row* position) const noexcept;
    void find_pairs(const Row* position, int ahead);
    void choose_again(const Row* position);
    void choose_near(const Row* position);
    void keep_near(PairKind kind, const PairCandidates::Vertices& vertex);
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
    void let_stand(const MovingParticles& now) noexcept;
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
    std::vector<std::uint32_t> by_number_;  // the vertices, in the order of memory
    const FeatureKernels& kernels_;
    double thickness_;  // m
    double least_gap_;  // m
    CollisionSettings settings_;
    SurfaceContactCounts counts_;
    StageClock clock_;
    VertexMasses masses_;
    SurfaceForces forces_;
    std::vector<std::uint32_t> surface_of_;  // per particle
    std::vector<std::uint8_t> left_alone_;   // per particle
    std::vector<double> room_;               // m, per particle: the most thickness that it has at rest
    std::array<FeaturePairs, 2> found_{FeaturePairs(PairKind::VertexTriangle),
                                       FeaturePairs(PairKind::EdgeEdge)};  // by the search
    std::array<FeaturePairs, 2> pairs_{found_};                            // those of them that are near
    FeaturePairs candidates_{PairKind::VertexTriangle};
    DoubtfulPairs in_doubt_;
    // The last search: paths of the vertices, which they go in so many sub-steps and at whose ends they stay.
    std::vector<VertexPath> path_;  // m, per particle
    std::vector<Row> path_end_;     // m, per particle
    std::vector<double> reach_;     // m, per particle: how far it may come from its path, or from where it was
    double most_reach_ = 0.0;       // m
    int ahead_ = 0;                 // sub-steps of the paths; 0: anywhere in its box
    int elapsed_ = 0;               // sub-steps from the search to the start of this one
    bool searched_ = false;
    // The last choice of near pairs: the others are a thickness apart while each vertex, in the frame of the mean
    // motion, is within this reach of where it was then.
    bool all_are_near_ = false;
    std::vector<Row> chosen_at_;      // m, per particle
    std::vector<double> near_reach_;  // m, per particle
    // Of the sub-step, per particle.
    double h_ = 0.0;  // s
    bool asleep_ = false;
    bool contacts_known_ = false;
    std::vector<Row> start_;  // m
    std::vector<Row> asked_;  // m, where the sub-step would lead
    std::vector<Row> wish_;   // m, the same after pushes
    ImpactZones zones_;
    std::vector<Row> ended_;  // m, at the end of the last sub-step; once this one goes on from there, at its start
    bool goes_on_ = false;
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
