// Surfaces of solids that never pass through themselves, one another or sheets.
//
// The surface of a solid follows its particles: skinning tells where its vertices are to be at the end of a step.
// Contacts of particles keep bodies apart with forces, as ellipsoids. Surfaces differ from these, so two of them may
// be asked to cross, as may two parts of one. Here each follows as far as it can without.
//
// Invariant: at the end of every step a vertex and a triangle, or two edges, that share no vertex are at least a small
// gap apart, and on the straight paths that lead there they never touch. So nothing that has not crossed ever crosses.
// Whatever is in the way, the invariant can be kept: where all vertices stand still, or move alike, no gap closes. What
// a surface lags behind its skin it makes up for as soon as there is room, some of it in each step. Particles, forces
// and momenta are not changed by it; how far they may leave their surface: scene/waiting_bodies.hpp; where they need
// not follow on straight paths, lone ones that are entangled: scene/lone_surfaces.hpp. A sheet is where its particles
// are: its surface is exact, and solids follow it.
//
// Pairs of features that may come too near are found in each step (surface_pairs.hpp). They are first pushed apart at
// the ends of their paths, in several rounds, as long as that helps. The vertices of the pairs that are left are bound
// (bound_patches.hpp): each goes as far as it can without leaving its side of planes. Pairs that they meet are bound
// too. When no pair is left, pairs are searched again where rounds have moved vertices. If some are still left after
// many rounds, their surfaces are carried: as a whole, by the mean of their ways, and if that is not safe, nowhere.
//
// Surfaces that cross or touch one another at the beginning are left alone until their boxes part, and where one
// crosses or touches itself then it is for ever (surface_pairs.hpp). Any surfaces may be carried by rigid motions, or
// asked to stand still, so that they do not pass through something else: carry(). What makes the same motion needs no
// search, which would find no proof where it turns: gaps are far smaller than ways.
// @source M. Li et al., "Codimensional Incremental Potential Contact", 2021 (positive distance as invariant); the rest
// is our own
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/bound_patches.hpp"
#include "collision/listed_pairs.hpp"
#include "collision/surface_pairs.hpp"
#include "collision/surface_paths.hpp"
#include "dynamics/rigid_motion.hpp"
#include "dynamics/workers.hpp"
#include "haptic/types.hpp"
#include "simd/features.hpp"

namespace haptic::sim {

/// Counts since construction.
struct SolidSurfaceCounts {
    std::uint64_t unsafe = 0;  // that the skin alone would not have kept apart
    std::uint64_t stuck = 0;   // how often surfaces had to be carried, because rounds were not enough
};

class SolidSurfaces {
  public:
    /// In place of a motion: the surface follows its skin, or stands still.
    static constexpr std::uint32_t kFollows = SurfacePaths::kFollows;
    static constexpr std::uint32_t kStands = SurfacePaths::kStands;

    /// `start`: vertices of all surfaces, m, to which all trees have been fitted. `left_alone`: what
    /// crosses there. `catch_up_speed`: m/s. Throws std::invalid_argument for a number of lanes that this machine
    /// lacks. Results do not depend on it.
    SolidSurfaces(std::vector<SolidSurface> surfaces, std::span<const Vec3> start, SurfacesAtStart left_alone,
                  double catch_up_speed, std::size_t lanes);
    // Its parts refer to one another.
    SolidSurfaces(const SolidSurfaces&) = delete;
    SolidSurfaces& operator=(const SolidSurfaces&) = delete;

    /// m, that is kept; features that are nearer come no nearer. 0: only exact surfaces, or none, may meet anything.
    [[nodiscard]] double least_gap() const noexcept { return paths_.least_gap; }
    /// Whether two surfaces are kept apart: one of them can be pushed, and they are not left to one another.
    [[nodiscard]] bool keeps_apart(std::uint32_t one, std::uint32_t other) const noexcept {
        return pairs_.keeps_apart(one, other);
    }
    /// Whether a surface is kept apart from itself, but where all vertices of two features are left alone.
    [[nodiscard]] bool keeps_whole(std::uint32_t surface) const noexcept {
        return paths_.surfaces[surface].meets_itself;
    }
    [[nodiscard]] bool leaves_alone(std::size_t vertex) const noexcept { return pairs_.leaves_alone(vertex); }

