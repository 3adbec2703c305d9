// A bounding volume hierarchy over triangles in motion.
//
// Built once from the rest shape, refitted each step to boxes that hold every triangle at t = 0 and t = 1, and so, the
// motion being linear, at every time between. Nodes have eight children whose boxes lie side by side, so that one node
// is tested with a few wide operations; a leaf holds about eight triangles and the list of their vertices without
// repetition, so that a refit reads each vertex of a leaf once. Arrays are flat, children follow their parents, and a
// refit is one pass over the leaves and one over the nodes, backwards: a few nanoseconds a triangle, the only thing in
// a step that looks at all of them. A surface that stands still need not be refitted again: see refit().
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <haptic/sim/contact/tree_leaves.hpp>
#include <haptic/sim/mesh.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

/// Axis-aligned box.
struct Box {
    Vec3 low{0.0};
    Vec3 high{0.0};
};

/// The box about a segment from p to q, grown by `margin` on all sides.
[[nodiscard]] Box box_about(const Vec3& p, const Vec3& q, double margin) noexcept;

class SweptTree {
  public:
    /// Two numbers in one register, on every machine that we build for.
    using Pair = double __attribute__((vector_size(16)));
    static constexpr std::size_t kMostInLeaf = 16;  // triangles

    /// Splits the triangles by the positions of `rest`, at medians along the longest axis. Every box is empty until the
    /// first refit. Throws std::invalid_argument for an index without vertex.
    SweptTree(std::span<const Vec3> rest, std::span<const Triangle> triangles);

    /// Fits all boxes to a step. O(n), no allocation. `motion` has the triangles that the tree was built from first.
    /// Boxes hold for as long as the surface is where it was: one that comes to rest is refitted once more with `end`
    /// for both ends of the step, and then not until it moves. `wide` allows the registers that not every machine has;
    /// it makes no difference to the boxes.
    void refit(const SurfaceMotion& motion, bool wide = true) noexcept;

    /// Calls visit(triangle index) for each triangle of each leaf whose box meets `box`; so for a few too many, but for
    /// none too few. Order is fixed by the tree. No allocation. A surface that is far away as a whole costs one test.
    template <class Visit>
    void query(const Box& box, Visit&& visit) const {
        if (!meets(box)) {
            return;
        }
        std::array<std::uint32_t, kMaxStack> stack{};
        std::size_t depth = 0;
        stack[depth++] = 0;
        while (depth > 0) {
            const Node& node = nodes_[stack[--depth]];
            for (std::uint32_t hits = overlaps(node, box); hits != 0; hits &= hits - 1) {
                const std::uint32_t child = node.child[static_cast<std::size_t>(__builtin_ctz(hits))];
                if ((child & kLeaf) == 0) {
                    stack[depth++] = child;
                    continue;
                }
                for (const std::uint32_t triangle : triangles_of(child & ~kLeaf)) {
                    visit(triangle);
                }
            }
        }
    }

    /// One walk for several boxes, at most 64: calls visit(leaf, who) for each leaf that meets any of them, bit k of
    /// `who` being set if it meets boxes[k]. Leaves come in the order in which query() would come to them.
    template <class Visit>
    void walk(std::span<const Box> boxes, Visit&& visit) const {
        std::uint64_t all = 0;
        for (std::size_t k = 0; k < boxes.size(); ++k) {
            all |= std::uint64_t{meets(boxes[k])} << k;
        }
        if (all == 0) {
            return;
        }
        struct Waiting {
            std::uint32_t node;
            std::uint64_t who;
        };
        std::array<Waiting, kMaxStack> stack;  // NOLINT(cppcoreguidelines-pro-type-member-init): 1 kB a walk
        std::size_t depth = 0;
        stack[depth++] = {0, all};
        while (depth > 0) {
            const auto [index, who] = stack[--depth];
            const Node& node = nodes_[index];
            std::array<std::uint64_t, kWidth> into{};
            for (std::uint64_t left = who; left != 0; left &= left - 1) {
                const auto k = static_cast<std::size_t>(__builtin_ctzll(left));
                for (std::uint32_t hits = overlaps(node, boxes[k]); hits != 0; hits &= hits - 1) {
                    into[static_cast<std::size_t>(__builtin_ctz(hits))] |= std::uint64_t{1} << k;
                }
            }
            for (std::size_t slot = 0; slot < kWidth; ++slot) {
                if (into[slot] == 0) {
                    continue;
                }
                if ((node.child[slot] & kLeaf) == 0) {
                    stack[depth++] = {node.child[slot], into[slot]};
                } else {
                    visit(node.child[slot] & ~kLeaf, into[slot]);
                }
            }
        }
    }

