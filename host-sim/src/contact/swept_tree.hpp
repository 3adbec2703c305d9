// Swept bounding volume hierarchy over moving triangles.
//
// The tree is built once from the rest shape and refitted each step. A refitted box holds its triangles at t = 0 and t
// = 1, and because motion is linear, at every time between. Nodes have eight children with their boxes side by side, so
// that one node is tested with a few SIMD operations. A leaf holds about eight triangles and a list of their vertices
// without repetition, so that a refit reads each vertex of a leaf once. Arrays are flat and children follow their
// parents. A refit is one pass over the leaves and one backwards over the nodes: a few nanoseconds a triangle, and the
// only thing in a step that visits all triangles. A surface at rest need not be refitted: see refit().
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "contact/scratch.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"
#include "simd/aabb.hpp"
#include "simd/lanes.hpp"
#include "simd/refit.hpp"

namespace haptic::sim {

/// Faces that a tree holds of a double-faced surface.
enum class Faces : std::uint8_t {
    Single,  // of triangles with the same three vertices only the first: contact is two-sided
    All,     // both, for the thesis' methods
};

/// Bounding volume hierarchy of one surface.
class SweptTree {
  public:
    /// Two doubles in one SIMD register, available on every target.
    using Pair = double __attribute__((vector_size(16)));
    static constexpr std::size_t kMaxInLeaf = 16;  // triangles
    /// Corners of a triangle, as positions among the vertices of its leaf.
    using LocalCorners = std::array<std::uint8_t, 3>;

    /// Splits the triangles at medians along the longest axis, by the positions of `rest`. Every box is empty until the
    /// first refit. Throws std::invalid_argument for a vertex index out of range.
    SweptTree(std::span<const Vec3> rest, std::span<const Triangle> triangles, Faces faces = Faces::Single);

    /// Refits all boxes to a step. O(n), no allocation. `motion` has the triangles that the tree was built from, first.
    /// The boxes stay valid while the surface rests: a surface that comes to rest is refitted once more with `end` for
    /// both ends of the step, and then not until it moves. `wide` permits AVX2 where the machine has it; the boxes are
    /// the same.
    void refit(const SurfaceMotion& motion, bool wide = true) noexcept;

    /// Calls visit(triangle index) for each triangle of each leaf whose box overlaps `box`: a superset of the triangles
    /// that do. The tree fixes the order. No allocation. A surface that is far away as a whole costs one test.
    template <class Visit>
    void query(const Aabb& box, Visit&& visit) const {
        query_leaves(box, [&](std::uint32_t leaf) {
            for (const std::uint32_t triangle : triangles_of(leaf)) {
                visit(triangle);
            }
        });
    }

    /// Same, leaf by leaf: calls visit(leaf).
    template <class Visit>
    void query_leaves(const Aabb& box, Visit&& visit) const {
        if (!overlaps(box)) {
            return;
        }
        // Depth-first traversal with an explicit stack.
        Scratch<std::uint32_t, kMaxStack> stack;
        std::size_t depth = 0;
        stack[depth++] = 0;
        while (depth > 0) {
            const SweptNode& node = nodes_[stack[--depth]];
            // Bit k of `hits`: child k overlaps.
            for (std::uint32_t hits = overlapping_children(node, box); hits != 0; hits &= hits - 1) {
                const std::uint32_t child = node.child[static_cast<std::size_t>(__builtin_ctz(hits))];
                if ((child & kLeafChild) == 0) {
                    stack[depth++] = child;
                } else {
                    visit(child & ~kLeafChild);
                }
            }
        }
    }