    /// For a surface that lags, between skinning and refit: moves its ends, m, back from the skin by the part of its
    /// lag that it cannot catch up with in this time, s. Different surfaces on any thread.
    void ask(std::size_t surface, std::span<Vec3> end, double time) noexcept;
    /// Marked by 1: surfaces that do not move and cannot be pushed until this is called again. All can at first.
    void let_sleep(std::span<const std::uint8_t> asleep) noexcept;
    /// Changes the ends of the step, m, of all vertices, so that nothing crosses on straight paths from `start` to
    /// `end`. All trees have been refitted to both; those of surfaces that change are again.
    void keep_apart(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    /// The ends of a surface are those of its skin, whatever it lagged before.
    void forget_lag(std::size_t surface) noexcept;
    /// keep_apart() where some surfaces are to make one of these motions each, as a whole, or none if that would not be
    /// safe. `carried_by`: the motion of each surface, kStands or kFollows.
    void carry(std::span<const std::uint32_t> carried_by, std::span<const RigidMotion> motions,
               std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    /// After keep_apart(), a surface that is kept apart from itself goes to a place, m, of all, at once: the step
    /// starts and ends there. The caller sees to it that it crosses nothing there, neither where others start nor where
    /// they end, and that nothing was in between.
    void jump(std::size_t surface, std::span<const Vec3> to, std::span<Vec3> start, std::span<Vec3> end);
    /// Writes where the skin of a surface is that ends there, m, of all.
    void write_skin(std::size_t surface, std::span<const Vec3> end, std::span<Vec3> skin) const noexcept;
    /// Whether a surface has gone as a whole in the last step, or stood still.
    [[nodiscard]] bool is_carried(std::size_t surface) const noexcept { return paths_.motion_of[surface] != kFollows; }
    /// Whether it has stood still as a whole.
    [[nodiscard]] bool stands(std::size_t surface) const noexcept { return paths_.motion_of[surface] == kStands; }
    /// Whether keep_apart() may find anything to do.
    [[nodiscard]] bool may_hold_back() const noexcept;
    /// Whether a vertex of this surface is not where its skin would be.
    [[nodiscard]] bool lags(std::size_t surface) const noexcept { return most_lag_[surface] > 0.0; }
    /// m, per surface: how far a vertex is from where its skin would be, at most.
    [[nodiscard]] std::span<const double> most_lag() const noexcept { return most_lag_; }

    [[nodiscard]] const SolidSurfaceCounts& counts() const noexcept { return counts_; }

  private:
    void follow(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    void move_as_whole(std::size_t surface, std::uint32_t motion_of, const RigidMotion& motion,
                       std::span<const Vec3> start, std::span<Vec3> end) noexcept;
    void let_stand(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end) noexcept;
    void let_change(std::uint32_t surface) noexcept;
    void carry_unsafe(std::span<const Vec3> start, std::span<Vec3> end) noexcept;
    [[nodiscard]] RigidMotion mean_way(std::size_t surface, std::span<const Vec3> start,
                                       std::span<const Vec3> end) const noexcept;
    void let_heap_stand(std::span<const Vec3> start, std::span<Vec3> end) noexcept;
    void find_most_lag(std::size_t surface) noexcept;
    void refit(std::size_t surface, std::span<const Vec3> start, std::span<const Vec3> end) noexcept;
    [[nodiscard]] bool make_safe(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    void end_step(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    void take_ends(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end) noexcept;
    [[nodiscard]] bool find_unsafe(bool patches_are_apart = true);
    [[nodiscard]] bool stands_proved(const ListedPairs& pairs, std::size_t at) const noexcept;
    void push_unsafe();

    SurfacePaths paths_;
    SurfacePairs pairs_;
    BoundPatches patches_;
    const FeatureKernels& kernels_;
    double catch_up_speed_;              // m/s
    std::vector<std::uint8_t> changes_;  // per surface, in this step
    std::vector<double> most_lag_;       // m, per surface
    std::vector<Vec3> lag_;              // m, per vertex: from where it is to where its skin would be
    std::vector<UnsafePair> unsafe_;
    SolidSurfaceCounts counts_;
};

}  // namespace haptic::sim
