// Surfaces of solids, and the straight paths of their vertices over a step, which are shortened where they would cross.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/feature_pairs.hpp"
#include "contact/swept_tree.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

/// The least gap counts as kept down to this share below it: more than rounding takes.
inline constexpr double kRoundingOfGap = 1e-6;

/// The surface of a solid, whose vertices are consecutive ones of all.
struct SolidSurface {
    SweptTree* tree = nullptr;  // of the triangles
    std::span<const Triangle> triangles;
    std::size_t first_vertex = 0;
    std::size_t vertices = 0;
    bool meets_others = true;  // and is kept apart from those that do too
    bool meets_itself = true;  // and is kept apart from itself
    bool movable = true;       // else nothing pushes its vertices
    bool exact = false;        // not movable, and its vertices go where they are asked, or it stands still
    double floor = 0.0;        // m: no vertex is pushed below this height
};

/// m, of the triangles of a surface, which has some.
[[nodiscard]] double mean_edge_of(const SolidSurface& surface, std::span<const Vec3> vertices);

/// The paths of all vertices over a step, shared by what seeks how far they can go (solid_surfaces.hpp). In an attempt
/// those of surfaces that may meet something are known; rounds move their ends, by move_end() alone.
struct SurfacePaths {
    /// A vertex that is not bound.
    static constexpr std::uint32_t kFree = 0xffff'ffff;
    /// In place of a motion: the surface follows its skin, stands still, or goes the mean of its own ways.
    static constexpr std::uint32_t kFollows = 0xffff'ffff;
    static constexpr std::uint32_t kStands = 0xffff'fffe;
    static constexpr std::uint32_t kMeanWays = 0x8000'0000;  // and its number

    /// `vertices`: of all surfaces, m, at the start.
    SurfacePaths(std::vector<SolidSurface> all, std::span<const Vec3> vertices);

    /// Forgets what rounds have done.
    void begin_attempt() noexcept;
    /// Takes the paths that are asked of a surface, m, unless it has them. Different surfaces on any thread.
    void take_part(std::uint32_t surface, std::span<const Vec3> from, std::span<const Vec3> to) noexcept;
    /// Is called before rounds move a vertex.
    void note_move(std::uint32_t vertex);
    /// Moves an end: proofs in which it has a part do not hold any more.
    void move_end(std::uint32_t vertex, const Vec3& to) noexcept;
    /// Whether rounds may move it.
    [[nodiscard]] bool can_move(std::uint32_t vertex) const noexcept;
    /// Whether it belongs to a surface that is carried or asleep, and so goes where it is asked.
    [[nodiscard]] bool goes_as_asked(std::uint32_t vertex) const noexcept;
    [[nodiscard]] bool is_exact(std::uint32_t vertex) const noexcept { return surfaces[surface_of[vertex]].exact; }
    /// Whether two surfaces, or one, make the same rigid motion, which closes no gap between them.
    [[nodiscard]] bool move_alike(std::uint32_t one, std::uint32_t other) const noexcept {
        return motion_of[one] != kFollows && motion_of[one] == motion_of[other];
    }
    [[nodiscard]] bool is_of_one_patch(const PairVertices& vertex) const noexcept;

    std::vector<SolidSurface> surfaces;
    double finest_edge;                     // m, the least mean edge of surfaces that may meet something and are not
                                            // exact; 0: there are none
    double least_gap;                       // m, that is kept; 0: only exact surfaces, or none, may meet anything
    std::vector<std::uint32_t> surface_of;  // per vertex
    std::vector<std::uint8_t> yields;       // per surface: its vertices can be pushed
    std::vector<std::uint32_t> motion_of;   // per surface, in this step: kFollows, or it is carried, and rounds do not
                                            // move it: the same number means the same motion
    // Of an attempt, per vertex; known for those of surfaces that take part.
    std::vector<std::uint8_t> takes_part;  // per surface
    std::vector<Row> start;                // m
    std::vector<Row> end;                  // m
    std::vector<std::uint32_t> moved;      // vertices that rounds have moved
    std::vector<std::uint8_t> is_moved;    // per vertex
    std::uint64_t round = 0;               // of proofs, since construction
    std::vector<std::uint64_t> moved_in;   // per vertex: the last round after which its end has changed
    // Of vertices that rounds have moved.
    std::vector<Row> asked;         // m, the end as it was given
    std::vector<Row> searched;      // m, the end for which SurfacePairs has searched pairs of two surfaces
    std::vector<Row> own_searched;  // m, the same for pairs of one surface
    // Per vertex: its parent in its patch, by BoundPatches: the vertex that this is named after once all are bound;
    // kFree: it is not bound.
    std::vector<std::uint32_t> parent;
};

}  // namespace haptic::sim