    /// Traverses the tree once for several boxes, at most 64. Calls visit(leaf, mask) for each leaf that overlaps any
    /// of them; bit k of `mask` is set if it overlaps boxes[k]. Leaves come in the order of query().
    template <class Visit>
    void query_leaves(std::span<const Aabb> boxes, Visit&& visit) const {
        if (boxes.size() == 1) {
            query_leaves(boxes[0], [&](std::uint32_t leaf) { visit(leaf, std::uint64_t{1}); });
            return;
        }
        // Boxes that overlap the surface as a whole.
        std::uint64_t all = 0;
        for (std::size_t k = 0; k < boxes.size(); ++k) {
            all |= std::uint64_t{overlaps(boxes[k])} << k;
        }
        if (all == 0) {
            return;
        }
        struct Pending {
            std::uint32_t node;
            std::uint64_t mask;
        };
        Scratch<Pending, kMaxStack> stack;
        std::size_t depth = 0;
        stack[depth++] = {0, all};
        while (depth > 0) {
            const auto [index, mask] = stack[--depth];
            const SweptNode& node = nodes_[index];
            // For each child, the boxes that overlap it; bit k of `reached`: any overlaps child k.
            std::array<std::uint64_t, kWidth> into{};
            std::uint32_t reached = 0;
            for (std::uint64_t left = mask; left != 0; left &= left - 1) {
                const auto k = static_cast<std::size_t>(__builtin_ctzll(left));
                std::uint32_t hits = overlapping_children(node, boxes[k]);
                reached |= hits;
                for (; hits != 0; hits &= hits - 1) {
                    into[static_cast<std::size_t>(__builtin_ctz(hits))] |= std::uint64_t{1} << k;
                }
            }
            // Descend with the reduced mask.
            for (; reached != 0; reached &= reached - 1) {
                const auto slot = static_cast<std::size_t>(__builtin_ctz(reached));
                if ((node.child[slot] & kLeafChild) == 0) {
                    stack[depth++] = {node.child[slot], into[slot]};
                } else {
                    visit(node.child[slot] & ~kLeafChild, into[slot]);
                }
            }
        }
    }

    /// Calls visit(leaf, other leaf) for the leaves of two surfaces whose boxes, one of them grown by a margin, m,
    /// overlap. The trees fix the order. No allocation.
    template <class Visit>
    void query_pairs(const SweptTree& other, double margin, Visit&& visit) const {
        if (nodes_.empty() || !other.overlaps(grown(bounds_, margin))) {
            return;
        }
        struct Pending {
            std::uint32_t own;
            std::uint32_t others;
        };
        // A pair gives way to at most all pairs of children, and one of each level is expanded at a time.
        Scratch<Pending, 12 * kWidth * kWidth> stack;
        std::size_t depth = 0;
        stack[depth++] = {0, 0};
        while (depth > 0) {
            const Pending pair = stack[--depth];
            const bool own_is_leaf = (pair.own & kLeafChild) != 0;
            if (own_is_leaf && (pair.others & kLeafChild) != 0) {
                visit(pair.own & ~kLeafChild, pair.others & ~kLeafChild);
                continue;
            }
            // The children of the first that reach the second, and of this those that they reach.
            const auto box_within = [](const SweptTree& tree, std::uint32_t child) {
                return (child & kLeafChild) != 0 ? tree.box_of_leaf(child & ~kLeafChild)
                                                 : box_of(tree.node_boxes_[child]);
            };
            const auto expand = [&](std::uint32_t own, const Aabb& box) {
                if ((pair.others & kLeafChild) != 0) {
                    stack[depth++] = {own, pair.others};
                    return;
                }
                const SweptNode& node = other.nodes_[pair.others];
                for (std::uint32_t hits = overlapping_children(node, box); hits != 0; hits &= hits - 1) {
                    stack[depth++] = {own, node.child[static_cast<std::size_t>(__builtin_ctz(hits))]};
                }
            };
            if (own_is_leaf) {
                expand(pair.own, grown(box_within(*this, pair.own), margin));
                continue;
            }
            const SweptNode& node = nodes_[pair.own];
            const Aabb reached = grown(box_within(other, pair.others), margin);
            for (std::uint32_t hits = overlapping_children(node, reached); hits != 0; hits &= hits - 1) {
                const auto k = static_cast<std::size_t>(__builtin_ctz(hits));
                expand(node.child[k], grown(box_of_child(node, k), margin));
            }
        }
    }

