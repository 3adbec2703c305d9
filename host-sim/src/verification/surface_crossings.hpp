// Surface crossings: where do surfaces pass through themselves or through one another, and how far do they reach below
// the ground? Answered for one state of their vertices, without the code that keeps them apart.
//
// This file and its source share no function with contact/ and collision/: they have their own boxes, their own tree
// and their own predicate. A crossing is an edge that pierces a triangle with which it shares no vertex. Each edge and
// each triangle counts once, so the second face of a double-faced sheet adds nothing.
//
// Touching is no crossing. Signs of volumes decide; a volume counts as zero if moving its corners by `rounding` could
// change its sign, so coplanar neighbours and surfaces that lie on one another do not cross by rounding. Where signs
// are zero, the neighbours decide whether the surface passes:
//   - an edge that meets another in its interior crosses if the other one has triangles on both sides;
//   - a vertex in the interior of a triangle crosses if its edges leave to both sides.
// An edge that passes exactly through a vertex is taken as touching there.
//
// Faces that share a vertex are found by the vertex, all others by a tree of boxes. Where the faces around a vertex all
// look to one side and go around it once, they lie side by side as seen from there, so that no edge of one is in
// another: these pairs, which are most of those whose boxes meet, need no test.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "haptic/types.hpp"

namespace haptic::sim {

/// Surface of one body. Its triangles index its own vertices, which begin at `first_vertex` of all.
/// Those with the same vertex twice are left out.
struct CheckedSurface {
    std::span<const std::array<std::uint32_t, 3>> triangles;
    std::size_t first_vertex = 0;
};

/// An edge that pierces a triangle, or meets one at a border as described above.
struct SurfaceCrossing {
    std::uint32_t edge_object = 0;
    std::array<std::uint32_t, 2> edge{};  // vertices of that object, in rising order; equal for a vertex
    std::uint32_t object = 0;
    std::uint32_t triangle = 0;  // of `object`
    Vec3 position{0.0};          // m
};

/// Finds the crossings of the same surfaces for one state after another. The boxes of triangles form a tree for each
/// surface, built once and fitted to each state: in the usual state the time grows as n log n with n triangles.
class SurfaceCrossings {
  public:
    /// `vertices` of all surfaces, at rest: the tree joins what is near there. Keeps no reference.
    SurfaceCrossings(std::span<const CheckedSurface> surfaces, std::span<const Vec3> vertices);

    /// For so many crossings; more allocate.
    void make_room(std::size_t crossings);
    /// Crossings for these vertices, m, ordered by edge, then by triangle; valid until the next call. `rounding`, m:
    /// how far each coordinate may be off; crossings not deeper than that are touching. The search ends after
    /// `max_tests` pairs of nodes and of faces, and then is not complete(); nor is that of vertices that are not
    /// finite. Deterministic to the bit.
    std::span<const SurfaceCrossing> find(std::span<const Vec3> vertices, double rounding,
                                          std::uint64_t max_tests = std::numeric_limits<std::uint64_t>::max());
    /// Calls visit(crossing) where edges and triangles of the last search touched, whether they cross there or not; but
    /// not for those that share a vertex around which faces lie side by side.
    template <class Visit>
    void for_each_touch(const Visit& visit) const {
        for (const Touch& touch : touches_) {
            visit(touch.crossing);
        }
    }
    /// Whether the last search was complete.
    [[nodiscard]] bool complete() const noexcept { return tests_left_ > 0; }

