// Pairs of features of sheets that may come within a thickness of one another.
//
// Pairs are found by boxes around the straight paths that the vertices are expected to take in the next sub-steps, and
// found again when a vertex leaves its path by more than a slack, in the frame of their mean motion. Most features
// whose boxes overlap move alike, and stay apart: a direction along which their gap is wide enough at both ends of the
// paths proves it, because the paths are linear in time. Only the others are kept. Where these are many, those are
// chosen that may come within the thickness before a vertex has moved by its reach. A vertex that exceeds its reach
// makes the choice void. Results do not depend on it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/feature_blocks.hpp"
#include "collision/feature_pairs.hpp"
#include "collision/surface_features.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"
#include "simd/features.hpp"

namespace haptic::sim {

/// m, how far the vertices of a surface may come, and the most of them.
struct VertexReaches {
    const std::vector<double>& of;
    double most;
    /// Whether features that are a gap apart, m, may come within a distance, m.
    [[nodiscard]] bool may_close(double gap, double distance, PairKind kind,
                                 const PairVertices& vertex) const noexcept {
        const double spare = gap - (1.0 + kRounding) * distance;
        return !(spare >= 2.0 * most) && !(spare >= (1.0 + kRounding) * of_both(kind, vertex));
    }

  private:
    static constexpr double kRounding = 1e-6;  // above that of gaps

    /// m, the most that two points of features can come nearer.
    [[nodiscard]] double of_both(PairKind kind, const PairVertices& vertex) const noexcept {
        const double first = of[vertex[0]];
        const double second = of[vertex[1]];
        const double last = std::max(of[vertex[2]], of[vertex[3]]);
        return kind == PairKind::VertexTriangle ? first + std::max(second, last) : std::max(first, second) + last;
    }
};

class SheetPairs {
  public:
    struct Settings {
        double thickness = 0.0;  // m
        double least_gap = 0.0;  // m: features that are nearer at rest are left alone
        bool between_bodies = true;
    };
    /// Of these surfaces of particles, whose features outlive it.
    SheetPairs(SurfaceFeatures& features, std::size_t particles, std::span<const ParticleSurface> surfaces,
               const Settings& settings, std::size_t lanes);

    /// The vertices, in the order of memory.
    [[nodiscard]] std::span<const std::uint32_t> vertices() const noexcept { return by_number_; }
    /// Per particle.
    [[nodiscard]] std::span<const std::uint32_t> surface_of() const noexcept { return surface_of_; }
    [[nodiscard]] bool are_of_one_surface(const PairVertices& vertex) const noexcept {
        return surface_of_[vertex[0]] == surface_of_[vertex[3]];
    }
    /// m, that these features keep: less where they are nearer at rest.
    [[nodiscard]] double thickness_of(const PairVertices& vertex) const noexcept {
        return std::min({room_[vertex[0]], room_[vertex[1]], room_[vertex[2]], room_[vertex[3]]});
    }
    /// Whether features of the particle touch or cross at rest, also those that touch another sheet if pairs are
    /// `of_two`. Such particles are not kept apart from one another.
    [[nodiscard]] bool leaves_alone(std::size_t particle, bool of_two) const noexcept {
        return left_alone_[particle] != 0 || (of_two && touches_[particle] != 0);
    }
    /// Pairs of a kind for which there is room; more allocates.
    [[nodiscard]] std::size_t room() const noexcept { return room_for_pairs_; }

    /// Begins a sub-step where the model is. Whether it goes on from where the last one has ended.
    bool begin(const ParticleModel& model);
    /// m, where vertices are at its start, per particle.
    [[nodiscard]] const std::vector<Row>& start() const noexcept { return start_; }
    /// Sees to it that the pairs are known while vertices are led to these places. False: the state has diverged, and
    /// nothing is known.
    [[nodiscard]] bool know(const Row* position);
    /// The same for vertices that have been led elsewhere since. Whether the pairs are others now.
    [[nodiscard]] bool know_again(const Row* position);
    /// Vertices may be anywhere: what is known is so no longer.
    void forget() noexcept { searched_ = false; }
    /// Ends the sub-step here, where gaps of near() at the end have been found.
    void end(const Row* position) noexcept;

    /// Vertices and triangles, then edges: gaps at the start, and room for those at the end.
    [[nodiscard]] std::array<FeaturePairs, 2>& near() noexcept { return near_; }

    /// Since construction: searches, and pairs that they found.
    struct Counts {
        std::uint64_t searches = 0;
        std::uint64_t pairs = 0;
    };
    [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

  private:
    void find_room();
    [[nodiscard]] bool are_left_alone(const PairVertices& vertex) const noexcept;
    [[nodiscard]] bool are_lost(const Row* position) const noexcept;
    template <class Of>
    [[nodiscard]] Vec3 mean_of(const Of& of) const noexcept;
    [[nodiscard]] bool have_left_paths(const Row* position) const noexcept;
    [[nodiscard]] bool have_come_near(const Row* position) const noexcept;
    [[nodiscard]] int steady_substeps(const Row* position) const noexcept;
    void find_pairs(const Row* position, int ahead);
    void choose_again(const Row* position);
    void choose_near(const Row* position);
    void keep_near(PairKind kind, const PairCandidates::Vertices& vertex);

    SurfaceFeatures& features_;
    std::vector<std::uint32_t> by_number_;
    const FeatureKernels& kernels_;
    Settings settings_;
    Counts counts_;
    std::vector<std::uint32_t> surface_of_;  // per particle
    std::vector<std::uint8_t> left_alone_;   // per particle
    std::vector<std::uint8_t> touches_;      // per particle: another sheet, at rest
    std::vector<double> room_;               // m, per particle: the most thickness that it has at rest
    std::size_t room_for_pairs_ = 0;
    std::array<FeaturePairs, 2> found_{FeaturePairs(PairKind::VertexTriangle),
                                       FeaturePairs(PairKind::EdgeEdge)};  // by the search
    std::array<FeaturePairs, 2> near_{found_};                             // those of them that are near
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
    std::vector<Row> start_;  // m
    std::vector<Row> ended_;  // m, at the end of the last sub-step; once this one goes on from there, at its start
    bool goes_on_ = false;
};

}  // namespace haptic::sim
