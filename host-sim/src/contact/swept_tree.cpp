#include "haptic/sim/contact/swept_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

namespace haptic::sim {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kLeastToSplit = 7;  // a child with fewer triangles is not split further to fill its node

using Pair = SweptTree::Pair;
using Bounds = SweptTree::Bounds;

constexpr Bounds kEmpty{Pair{kInfinity, kInfinity}, Pair{kInfinity, kInfinity}, Pair{kInfinity, kInfinity}};

inline Pair least(const Pair& x, const Pair& y) noexcept {
    return x < y ? x : y;
}

inline Pair greatest(const Pair& x, const Pair& y) noexcept {
    return x > y ? x : y;
}

/// Extremes of points that come in twos; of z both of a two lie side by side.
struct Extremes {
    Pair low_xy{kInfinity, kInfinity};
    Pair high_xy{-kInfinity, -kInfinity};
    Pair low_z{kInfinity, kInfinity};
    Pair high_z{-kInfinity, -kInfinity};

    void add(const Vec3& p, const Vec3& q) noexcept {
        const Pair p_xy{p.x, p.y};
        const Pair q_xy{q.x, q.y};
        const Pair z{p.z, q.z};
        low_xy = least(least(low_xy, p_xy), q_xy);
        high_xy = greatest(greatest(high_xy, p_xy), q_xy);
        low_z = least(low_z, z);
        high_z = greatest(high_z, z);
    }
    [[nodiscard]] Bounds bounds() const noexcept {
        const double low = low_z[0] < low_z[1] ? low_z[0] : low_z[1];
        const double high = high_z[0] > high_z[1] ? high_z[0] : high_z[1];
        return {low_xy, Pair{low, -high_xy[0]}, Pair{-high_xy[1], -high}};
    }
};

inline Box box_of(const Bounds& b) noexcept {
    return {Vec3(b.xy[0], b.xy[1], b.zx[0]), Vec3(-b.zx[1], -b.yz[0], -b.yz[1])};
}

Box empty_box() noexcept {
    return {Vec3(kInfinity), Vec3(-kInfinity)};
}

}  // namespace

Box box_about(const Vec3& p, const Vec3& q, double margin) noexcept {
    Box box;
    for (int k = 0; k < 3; ++k) {
        box.low[k] = std::min(p[k], q[k]) - margin;
        box.high[k] = std::max(p[k], q[k]) + margin;
    }
    return box;
}

/// Builds top-down: ranges of triangles, halved at the median of their centres along the longest axis, the largest
/// range first, until a node has eight children.
struct SweptTree::Builder {
    struct Range {
        std::size_t begin;
        std::size_t end;
        [[nodiscard]] std::size_t size() const { return end - begin; }
    };

    SweptTree& tree;
    std::span<const Triangle> triangles;
    std::vector<Vec3> centres;
    std::vector<std::uint32_t> order;
    std::vector<std::uint32_t> last_seen;  // by vertex: the leaf that listed it last, plus 1
    std::vector<std::uint32_t> shared;     // of the leaf at hand: vertices that an earlier leaf has

    Range halve(Range& range) {
        Box box = empty_box();
        for (std::size_t k = range.begin; k < range.end; ++k) {
            box.low = glm::min(box.low, centres[order[k]]);
            box.high = glm::max(box.high, centres[order[k]]);
        }
        const Vec3 size = box.high - box.low;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
        const std::size_t middle = range.begin + range.size() / 2;
        // Equal centres (the two faces of a double-faced triangle) stay side by side, in the order of their numbers.
        std::nth_element(order.begin() + static_cast<std::ptrdiff_t>(range.begin),
                         order.begin() + static_cast<std::ptrdiff_t>(middle),
                         order.begin() + static_cast<std::ptrdiff_t>(range.end),
                         [&](std::uint32_t left, std::uint32_t right) {
                             const double x = centres[left][axis];
                             const double y = centres[right][axis];
                             return x < y || (x == y && left < right);
                         });
        const Range upper{middle, range.end};
        range.end = middle;
        return upper;
    }

    std::uint32_t add_leaf(const Range& range, std::uint32_t node, std::uint32_t slot) {
        const auto index = static_cast<std::uint32_t>(tree.leaves_.size());
        Leaf leaf{};
        leaf.node = node;
        leaf.slot = slot;
        leaf.triangles_begin = static_cast<std::uint32_t>(tree.leaf_triangles_.size());
        leaf.vertices_begin = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        std::sort(order.begin() + static_cast<std::ptrdiff_t>(range.begin),
                  order.begin() + static_cast<std::ptrdiff_t>(range.end));
        shared.clear();
        for (std::size_t k = range.begin; k < range.end; ++k) {
            tree.leaf_triangles_.push_back(order[k]);
            for (const std::uint32_t vertex : triangles[order[k]]) {
                if (last_seen[vertex] != index + 1) {
                    (last_seen[vertex] == 0 ? tree.leaf_vertices_ : shared).push_back(vertex);
                    last_seen[vertex] = index + 1;
                }
            }
        }
        leaf.shared_begin = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        tree.leaf_vertices_.insert(tree.leaf_vertices_.end(), shared.begin(), shared.end());
        leaf.triangles_end = static_cast<std::uint32_t>(tree.leaf_triangles_.size());
        leaf.vertices_end = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        tree.leaves_.push_back(leaf);
        return index | kLeaf;
    }

