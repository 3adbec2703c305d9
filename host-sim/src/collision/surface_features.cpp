#include "collision/surface_features.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

namespace haptic::sim {
namespace {

constexpr std::size_t kInBlock = 16;  // triangles
constexpr std::size_t kRows = 6;
// Candidates after which a search hands them over.
constexpr std::size_t kTogether = 2048;
// The most that two blocks add: edges are three times the triangles at most.
static_assert(kTogether + 9 * kInBlock * kInBlock <= SurfaceFeatures::kMaxTogether);

// Without branches: see Candidates::add().
bool has(const Triangle& triangle, std::uint32_t vertex) noexcept {
    return (static_cast<int>(triangle[0] == vertex) | static_cast<int>(triangle[1] == vertex) |
            static_cast<int>(triangle[2] == vertex)) != 0;
}

bool share(const SurfaceFeatures::Edge& a, const SurfaceFeatures::Edge& b) noexcept {
    return (static_cast<int>(a[0] == b[0]) | static_cast<int>(a[0] == b[1]) | static_cast<int>(a[1] == b[0]) |
            static_cast<int>(a[1] == b[1])) != 0;
}

constexpr RoundedBox empty_box() noexcept {
    constexpr float far = std::numeric_limits<float>::max();
    return {{far, far, far, -far, -far, -far}};
}

void include(RoundedBox& box, const RoundedBox& other) noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        box.number[k] = std::min(box.number[k], other.number[k]);
        box.number[k + 3] = std::max(box.number[k + 3], other.number[k + 3]);
    }
}

// More than rounding takes from a float.
constexpr float kRoundingOfFloats = std::numeric_limits<float>::epsilon();

inline float below(float x) noexcept {
    return x - std::abs(x) * kRoundingOfFloats;
}
inline float above(float x) noexcept {
    return x + std::abs(x) * kRoundingOfFloats;
}

/// What a box covers in a frame in which its own moves along some way: `sweep` holds the way's bounds.
inline RoundedBox swept(const RoundedBox& box, const RoundedBox& sweep) noexcept {
    RoundedBox whole;  // NOLINT(cppcoreguidelines-pro-type-member-init): written here
    for (std::size_t k = 0; k < 3; ++k) {
        whole.number[k] = below(box.number[k] + sweep.number[k]);
        whole.number[k + 3] = above(box.number[k + 3] + sweep.number[k + 3]);
    }
    return whole;
}

/// Bounds of the way from 0 to `way`.
RoundedBox sweep_of(const Vec3& way) noexcept {
    RoundedBox sweep{};
    for (int k = 0; k < 3; ++k) {
        sweep.number[k] = below(static_cast<float>(std::min(0.0, way[k])));
        sweep.number[k + 3] = above(static_cast<float>(std::max(0.0, way[k])));
    }
    return sweep;
}

}  // namespace

void SurfaceFeatures::Boxes::resize(std::size_t boxes) {
    size = boxes;
    length = boxes + kPadding;
    // What is not a number overlaps nothing.
    number.assign(kRows * length, std::numeric_limits<float>::quiet_NaN());
}

RoundedBox SurfaceFeatures::Boxes::operator[](std::size_t at) const noexcept {
    RoundedBox box{};
    for (std::size_t k = 0; k < kRows; ++k) {
        box.number[k] = number[k * length + at];
    }
    return box;
}

void SurfaceFeatures::Boxes::set(std::size_t at, const RoundedBox& box) noexcept {
    for (std::size_t k = 0; k < kRows; ++k) {
        number[k * length + at] = box.number[k];
    }
}

SurfaceFeatures::SurfaceFeatures(std::span<const ParticleSurface> surfaces, const ColliderKernels& kernels)
    : kernels_(kernels) {
    std::vector<std::uint32_t> first_triangle;
    std::size_t particles = 0;
    for (const ParticleSurface& surface : surfaces) {
        first_triangle.push_back(static_cast<std::uint32_t>(triangle_.size()));
        add_surface(surface);
        particles = std::max(particles, surface.first_particle + surface.rest.size());
    }
    first_triangle.push_back(static_cast<std::uint32_t>(triangle_.size()));
    std::vector<std::uint8_t> owned(particles, 0);
    std::set<Edge> known;
    for (std::size_t s = 0; s < surfaces.size(); ++s) {
        own_features({first_triangle[s], first_triangle[s + 1]}, owned, known);
    }
    list_corners();
    // Levels of boxes, up to one that is compared as a whole.
    block_box_.resize(block_.size());
    vertex_box_.resize(vertex_.size());
    edge_box_.resize(edge_.size());
    triangle_box_.resize(triangle_.size());
    for (std::size_t count = block_.size();; count = (count + kFanOut - 1) / kFanOut) {
        level_.emplace_back().resize(count);
        frame_way_.emplace_back(count);
        if (count <= kFanOut) {
            break;
        }
    }
    frame_way_.emplace_back(1);
    pending_.reserve(kFanOut * kFanOut + kFanOut * block_.size());
    for (Candidates& some : candidates_) {
        for (std::vector<std::uint32_t>& of : some.vertex) {
            of.resize(kMaxTogether);
        }
    }
    hit_.resize(std::max({kInBlock * 3, kFanOut}) + kPadding);
    reaching_.resize(hit_.size());
}

