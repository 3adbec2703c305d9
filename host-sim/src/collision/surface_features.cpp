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

constexpr std::size_t kInBlock = FeatureBlocks::kMaxInBlock;
// Candidates after which a search hands them over.
constexpr std::size_t kTogether = 2048;
static_assert(kTogether + FeatureBlocks::kMaxOfTwoBlocks <= SurfaceFeatures::kMaxTogether);

}  // namespace

SurfaceFeatures::SurfaceFeatures(std::span<const ParticleSurface> surfaces, const ColliderKernels& kernels)
    : kernels_(kernels), blocks_(kernels) {
    for (const ParticleSurface& surface : surfaces) {
        add_surface(surface);
    }
    blocks_.make_boxes();
    // Levels of boxes, up to one that is compared as a whole.
    for (std::size_t count = blocks_.size();; count = (count + kFanOut - 1) / kFanOut) {
        level_.emplace_back().resize(count);
        frame_way_.emplace_back(count);
        if (count <= kFanOut) {
            break;
        }
    }
    frame_way_.emplace_back(1);
    pending_.reserve(kFanOut * kFanOut + kFanOut * blocks_.size());
    for (PairCandidates& some : comparison_.candidates) {
        some.make_room(kMaxTogether);
    }
    hit_.resize(kFanOut + RoundedBoxes::kPadding);
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
    std::vector<Triangle> ordered;
    ordered.reserve(order.size());
    for (const std::uint32_t k : order) {
        const Triangle& t = triangles[k];
        ordered.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
    std::vector<std::uint32_t> in_block(ordered.size() / kInBlock, kInBlock);
    if (const std::size_t rest = ordered.size() % kInBlock; rest > 0) {
        in_block.push_back(static_cast<std::uint32_t>(rest));
    }
    blocks_.add_surface(ordered, in_block);
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

void SurfaceFeatures::fit_boxes(std::span<const VertexPath> path) {
    for (std::size_t k = 0; k < blocks_.size(); ++k) {
        blocks_.fit(k, [&](std::uint32_t v) -> const VertexPath& { return path[v]; });
        frame_way_[0][k] = blocks_.frame_way(k);
    }
    fit_groups();
}

/// Frames of the groups of all levels, and each box in the frame of its group.
void SurfaceFeatures::fit_groups() {
    // Of a block or a group, in its own frame: around its members.
    const auto own_box = [&](std::size_t l, std::size_t at) {
        if (l == 0) {
            return blocks_.box(at);
        }
        RoundedBox whole = empty_box();
        for (std::size_t k = at * kFanOut; k < std::min((at + 1) * kFanOut, level_[l - 1].size()); ++k) {
            include(whole, level_[l - 1][k]);
        }
        return whole;
    };
    for (std::size_t l = 0; l < level_.size(); ++l) {
        RoundedBoxes& level = level_[l];
        const std::size_t in_group = l + 1 < level_.size() ? kFanOut : level.size();
        for (std::size_t begin = 0, g = 0; begin < level.size(); begin += in_group, ++g) {
            const std::size_t end = std::min(begin + in_group, level.size());
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
    const auto count = static_cast<std::uint32_t>(level_[top].size());
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
    while (!pending_.empty() && comparison_.candidates[0].size() < kTogether &&
           comparison_.candidates[1].size() < kTogether) {
        const NodePair pair = pending_.back();
        pending_.pop_back();
        if (pair.level == 0) {
            blocks_.compare(pair.first, pair.second, comparison_);
        } else {
            descend(pair);
        }
    }
    return true;
}

void SurfaceFeatures::descend(const NodePair& pair) {
    const RoundedBoxes& boxes = level_[pair.level - 1];
    const RoundedBox sweep = sweep_of(frame_way_[pair.level][pair.first] - frame_way_[pair.level][pair.second]);
    const auto end_of = [&](std::uint32_t node) {
        return static_cast<std::uint32_t>(std::min<std::size_t>((node + 1) * kFanOut, boxes.size()));
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

}  // namespace haptic::sim