    /// Whether anything of the surface may be in the box.
    [[nodiscard]] bool meets(const Box& box) const noexcept { return !nodes_.empty() && meets(bounds_, box); }
    /// Of a leaf that walk() named.
    [[nodiscard]] std::span<const std::uint32_t> triangles_of(std::uint32_t leaf) const noexcept {
        const Leaf& l = leaves_[leaf];
        return {&leaf_triangles_[l.triangles_begin], l.triangles_end - l.triangles_begin};
    }
    /// The vertices of these triangles, each once.
    [[nodiscard]] std::span<const std::uint32_t> vertices_of(std::uint32_t leaf) const noexcept {
        const LeafVertices& l = leaf_ranges_[leaf];
        return {&leaf_vertices_[l.begin], l.end - l.begin};
    }

    /// Box of everything over the step.
    [[nodiscard]] const Box& bounds() const noexcept { return bounds_; }
    /// Component-wise least and greatest displacement over the step of any vertex that is part of a triangle, m.
    [[nodiscard]] const Box& displacement() const noexcept { return displacement_; }
    [[nodiscard]] std::size_t node_count() const noexcept { return nodes_.size(); }
    [[nodiscard]] std::size_t leaf_count() const noexcept { return leaves_.size(); }

  private:
    static constexpr std::size_t kWidth = 8;
    static constexpr std::uint32_t kLeaf = 0x80000000u;
    // Depth is at most 12 (leaves above 4 triangles, halves at medians, 2^32 triangles), seven siblings wait at each.
    static constexpr std::size_t kMaxStack = 12 * (kWidth - 1) + 1;

    struct Node {
        std::array<std::array<Pair, kWidth / 2>, 3> low;         // [axis][child / 2][child % 2]
        std::array<std::array<Pair, kWidth / 2>, 3> minus_high;  // empty slots: infinite, as low
        std::array<std::uint32_t, kWidth> child;                 // node, or leaf | kLeaf
    };
    struct Leaf {
        std::uint32_t triangles_begin;  // in leaf_triangles_
        std::uint32_t triangles_end;
        std::uint32_t node;  // that it hangs under
        std::uint32_t slot;
    };
    struct Builder;

    /// Bit k: child k meets the box.
    [[nodiscard]] static std::uint32_t overlaps(const Node& node, const Box& box) noexcept {
        using PairBits = std::int64_t __attribute__((vector_size(16)));
        PairBits hits{};
        PairBits bit{1, 2};
        for (std::size_t k = 0; k < kWidth / 2; ++k) {
            const PairBits meets = (node.low[0][k] <= box.high.x) & (node.low[1][k] <= box.high.y) &
                                   (node.low[2][k] <= box.high.z) & (node.minus_high[0][k] <= -box.low.x) &
                                   (node.minus_high[1][k] <= -box.low.y) & (node.minus_high[2][k] <= -box.low.z);
            hits |= meets & bit;
            bit <<= 2;
        }
        return static_cast<std::uint32_t>(hits[0] | hits[1]);
    }

    [[nodiscard]] static bool meets(const Box& a, const Box& b) noexcept {
        return a.low.x <= b.high.x && a.high.x >= b.low.x && a.low.y <= b.high.y && a.high.y >= b.low.y &&
               a.low.z <= b.high.z && a.high.z >= b.low.z;
    }
    static void store(Node& node, std::size_t slot, const PointExtremes& box) noexcept;

    std::vector<Node> nodes_;
    std::vector<Leaf> leaves_;
    std::vector<std::uint32_t> leaf_triangles_;
    std::vector<std::uint32_t> leaf_vertices_;
    std::vector<LeafVertices> leaf_ranges_;  // in leaf_vertices_
    std::vector<PointExtremes> leaf_boxes_;  // of the last refit
    std::vector<std::uint32_t> parents_;     // of nodes: parent * kWidth + slot
    Box bounds_;
    Box displacement_;
};

/// A surface over one step with its tree, refitted to that step.
struct MovingSurface {
    SurfaceMotion motion;
    const SweptTree* tree = nullptr;
};

}  // namespace haptic::sim