/// Appends a surface's triangles in the order of blocks, each set of corners once.
void SurfaceFeatures::add_surface(const ParticleSurface& surface) {
    const std::uint32_t first = surface.first_particle;
    std::set<Triangle> known;
    std::vector<Triangle> triangles;
    std::vector<Vec3> centre;
    for (const Triangle& t : surface.triangles) {
        if (std::max({t[0], t[1], t[2]}) >= surface.rest.size()) {
            throw std::invalid_argument("surface: a triangle refers to vertex " +
                                        std::to_string(std::max({t[0], t[1], t[2]})) + " of " +
                                        std::to_string(surface.rest.size()));
        }
        Triangle corners = t;
        std::ranges::sort(corners);
        if (known.insert(corners).second) {
            triangles.push_back(t);
            centre.push_back(surface.rest[t[0]] + surface.rest[t[1]] + surface.rest[t[2]]);
        }
    }
    std::vector<std::uint32_t> order(triangles.size());
    for (std::uint32_t k = 0; k < order.size(); ++k) {
        order[k] = k;
    }
    order_blocks(centre, order);
    for (const std::uint32_t k : order) {
        const Triangle& t = triangles[k];
        triangle_.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
}

/// Splits at multiples of a block's size along the longest axis, until what is left is a block.
void SurfaceFeatures::order_blocks(std::span<const Vec3> centre, std::span<std::uint32_t> order) {
    if (order.size() <= kInBlock) {
        return;
    }
    Vec3 low(std::numeric_limits<double>::max());
    Vec3 high(std::numeric_limits<double>::lowest());
    for (const std::uint32_t k : order) {
        low = glm::min(low, centre[k]);
        high = glm::max(high, centre[k]);
    }
    const Vec3 size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t blocks = (order.size() + kInBlock - 1) / kInBlock;
    const std::size_t middle = (blocks + 1) / 2 * kInBlock;
    std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(middle), order.end(),
                     [&](std::uint32_t a, std::uint32_t b) {
                         return std::pair(centre[a][axis], a) < std::pair(centre[b][axis], b);
                     });
    order_blocks(centre, order.first(middle));
    order_blocks(centre, order.subspan(middle));
}

/// Divides a surface's triangles into blocks, and gives each vertex and edge to the first block that has it.
void SurfaceFeatures::own_features(const Range& triangles, std::vector<std::uint8_t>& owned, std::set<Edge>& known) {
    for (std::uint32_t begin = triangles.begin; begin < triangles.end; begin += kInBlock) {
        Block block;
        block.triangles = {begin, std::min<std::uint32_t>(begin + kInBlock, triangles.end)};
        block.vertices.begin = static_cast<std::uint32_t>(vertex_.size());
        block.edges.begin = static_cast<std::uint32_t>(edge_.size());
        for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
            for (std::size_t k = 0; k < 3; ++k) {
                const std::uint32_t a = triangle_[t][k];
                const std::uint32_t b = triangle_[t][(k + 1) % 3];
                if (owned[a] == 0) {
                    owned[a] = 1;
                    vertex_.push_back(a);
                }
                if (const Edge edge{std::min(a, b), std::max(a, b)}; known.insert(edge).second) {
                    edge_.push_back(edge);
                }
            }
        }
        block.vertices.end = static_cast<std::uint32_t>(vertex_.size());
        block.edges.end = static_cast<std::uint32_t>(edge_.size());
        block_.push_back(block);
    }
}