    std::uint32_t add_node(const Range& all, std::uint32_t parent) {
        std::array<Range, kWidth> child{};
        child[0] = all;
        std::size_t count = 1;
        while (count < kWidth) {
            const auto largest =
                std::max_element(child.begin(), child.begin() + static_cast<std::ptrdiff_t>(count),
                                 [](const Range& left, const Range& right) { return left.size() < right.size(); });
            if (largest->size() < kLeastToSplit) {
                break;
            }
            child[count++] = halve(*largest);
        }
        const auto index = static_cast<std::uint32_t>(tree.nodes_.size());
        Node node{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            node.low[axis].fill(kEmpty.xy);
            node.minus_high[axis].fill(kEmpty.xy);
        }
        tree.nodes_.push_back(node);
        tree.parents_.push_back(parent);
        for (std::size_t k = 0; k < count; ++k) {
            const auto slot = static_cast<std::uint32_t>(k);
            const std::uint32_t added = child[k].size() <= kMostInLeaf
                                            ? add_leaf(child[k], index, slot)
                                            : add_node(child[k], index * static_cast<std::uint32_t>(kWidth) + slot);
            tree.nodes_[index].child[k] = added;
        }
        return index;
    }
};

SweptTree::SweptTree(std::span<const Vec3> rest, std::span<const Triangle> triangles)
    : bounds_(empty_box()), displacement_{} {
    Builder builder{*this, triangles, {}, {}, {}, {}};
    builder.centres.reserve(triangles.size());
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        Vec3 sum(0.0);
        for (const std::uint32_t vertex : triangles[k]) {
            if (vertex >= rest.size()) {
                throw std::invalid_argument("triangle " + std::to_string(k) + " names vertex " +
                                            std::to_string(vertex) + " of a mesh of " + std::to_string(rest.size()) +
                                            " vertices");
            }
            sum += rest[vertex];
        }
        builder.centres.push_back(sum / 3.0);
    }
    if (triangles.empty()) {
        return;
    }
    builder.order.resize(triangles.size());
    std::iota(builder.order.begin(), builder.order.end(), 0u);
    builder.last_seen.assign(rest.size(), 0u);
    builder.add_node({0, triangles.size()}, 0);
}

void SweptTree::refit(const SurfaceMotion& motion) noexcept {
    Extremes displacement;
    for (const Leaf& leaf : leaves_) {
        Extremes extremes;
        for (std::uint32_t k = leaf.vertices_begin; k < leaf.shared_begin; ++k) {
            const Vec3& x0 = motion.start[leaf_vertices_[k]];
            const Vec3& x1 = motion.end[leaf_vertices_[k]];
            extremes.add(x0, x1);
            const Vec3 d = x1 - x0;
            displacement.add(d, d);
        }
        for (std::uint32_t k = leaf.shared_begin; k < leaf.vertices_end; ++k) {
            extremes.add(motion.start[leaf_vertices_[k]], motion.end[leaf_vertices_[k]]);
        }
        store(nodes_[leaf.node], leaf.slot, extremes.bounds());
    }
    displacement_ = leaves_.empty() ? Box{} : box_of(displacement.bounds());
    for (std::size_t index = nodes_.size(); index-- > 0;) {
        const Node& node = nodes_[index];
        const auto least_of = [](const std::array<Pair, kWidth / 2>& x) {
            const Pair p = least(least(x[0], x[1]), least(x[2], x[3]));
            return p[0] < p[1] ? p[0] : p[1];
        };
        const Bounds box{Pair{least_of(node.low[0]), least_of(node.low[1])},
                         Pair{least_of(node.low[2]), least_of(node.minus_high[0])},
                         Pair{least_of(node.minus_high[1]), least_of(node.minus_high[2])}};
        if (index > 0) {
            store(nodes_[parents_[index] / kWidth], parents_[index] % kWidth, box);
        } else {
            bounds_ = box_of(box);
        }
    }
}

void SweptTree::store(Node& node, std::size_t slot, const Bounds& box) noexcept {
    const std::size_t pair = slot / 2;
    const std::size_t half = slot % 2;
    node.low[0][pair][half] = box.xy[0];
    node.low[1][pair][half] = box.xy[1];
    node.low[2][pair][half] = box.zx[0];
    node.minus_high[0][pair][half] = box.zx[1];
    node.minus_high[1][pair][half] = box.yz[0];
    node.minus_high[2][pair][half] = box.yz[1];
}

}  // namespace haptic::sim
