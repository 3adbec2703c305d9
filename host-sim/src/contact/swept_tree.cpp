#include "contact/swept_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "simd/kernels.hpp"

namespace haptic::sim {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kMinToSplit = 7;  // a smaller child is not split further to fill its node

/// Indices of the triangles that a tree holds, rising.
std::vector<std::uint32_t> chosen(std::span<const Triangle> triangles, Faces faces) {
    std::vector<std::uint32_t> all(triangles.size());
    std::iota(all.begin(), all.end(), 0u);
    if (faces == Faces::All) {
        return all;
    }
    // Sort by the sorted vertices, so that equal triangles become neighbours, the first of them ahead.
    std::vector<std::pair<Triangle, std::uint32_t>> sorted;
    sorted.reserve(triangles.size());
    for (const std::uint32_t k : all) {
        Triangle vertices = triangles[k];
        std::sort(vertices.begin(), vertices.end());
        sorted.emplace_back(vertices, k);
    }
    std::sort(sorted.begin(), sorted.end());
    // Drop all but the first of each run.
    sorted.erase(
        std::unique(sorted.begin(), sorted.end(), [](const auto& x, const auto& y) { return x.first == y.first; }),
        sorted.end());
    std::vector<std::uint32_t> first(sorted.size());
    std::transform(sorted.begin(), sorted.end(), first.begin(), [](const auto& x) { return x.second; });
    std::sort(first.begin(), first.end());
    return first;
}

}  // namespace

/// Top-down builder. Ranges of triangles are halved at the median of their centres along the longest axis, largest
/// range first, until a node has eight children or all ranges are small.
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
    std::vector<std::uint32_t> last_seen;  // per vertex: 1 + the last leaf that listed it
    std::vector<std::uint32_t> shared;     // vertices of the current leaf that an earlier leaf has too

    /// Splits a range at its median; returns the upper half.
    Range halve(Range& range) {
        // Longest axis of the centres.
        Aabb box;
        for (std::size_t k = range.begin; k < range.end; ++k) {
            box.extend(centres[order[k]]);
        }
        const Vec3 size = box.size();
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
        const std::size_t middle = range.begin + range.size() / 2;
        // Ties are broken by index: equal centres (both faces of a double-faced triangle) stay together.
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

    /// Adds a leaf with its triangles, in rising order, and their vertices without repetition. Vertices that occur in
    /// no earlier leaf precede the shared ones; only the former count for the surface's displacement.
    std::uint32_t add_leaf(const Range& range) {
        const auto index = static_cast<std::uint32_t>(tree.leaves_.size());
        Leaf leaf{};
        leaf.triangles_begin = static_cast<std::uint32_t>(tree.leaf_triangles_.size());
        LeafVertices vertices;
        vertices.begin = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        // Rising triangle order within the leaf, for a deterministic order of visits.
        std::sort(order.begin() + static_cast<std::ptrdiff_t>(range.begin),
                  order.begin() + static_cast<std::ptrdiff_t>(range.end));
        // Each vertex once: new to the tree, or shared with an earlier leaf.
        shared.clear();
        for (std::size_t k = range.begin; k < range.end; ++k) {
            tree.leaf_triangles_.push_back(order[k]);
            for (const std::uint32_t vertex : triangles[order[k]]) {
                if (last_seen[vertex] != index + 1) {
                    (last_seen[vertex] == 0 ? tree.leaf_vertices_ : shared).push_back(vertex);
                    last_seen[vertex] = index + 1;
                    // Refits must not read beyond the surface's last vertex.
                    vertices.last |= vertex + 1 == last_seen.size() ? 1u : 0u;
                }
            }
        }
        // The shared vertices follow the new ones.
        vertices.shared = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        tree.leaf_vertices_.insert(tree.leaf_vertices_.end(), shared.begin(), shared.end());
        leaf.triangles_end = static_cast<std::uint32_t>(tree.leaf_triangles_.size());
        vertices.end = static_cast<std::uint32_t>(tree.leaf_vertices_.size());
        // Corners by their position in the leaf's list of vertices.
        const auto first = tree.leaf_vertices_.begin() + static_cast<std::ptrdiff_t>(vertices.begin);
        for (std::size_t k = range.begin; k < range.end; ++k) {
            LocalCorners corners{};
            for (std::size_t c = 0; c < corners.size(); ++c) {
                corners[c] = static_cast<std::uint8_t>(
                    std::find(first, tree.leaf_vertices_.end(), triangles[order[k]][c]) - first);
            }
            tree.leaf_corners_.push_back(corners);
        }
        tree.leaves_.push_back(leaf);
        tree.leaf_ranges_.push_back(vertices);
        return index | kLeafChild;
    }

    /// Adds a node and, recursively, its children. Returns its index.
    std::uint32_t add_node(const Range& all) {
        // Split the largest child until there are eight.
        std::array<Range, kWidth> child{};
        child[0] = all;
        std::size_t count = 1;
        while (count < kWidth) {
            const auto largest =
                std::max_element(child.begin(), child.begin() + static_cast<std::ptrdiff_t>(count),
                                 [](const Range& left, const Range& right) { return left.size() < right.size(); });
            if (largest->size() < kMinToSplit) {
                break;
            }
            child[count++] = halve(*largest);
        }
        // Boxes hold nothing before the first refit, and those of empty slots ever after.
        const auto index = static_cast<std::uint32_t>(tree.nodes_.size());
        SweptNode& node = tree.nodes_.emplace_back();
        for (std::size_t axis = 0; axis < 3; ++axis) {
            std::fill_n(node.low[axis], kWidth, kInfinity);
            std::fill_n(node.minus_high[axis], kWidth, kInfinity);
        }
        // Depth first: children follow their parent in the array.
        for (std::size_t k = 0; k < count; ++k) {
            const std::uint32_t added = child[k].size() <= kMaxInLeaf ? add_leaf(child[k]) : add_node(child[k]);
            tree.nodes_[index].child[k] = added;
        }
        return index;
    }
};

SweptTree::SweptTree(std::span<const Vec3> rest, std::span<const Triangle> triangles, Faces faces) {
    Builder builder{*this, triangles, {}, {}, {}, {}};
    builder.centres.reserve(triangles.size());
    // Centre of each triangle, by which it is sorted.
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
    builder.order = chosen(triangles, faces);
    builder.last_seen.assign(rest.size(), 0u);
    builder.add_node({0, builder.order.size()});
    leaf_boxes_.resize(leaves_.size());
    node_boxes_.resize(nodes_.size());
}

void SweptTree::refit(const SurfaceMotion& motion, bool wide) noexcept {
    if (leaves_.empty()) {
        displacement_ = {Vec3(0.0), Vec3(0.0)};
        return;
    }
    static_assert(sizeof(Vec3) == 3 * sizeof(double));
    // Boxes of all leaves, then of all nodes.
    PointExtremes displacement{};
    const RefitTask task{.start = &motion.start.data()->x,
                         .end = &motion.end.data()->x,
                         .vertices = motion.start.size(),
                         .order = leaf_vertices_.data(),
                         .leaf = leaf_ranges_.data(),
                         .leaves = leaves_.size(),
                         .box = leaf_boxes_.data(),
                         .node = nodes_.data(),
                         .nodes = nodes_.size(),
                         .node_box = node_boxes_.data(),
                         .displacement = &displacement};
    (wide ? widest_kernels() : kBaselineKernels).refit(task);
    displacement_ = box_of(displacement);
    bounds_ = box_of(node_boxes_[0]);
}

}  // namespace haptic::sim
