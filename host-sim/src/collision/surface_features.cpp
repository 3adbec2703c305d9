#include "collision/surface_features.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
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

bool has(const Triangle& triangle, std::uint32_t vertex) noexcept {
    return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

bool share(const SurfaceFeatures::Edge& a, const SurfaceFeatures::Edge& b) noexcept {
    return a[0] == b[0] || a[0] == b[1] || a[1] == b[0] || a[1] == b[1];
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

void SurfaceFeatures::Candidates::reserve(std::size_t size) {
    for (std::vector<std::uint32_t>& of : vertex) {
        of.reserve(size);
    }
}

void SurfaceFeatures::Candidates::clear() noexcept {
    for (std::vector<std::uint32_t>& of : vertex) {
        of.clear();
    }
}

void SurfaceFeatures::Candidates::add(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    vertex[0].push_back(a);
    vertex[1].push_back(b);
    vertex[2].push_back(c);
    vertex[3].push_back(d);
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
    // Levels of boxes, up to one that is compared as a whole.
    vertex_box_.resize(vertex_.size());
    edge_box_.resize(edge_.size());
    triangle_box_.resize(triangle_.size());
    for (std::size_t count = block_.size();; count = (count + kFanOut - 1) / kFanOut) {
        level_.emplace_back().resize(count);
        if (count <= kFanOut) {
            break;
        }
    }
    pending_.reserve(kFanOut * kFanOut + kFanOut * block_.size());
    for (Candidates& some : candidates_) {
        some.reserve(kMaxTogether);
    }
    hit_.resize(std::max({kInBlock * 3, kFanOut}) + kPadding);
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

void SurfaceFeatures::fit_boxes(std::span<const Box> box) {
    const auto rounded = [&](std::uint32_t v) {
        RoundedBox result{};
        for (int k = 0; k < 3; ++k) {
            result.number[k] = static_cast<float>(box[v].low[k]);
            result.number[k + 3] = static_cast<float>(box[v].high[k]);
        }
        return result;
    };
    for (std::size_t k = 0; k < block_.size(); ++k) {
        const Block& block = block_[k];
        RoundedBox whole = empty_box();
        for (std::uint32_t v = block.vertices.begin; v < block.vertices.end; ++v) {
            vertex_box_.set(v, rounded(vertex_[v]));
        }
        for (std::uint32_t e = block.edges.begin; e < block.edges.end; ++e) {
            RoundedBox edge = rounded(edge_[e][0]);
            include(edge, rounded(edge_[e][1]));
            edge_box_.set(e, edge);
        }
        // Vertices and edges of a block lie in its triangles.
        for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
            RoundedBox triangle = rounded(triangle_[t][0]);
            include(triangle, rounded(triangle_[t][1]));
            include(triangle, rounded(triangle_[t][2]));
            triangle_box_.set(t, triangle);
            include(whole, triangle);
        }
        level_[0].set(k, whole);
    }
    for (std::size_t l = 1; l < level_.size(); ++l) {
        for (std::size_t k = 0; k < level_[l].size; ++k) {
            RoundedBox whole = empty_box();
            for (std::size_t c = k * kFanOut; c < std::min((k + 1) * kFanOut, level_[l - 1].size); ++c) {
                include(whole, level_[l - 1][c]);
            }
            level_[l].set(k, whole);
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
    while (!pending_.empty() && candidates_[0].size() < kTogether && candidates_[1].size() < kTogether) {
        const NodePair pair = pending_.back();
        pending_.pop_back();
        if (pair.level == 0) {
            compare(block_[pair.first], block_[pair.second]);
        } else {
            descend(pair);
        }
    }
    return true;
}

void SurfaceFeatures::descend(const NodePair& pair) {
    const Boxes& boxes = level_[pair.level - 1];
    const auto end_of = [&](std::uint32_t node) {
        return static_cast<std::uint32_t>(std::min<std::size_t>((node + 1) * kFanOut, boxes.size));
    };
    const auto fan_out = static_cast<std::uint32_t>(kFanOut);
    for (std::uint32_t a = end_of(pair.first); a-- > pair.first * fan_out;) {
        const std::uint32_t begin = std::max(a, pair.second * fan_out);
        const std::size_t hits =
            kernels_.find_overlaps(boxes.rows(), boxes[a], begin, end_of(pair.second), hit_.data());
        for (std::size_t h = hits; h-- > 0;) {
            pending_.push_back({pair.level - 1, a, hit_[h]});
        }
    }
}

void SurfaceFeatures::compare(const Block& first, const Block& second) {
    const bool same = &first == &second;
    compare_vertices(first.vertices, second.triangles);
    if (!same) {
        compare_vertices(second.vertices, first.triangles);
    }
    for (std::uint32_t e = first.edges.begin; e < first.edges.end; ++e) {
        const std::uint32_t begin = same ? e + 1 : second.edges.begin;
        const std::size_t hits =
            kernels_.find_overlaps(edge_box_.rows(), edge_box_[e], begin, second.edges.end, hit_.data());
        for (std::size_t h = 0; h < hits; ++h) {
            const Edge& other = edge_[hit_[h]];
            if (!share(edge_[e], other)) {
                candidates_[1].add(edge_[e][0], edge_[e][1], other[0], other[1]);
            }
        }
    }
}

void SurfaceFeatures::compare_vertices(const Range& vertices, const Range& triangles) {
    for (std::uint32_t v = vertices.begin; v < vertices.end; ++v) {
        const std::size_t hits =
            kernels_.find_overlaps(triangle_box_.rows(), vertex_box_[v], triangles.begin, triangles.end, hit_.data());
        for (std::size_t h = 0; h < hits; ++h) {
            const Triangle& t = triangle_[hit_[h]];
            if (!has(t, vertex_[v])) {
                candidates_[0].add(vertex_[v], t[0], t[1], t[2]);
            }
        }
    }
}

}  // namespace haptic::sim