/// Lists the vertices of each block's triangles. Its own vertices and edges are among them.
void SurfaceFeatures::list_corners() {
    std::vector<std::uint32_t> place(vertex_.empty() ? 0 : *std::ranges::max_element(vertex_) + 1U);
    corner_of_triangle_.resize(triangle_.size());
    corner_of_edge_.resize(edge_.size());
    corner_of_vertex_.resize(vertex_.size());
    for (Block& block : block_) {
        block.corners.begin = static_cast<std::uint32_t>(corner_.size());
        for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
            corner_.insert(corner_.end(), triangle_[t].begin(), triangle_[t].end());
        }
        const auto first = corner_.begin() + block.corners.begin;
        std::sort(first, corner_.end());
        corner_.erase(std::unique(first, corner_.end()), corner_.end());
        block.corners.end = static_cast<std::uint32_t>(corner_.size());
        for (std::uint32_t c = block.corners.begin; c < block.corners.end; ++c) {
            place[corner_[c]] = c - block.corners.begin;
        }
        const auto place_of = [&](std::uint32_t v) { return static_cast<std::uint8_t>(place[v]); };
        for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
            std::ranges::transform(triangle_[t], corner_of_triangle_[t].begin(), place_of);
        }
        for (std::uint32_t e = block.edges.begin; e < block.edges.end; ++e) {
            std::ranges::transform(edge_[e], corner_of_edge_[e].begin(), place_of);
        }
        for (std::uint32_t v = block.vertices.begin; v < block.vertices.end; ++v) {
            corner_of_vertex_[v] = place_of(vertex_[v]);
        }
    }
}

void SurfaceFeatures::fit_boxes(std::span<const Path> path) {
    for (std::size_t k = 0; k < block_.size(); ++k) {
        fit_block(k, path);
    }
    fit_groups();
}

/// Boxes of a block and its features, in the frame of its mean way.
void SurfaceFeatures::fit_block(std::size_t at, std::span<const Path> path) {
    const Block& block = block_[at];
    const std::span<const std::uint32_t> corner(&corner_[block.corners.begin], block.corners.end - block.corners.begin);
    Vec3 sum(0.0);
    for (const std::uint32_t v : corner) {
        sum += path[v].way;
    }
    const Vec3 frame_way = sum / static_cast<double>(corner.size());
    frame_way_[0][at] = frame_way;
    // Of the corners, then of what consists of them.
    std::array<RoundedBox, 3 * kInBlock> box;  // NOLINT(cppcoreguidelines-pro-type-member-init): written first
    RoundedBox whole = empty_box();
    for (std::size_t c = 0; c < corner.size(); ++c) {
        const Path& of = path[corner[c]];
        const Vec3 end = of.start + (of.way - frame_way);
        for (int k = 0; k < 3; ++k) {
            box[c].number[k] = below(static_cast<float>(std::min(of.start[k], end[k]) - of.margin[k]));
            box[c].number[k + 3] = above(static_cast<float>(std::max(of.start[k], end[k]) + of.margin[k]));
        }
        include(whole, box[c]);
    }
    block_box_[at] = whole;
    for (std::uint32_t v = block.vertices.begin; v < block.vertices.end; ++v) {
        vertex_box_.set(v, box[corner_of_vertex_[v]]);
    }
    for (std::uint32_t e = block.edges.begin; e < block.edges.end; ++e) {
        RoundedBox edge = box[corner_of_edge_[e][0]];
        include(edge, box[corner_of_edge_[e][1]]);
        edge_box_.set(e, edge);
    }
    for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
        RoundedBox triangle = box[corner_of_triangle_[t][0]];
        include(triangle, box[corner_of_triangle_[t][1]]);
        include(triangle, box[corner_of_triangle_[t][2]]);
        triangle_box_.set(t, triangle);
    }
}

/// Frames of the groups of all levels, and each box in the frame of its group.
void SurfaceFeatures::fit_groups() {
    // Of a block or a group, in its own frame: around its members.
    const auto own_box = [&](std::size_t l, std::size_t at) {
        if (l == 0) {
            return block_box_[at];
        }
        RoundedBox whole = empty_box();
        for (std::size_t k = at * kFanOut; k < std::min((at + 1) * kFanOut, level_[l - 1].size); ++k) {
            include(whole, level_[l - 1][k]);
        }
        return whole;
    };
    for (std::size_t l = 0; l < level_.size(); ++l) {
        Boxes& level = level_[l];
        const std::size_t in_group = l + 1 < level_.size() ? kFanOut : level.size;
        for (std::size_t begin = 0, g = 0; begin < level.size; begin += in_group, ++g) {
            const std::size_t end = std::min(begin + in_group, level.size);
            Vec3 sum(0.0);
            for (std::size_t k = begin; k < end; ++k) {
                sum += frame_way_[l][k];
            }
            const Vec3 frame_way = sum / static_cast<double>(end - begin);
            frame_way_[l + 1][g] = frame_way;
            for (std::size_t k = begin; k < end; ++k) {
                level.set(k, swept(own_box(l, k), sweep_of(frame_way_[l][k] - frame_way)));
            }
        }
    }
}