    /// Whether any part of the surface may be in the box during the step.
    [[nodiscard]] bool overlaps(const Aabb& box) const noexcept {
        return !nodes_.empty() && sim::overlaps(bounds_, box);
    }
    /// Box of a leaf over the step, m.
    [[nodiscard]] Aabb box_of_leaf(std::uint32_t leaf) const noexcept { return box_of(leaf_boxes_[leaf]); }
    /// Triangles of a leaf that query_leaves() named.
    [[nodiscard]] std::span<const std::uint32_t> triangles_of(std::uint32_t leaf) const noexcept {
        const Leaf& l = leaves_[leaf];
        return {&leaf_triangles_[l.triangles_begin], l.triangles_end - l.triangles_begin};
    }
    /// The vertices of these triangles, each once.
    [[nodiscard]] std::span<const std::uint32_t> vertices_of(std::uint32_t leaf) const noexcept {
        const LeafVertices& l = leaf_ranges_[leaf];
        return {&leaf_vertices_[l.begin], l.end - l.begin};
    }

    /// The corners of these triangles, in the order of triangles_of().
    [[nodiscard]] std::span<const LocalCorners> corners_of(std::uint32_t leaf) const noexcept {
        const Leaf& l = leaves_[leaf];
        return {&leaf_corners_[l.triangles_begin], l.triangles_end - l.triangles_begin};
    }

    /// Box of the whole surface over the step, m.
    [[nodiscard]] const Aabb& bounds() const noexcept { return bounds_; }
    /// Smallest and largest displacement over the step, per component, of the vertices of the triangles, m.
    [[nodiscard]] const Aabb& displacement() const noexcept { return displacement_; }
    [[nodiscard]] std::size_t leaf_count() const noexcept { return leaves_.size(); }

  private:
    static constexpr std::size_t kWidth = kTreeWidth;
    // Depth is at most 12 (leaves above 4 triangles, split at medians, 2^32 triangles); seven siblings wait at each
    // level.
    static constexpr std::size_t kMaxStack = 12 * (kWidth - 1) + 1;

    struct Leaf {
        std::uint32_t triangles_begin;  // in leaf_triangles_
        std::uint32_t triangles_end;
    };
    struct Builder;

    /// Bit k: child k overlaps the box.
    [[nodiscard]] static std::uint32_t overlapping_children(const SweptNode& node, const Aabb& box) noexcept {
        using PairBits = std::int64_t __attribute__((vector_size(16)));
        PairBits hits{};
        PairBits bit{1, 2};
        for (std::size_t k = 0; k < kWidth / 2; ++k) {
            const auto pair = [&](const double (&of_children)[kWidth]) { return load<Pair>(of_children + 2 * k); };
            const PairBits meets = (pair(node.low[0]) <= box.max.x) & (pair(node.low[1]) <= box.max.y) &
                                   (pair(node.low[2]) <= box.max.z) & (pair(node.minus_high[0]) <= -box.min.x) &
                                   (pair(node.minus_high[1]) <= -box.min.y) & (pair(node.minus_high[2]) <= -box.min.z);
            hits |= meets & bit;
            bit <<= 2;
        }
        return static_cast<std::uint32_t>(hits[0] | hits[1]);
    }

    [[nodiscard]] static Aabb box_of(const PointExtremes& x) noexcept {
        return {Vec3(x.low[0], x.low[1], x.low[2]), Vec3(x.high[0], x.high[1], x.high[2])};
    }
    /// Empty where there is no child.
    [[nodiscard]] static Aabb box_of_child(const SweptNode& node, std::size_t k) noexcept {
        return {Vec3(node.low[0][k], node.low[1][k], node.low[2][k]),
                -Vec3(node.minus_high[0][k], node.minus_high[1][k], node.minus_high[2][k])};
    }

    std::vector<SweptNode> nodes_;
    std::vector<Leaf> leaves_;
    std::vector<std::uint32_t> leaf_triangles_;
    std::vector<LocalCorners> leaf_corners_;  // parallel to leaf_triangles_
    std::vector<std::uint32_t> leaf_vertices_;
    std::vector<LeafVertices> leaf_ranges_;  // in leaf_vertices_
    // Of the last refit.
    std::vector<PointExtremes> leaf_boxes_;
    std::vector<PointExtremes> node_boxes_;
    Aabb bounds_;
    Aabb displacement_{Vec3(0.0), Vec3(0.0)};
};

/// A surface over one step with its tree, refitted to that step.
struct MovingSurface {
    SurfaceMotion motion;
    const SweptTree* tree = nullptr;
};

}  // namespace haptic::sim