  private:
    /// A distinct triangle, in the order of the tree's leaves.
    struct Face {
        std::array<std::uint32_t, 3> corner;  // vertices of all
        std::uint32_t object;
        std::uint32_t triangle;
        std::uint32_t own_edges;  // bit k: edge from corner k to k + 1 is tested with this face
    };
    /// Plane of a face: normal . x = offset, the normal of the doubled area's length.
    struct FacePlane {
        Vec3 normal;
        double offset;
        double extent;  // m, diagonal of the face's box
    };
    /// Four numbers of 32 bits, in one register on every target.
    using Four = float __attribute__((vector_size(16)));
    using FourPlaces = std::uint32_t __attribute__((vector_size(16)));
    static constexpr std::uint32_t kLanes = 4;
    static constexpr std::uint32_t kRows = 2;
    static constexpr std::uint32_t kLeafFaces = kRows * kLanes;
    static constexpr FourPlaces kLaneBits{1, 2, 4, 8};
    /// A box as numbers of 32 bits, rounded outward; the fourth ones are 0.
    struct RoundBox {
        Four low;
        Four high;
    };
    /// The faces of a leaf, one per lane: their boxes along each axis, and their corners. Lanes of none hold anything.
    struct Leaf {
        std::array<std::array<Four, 3>, kRows> low{};
        std::array<std::array<Four, 3>, kRows> high{};
        std::array<std::array<FourPlaces, 3>, kRows> corner{};
    };
    /// Which faces of a leaf: bit k is the k-th one.
    using LeafMask = std::uint32_t;
    /// Subtree of `count` faces from `first` on. Up to kLeafFaces it is a leaf; otherwise its left child is the next
    /// node.
    struct Node {
        RoundBox box;
        std::uint32_t first;
        std::uint32_t count;
        std::uint32_t right;
        std::uint32_t leaf;  // its place in leaves_, if it is one
    };
    /// The faces around a vertex, in order, each with an edge in common with the next one; none if there is no such
    /// order.
    struct Fan {
        std::uint32_t first = 0;  // of spokes_; a face is between each two spokes
        std::uint32_t count = 0;  // of spokes; the last one of a closed fan is the first again
        bool closed = false;
    };
    /// An edge of a fan from its middle.
    struct Spoke {
        std::uint32_t vertex;
        std::uint32_t face;  // from here to the next spoke
        double sense;        // 1, or -1 if the face's normal is that against the order
    };
    /// Of the corners of a face: all beyond one side of a plane, all within it up to rounding, or neither for certain.
    enum class PlaneSide : std::uint8_t { Beyond, Within, Unknown };
    /// A meeting that is a crossing if the same edge or vertex has one with the opposite side.
    struct Touch {
        std::array<std::uint32_t, 4> place{};  // edge and edge, or vertex (twice) and face
        bool at_vertex = false;
        bool positive = false;  // side of the neighbour
        SurfaceCrossing crossing;
    };

    std::uint32_t build(std::span<const Vec3> vertices, std::uint32_t first, std::uint32_t count);
    void give_edges_to_faces();
    void order_fans(std::size_t vertices);
    void order_fan(std::uint32_t vertex);
    [[nodiscard]] std::span<const std::uint32_t> faces_around(std::uint32_t vertex) const;
    [[nodiscard]] bool lies_flat(std::uint32_t vertex) const;
    void fit();
    void fit_leaf(Node& node);
    [[nodiscard]] static bool meet(const RoundBox& a, const RoundBox& b);
    [[nodiscard]] static RoundBox box_of(const Leaf& leaf, std::uint32_t face);
    [[nodiscard]] static LeafMask faces_that_meet(const Leaf& leaf, const RoundBox& box);
    [[nodiscard]] static LeafMask faces_at_vertices_of(const Leaf& leaf, const Face& face);
    void visit_within(std::uint32_t node);
    void visit_between(std::uint32_t a, std::uint32_t b);
    void visit_leaves(const Node& one, const Node& other);
    void test_around(std::uint32_t vertex);
    void test_faces(std::uint32_t a, std::uint32_t b);
    [[nodiscard]] PlaneSide side_of(const Face& face, const Face& of, const FacePlane& plane, double extent) const;
    void test_edges(const Face& of, const Face& face);
    void test_edge(std::uint32_t p, std::uint32_t q, const Face& of, const Face& face);
    [[nodiscard]] SurfaceCrossing crossing_at(std::uint32_t p, std::uint32_t q, const Face& of, const Face& face,
                                              const Vec3& position) const;
    void add_touches_that_cross();

    [[nodiscard]] bool is_leaf(const Node& node) const { return node.count <= kLeafFaces; }
    [[nodiscard]] int side(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) const;

    std::vector<std::uint32_t> first_vertex_;  // per object
    std::vector<Face> faces_;
    std::vector<FacePlane> planes_;  // per face
    std::vector<Node> nodes_;        // parents before children
    std::vector<Leaf> leaves_;
    std::vector<std::uint32_t> first_around_;  // per vertex, and the end: of around_
    std::vector<std::uint32_t> around_;        // the faces at each vertex, in rising order
    std::vector<Fan> fans_;                    // per vertex
    std::vector<Spoke> spokes_;
    std::vector<std::uint32_t> roots_;  // per object with faces
    // The state that is being searched.
    std::span<const Vec3> vertices_;
    double rounding_ = 0.0;
    double sum_of_offsets_ = 0.0;  // of all planes: a number if all vertices are
    std::uint64_t tests_left_ = 0;
    std::vector<std::uint8_t> flat_;  // per vertex: the faces around it lie side by side
    std::vector<SurfaceCrossing> found_;
    std::vector<Touch> touches_;
};

/// Vertices below the ground.
struct GroundCrossings {
    std::size_t vertices = 0;
    double depth = 0.0;  // m, of the deepest
};

/// Counts the vertices that are below `height`, m, by more than `rounding`, m.
[[nodiscard]] GroundCrossings find_ground_crossings(std::span<const Vec3> vertices, double height, double rounding);

/// Rounding of coordinates that come from a few operations in double precision, m: a few units in the last place of the
/// largest coordinate.
[[nodiscard]] double rounding_of(std::span<const Vec3> vertices);

}  // namespace haptic::sim