/// All pairs of the top level.
void SurfaceFeatures::begin_search() {
    pending_.clear();
    const auto top = static_cast<std::uint32_t>(level_.size() - 1);
    const auto count = static_cast<std::uint32_t>(level_[top].size);
    for (std::uint32_t a = count; a-- > 0;) {
        const std::size_t hits = kernels_.find_overlaps(level_[top].rows(), level_[top][a], a, count, hit_.data());
        for (std::size_t h = hits; h-- > 0;) {
            pending_.push_back({top, a, hit_[h]});
        }
    }
}

/// False: nothing is left.
bool SurfaceFeatures::search_more() {
    if (pending_.empty()) {
        return false;
    }
    while (!pending_.empty() && candidates_[0].size < kTogether && candidates_[1].size < kTogether) {
        const NodePair pair = pending_.back();
        pending_.pop_back();
        if (pair.level == 0) {
            compare(pair.first, pair.second);
        } else {
            descend(pair);
        }
    }
    return true;
}

void SurfaceFeatures::descend(const NodePair& pair) {
    const Boxes& boxes = level_[pair.level - 1];
    const RoundedBox sweep = sweep_of(frame_way_[pair.level][pair.first] - frame_way_[pair.level][pair.second]);
    const auto end_of = [&](std::uint32_t node) {
        return static_cast<std::uint32_t>(std::min<std::size_t>((node + 1) * kFanOut, boxes.size));
    };
    const auto fan_out = static_cast<std::uint32_t>(kFanOut);
    for (std::uint32_t a = end_of(pair.first); a-- > pair.first * fan_out;) {
        const std::uint32_t begin = std::max(a, pair.second * fan_out);
        const std::size_t hits =
            kernels_.find_overlaps(boxes.rows(), swept(boxes[a], sweep), begin, end_of(pair.second), hit_.data());
        for (std::size_t h = hits; h-- > 0;) {
            pending_.push_back({pair.level - 1, a, hit_[h]});
        }
    }
}

void SurfaceFeatures::compare(std::uint32_t first, std::uint32_t second) {
    compare_vertices(first, second);
    if (first != second) {
        compare_vertices(second, first);
    }
    compare_edges(first, second);
}

/// Those of a block's features, with boxes in `range`, that reach into the box of another block.
std::span<const std::uint32_t> SurfaceFeatures::reaching(const Boxes& boxes, const Range& range, std::uint32_t of,
                                                         std::uint32_t with) {
    const RoundedBox into = swept(block_box_[with], sweep_of(frame_way_[0][with] - frame_way_[0][of]));
    const std::size_t count = kernels_.find_overlaps(boxes.rows(), into, range.begin, range.end, reaching_.data());
    return {reaching_.data(), count};
}

/// The vertices of a block with the triangles of another one, or its own.
void SurfaceFeatures::compare_vertices(std::uint32_t of, std::uint32_t with) {
    const Range& triangles = block_[with].triangles;
    const RoundedBox sweep = sweep_of(frame_way_[0][of] - frame_way_[0][with]);
    for (const std::uint32_t v : reaching(vertex_box_, block_[of].vertices, of, with)) {
        const std::size_t hits = kernels_.find_overlaps(triangle_box_.rows(), swept(vertex_box_[v], sweep),
                                                        triangles.begin, triangles.end, hit_.data());
        for (std::size_t h = 0; h < hits; ++h) {
            const Triangle& t = triangle_[hit_[h]];
            candidates_[0].add(!has(t, vertex_[v]), vertex_[v], t[0], t[1], t[2]);
        }
    }
}

/// The edges of a block with those of another one, or with its own that come later.
void SurfaceFeatures::compare_edges(std::uint32_t of, std::uint32_t with) {
    const Range& edges = block_[with].edges;
    const RoundedBox sweep = sweep_of(frame_way_[0][of] - frame_way_[0][with]);
    for (const std::uint32_t e : reaching(edge_box_, block_[of].edges, of, with)) {
        const std::size_t hits = kernels_.find_overlaps(edge_box_.rows(), swept(edge_box_[e], sweep),
                                                        of == with ? e + 1 : edges.begin, edges.end, hit_.data());
        for (std::size_t h = 0; h < hits; ++h) {
            const Edge& other = edge_[hit_[h]];
            candidates_[1].add(!share(edge_[e], other), edge_[e][0], edge_[e][1], other[0], other[1]);
        }
    }
}

}  // namespace haptic::sim
