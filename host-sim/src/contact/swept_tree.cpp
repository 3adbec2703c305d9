#include "contact/swept_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "simd/refit.hpp"

namespace haptic::sim {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kLeastToSplit = 7;  // a child with fewer triangles is not split further to fill its node

using Pair = SweptTree::Pair;
constexpr Pair kEmpty{kInfinity, kInfinity};

inline Pair least(const Pair& x, const Pair& y) noexcept {
    return x < y ? x : y;
}

Box box_of(const PointExtremes& x) noexcept {
    return {Vec3(x.low[0], x.low[1], x.low[2]), Vec3(x.high[0], x.high[1], x.high[2])};
}

#if defined(__x86_64__)
bool has_wide_registers() noexcept {
    return __builtin_cpu_supports("avx2") != 0;
}
#endif

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
        LeafVertices vertices;
        vertices.begin = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        std::sort(order.begin() + static_cast<std::ptrdiff_t>(range.begin),
                  order.begin() + static_cast<std::ptrdiff_t>(range.end));
        shared.clear();
        for (std::size_t k = range.begin; k < range.end; ++k) {
            tree.leaf_triangles_.push_back(order[k]);
            for (const std::uint32_t vertex : triangles[order[k]]) {
                if (last_seen[vertex] != index + 1) {
                    (last_seen[vertex] == 0 ? tree.leaf_vertices_ : shared).push_back(vertex);
                    last_seen[vertex] = index + 1;
                    vertices.last |= vertex + 1 == last_seen.size() ? 1u : 0u;
                }
            }
        }
        vertices.shared = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        tree.leaf_vertices_.insert(tree.leaf_vertices_.end(), shared.begin(), shared.end());
        leaf.triangles_end = static_cast<std::uint32_t>(tree.leaf_triangles_.size());
        vertices.end = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        tree.leaves_.push_back(leaf);
        tree.leaf_ranges_.push_back(vertices);
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
            node.low[axis].fill(kEmpty);
            node.minus_high[axis].fill(kEmpty);
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
    leaf_boxes_.resize(leaves_.size());
}

void SweptTree::refit(const SurfaceMotion& motion, [[maybe_unused]] bool wide) noexcept {
    if (leaves_.empty()) {
        displacement_ = {};
        return;
    }
    static_assert(sizeof(Vec3) == 3 * sizeof(double));
    PointExtremes displacement{};
    const RefitTask task{.start = &motion.start.data()->x,
                         .end = &motion.end.data()->x,
                         .vertices = motion.start.size(),
                         .order = leaf_vertices_.data(),
                         .leaf = leaf_ranges_.data(),
                         .leaves = leaves_.size(),
                         .box = leaf_boxes_.data(),
                         .displacement = &displacement};
#if defined(__x86_64__)
    static const bool has_avx2 = has_wide_registers();
    if (wide && has_avx2) {
        refit_avx2(task);
    } else {
        refit_baseline(task);
    }
#else
    refit_baseline(task);
#endif
    displacement_ = box_of(displacement);
    for (std::size_t k = 0; k < leaves_.size(); ++k) {
        store(nodes_[leaves_[k].node], leaves_[k].slot, leaf_boxes_[k]);
    }
    for (std::size_t index = nodes_.size(); index-- > 0;) {
        const Node& node = nodes_[index];
        const auto least_of = [](const std::array<Pair, kWidth / 2>& x) {
            const Pair p = least(least(x[0], x[1]), least(x[2], x[3]));
            return p[0] < p[1] ? p[0] : p[1];
        };
        const PointExtremes box{
            {least_of(node.low[0]), least_of(node.low[1]), least_of(node.low[2]), 0.0},
            {-least_of(node.minus_high[0]), -least_of(node.minus_high[1]), -least_of(node.minus_high[2]), 0.0}};
        if (index > 0) {
            store(nodes_[parents_[index] / kWidth], parents_[index] % kWidth, box);
        } else {
            bounds_ = box_of(box);
        }
    }
}

void SweptTree::store(Node& node, std::size_t slot, const PointExtremes& box) noexcept {
    const std::size_t pair = slot / 2;
    const std::size_t half = slot % 2;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        node.low[axis][pair][half] = box.low[axis];
        node.minus_high[axis][pair][half] = -box.high[axis];
    }
}

}  // namespace haptic::sim
