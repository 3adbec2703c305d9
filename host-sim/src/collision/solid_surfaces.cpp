#include "collision/solid_surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "dynamics/rows.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Of the mean edge of the finest surface: the gap that is guaranteed, far above rounding and far below what is seen or
// felt, and how far rounds may move a vertex before pairs are searched again.
constexpr double kLeastGapOfEdge = 1.0 / 2048.0;
constexpr double kReachOfEdge = 1.0 / 16.0;
// What is unsafe is pushed to so many least gaps.
constexpr double kPushedGaps = 2.0;
// Below the least gap by more than rounding.
constexpr double kRoundingOfGap = 1e-6;
// Rounds: pairs that are unsafe are pushed apart, then bound; after the last everything stands still.
constexpr int kPushes = 6;
constexpr int kBindings = 12;
// Searches that follow one another because vertices leave their reach.
constexpr int kMaxSearches = 4;
// Candidates that are proved at once, and what a thread fits at once.
constexpr std::size_t kProvedTogether = 2048;
constexpr std::size_t kBlocksAtOnce = 16;
constexpr std::uint32_t kFree = 0xffff'ffff;

/// m, of the triangles of a surface at rest.
double mean_edge(const SolidSurface& surface, std::span<const Vec3> rest) {
    double sum = 0.0;
    for (const Triangle& t : surface.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            sum += glm::length(rest[surface.first_vertex + t[k]] - rest[surface.first_vertex + t[(k + 1) % 3]]);
        }
    }
    return sum / (3.0 * static_cast<double>(surface.triangles.size()));
}

bool is_before(const BodyPair& a, const BodyPair& b) noexcept {
    return std::pair(a.first, a.second) < std::pair(b.first, b.second);
}

}  // namespace

SolidSurfaces::SolidSurfaces(std::vector<SolidSurface> surfaces, std::span<const Vec3> rest,
                             std::vector<BodyPair> crossing, std::size_t lanes)
    : surfaces_(std::move(surfaces)),
      surface_of_(rest.size(), 0),
      blocks_(collider_kernels(lanes)),
      kernels_(*find_kernels(&Kernels::features, lanes)),
      left_alone_(std::move(crossing)),
      sweep_(surfaces_.size()),
      bounds_(surfaces_.size()),
      lags_(surfaces_.size(), 0),
      start_(rest.size()),
      asked_(rest.size()),
      end_(rest.size()),
      searched_(rest.size()),
      parent_(rest.size(), kFree),
      part_(rest.size()),
      patch_(rest.size()),
      takes_part_(rest.size(), 0) {
    double finest = std::numeric_limits<double>::max();
    for (std::uint32_t s = 0; s < surfaces_.size(); ++s) {
        const SolidSurface& surface = surfaces_[s];
        std::fill_n(surface_of_.begin() + static_cast<std::ptrdiff_t>(surface.first_vertex), surface.vertices, s);
        first_block_.push_back(static_cast<std::uint32_t>(blocks_.size()));
        if (surface.tree == nullptr || surface.triangles.empty()) {
            continue;
        }
        // A block for each leaf of the tree.
        std::vector<Triangle> triangles;
        std::vector<std::uint32_t> in_block;
        for (std::uint32_t leaf = 0; leaf < surface.tree->leaf_count(); ++leaf) {
            for (const std::uint32_t t : surface.tree->triangles_of(leaf)) {
                Triangle& of_all = triangles.emplace_back(surface.triangles[t]);
                for (std::uint32_t& v : of_all) {
                    v += static_cast<std::uint32_t>(surface.first_vertex);
                }
            }
            in_block.push_back(static_cast<std::uint32_t>(surface.tree->triangles_of(leaf).size()));
        }
        blocks_.add_surface(triangles, in_block);
        finest = std::min(finest, mean_edge(surface, rest));
    }
    blocks_.make_boxes();
    is_near_.resize(blocks_.size(), 0);
    least_gap_ = kLeastGapOfEdge * finest;
    reach_ = kReachOfEdge * finest;
    std::ranges::sort(left_alone_, is_before);
}

bool SolidSurfaces::are_left_alone(std::uint32_t first, std::uint32_t second) const noexcept {
    return std::ranges::binary_search(left_alone_, BodyPair{first, second}, is_before);
}

void SolidSurfaces::keep_apart(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    std::ranges::fill(lags_, std::uint8_t{0});
    search(start, end, workers);
    bool stands = false;
    for (int round = 0; !stands && find_unsafe(); ++round) {
        counts_.unsafe += round == 0 ? unsafe_.size() : 0;
        ++counts_.rounds;
        if (round < kPushes) {
            push_unsafe();
        } else {
            bind_unsafe();
            move_bound();
        }
        int searches = 0;
        for (; have_left_reach() && searches < kMaxSearches; ++searches) {
            search(start, end, workers);
            move_bound();
        }
        stands = searches == kMaxSearches || round == kPushes + kBindings;
    }
    end_step(start, end, stands, workers);
}

/// Writes the ends that have changed, and forgets what took part.
void SolidSurfaces::end_step(std::span<const Vec3> start, std::span<Vec3> end, bool stands, Workers& workers) {
    counts_.bound += bound_.size();
    for (const std::uint32_t v : taking_part_) {
        if (vector_of(end_[v]) != vector_of(asked_[v])) {
            end[v] = vector_of(end_[v]);
            lags_[surface_of_[v]] = 1;
        }
        takes_part_[v] = 0;
        parent_[v] = kFree;
    }
    taking_part_.clear();
    bound_.clear();
    if (stands) {
        ++counts_.stood;
        std::ranges::copy(start, end.begin());
        std::ranges::fill(lags_, std::uint8_t{1});
    }
    workers.for_each(surfaces_.size(), [&](std::size_t s) {
        const SolidSurface& of = surfaces_[s];
        if (lags_[s] != 0 && of.tree != nullptr) {
            of.tree->refit(
                {start.subspan(of.first_vertex, of.vertices), end.subspan(of.first_vertex, of.vertices), of.triangles});
        }
    });
}

/// How far ends are out of the boxes of the ways that were asked for, at most, m.
double SolidSurfaces::farthest_stray() const noexcept {
    Vec3 farthest(0.0);
    for (const std::uint32_t v : taking_part_) {
        const Vec3 start = vector_of(start_[v]);
        const Vec3 asked = vector_of(asked_[v]);
        const Vec3 end = vector_of(end_[v]);
        farthest = glm::max(farthest, glm::max(glm::min(start, asked) - end, end - glm::max(start, asked)));
    }
    return std::max({farthest.x, farthest.y, farthest.z});
}

/// Surfaces that may meet: one of them can be pushed, and their boxes over the step, one grown by a margin, overlap.
void SolidSurfaces::find_meetings(double margin) {
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
        const Aabb box = surfaces_[s].tree == nullptr ? Aabb{} : grown(surfaces_[s].tree->bounds(), 0.5 * margin);
        bounds_[s] = {{box.min.x, box.min.y, box.min.z}, {box.max.x, box.max.y, box.max.z}};
    }
    sweep_.find(bounds_, near_);
    // Those that no longer overlap have parted.
    std::erase_if(left_alone_, [&](const BodyPair& p) { return !overlap(bounds_[p.first], bounds_[p.second]); });
    meetings_ = 0;
    for (const BodyPair& pair : near_) {
        const SolidSurface& first = surfaces_[pair.first];
        const SolidSurface& second = surfaces_[pair.second];
        if (first.tree != nullptr && second.tree != nullptr && (first.movable || second.movable) &&
            !are_left_alone(pair.first, pair.second)) {
            if (meetings_ == meeting_.size()) {
                meeting_.emplace_back();
            }
            meeting_[meetings_++].surfaces = pair;
        }
    }
}

/// Finds the pairs of features that may come too near while vertices end within their reach.
void SolidSurfaces::search(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    const double apart = least_gap_ + 2.0 * reach_;
    // Leaves of trees whose boxes overlap. Both sides may end beyond these.
    const double margin = apart + 2.0 * farthest_stray();
    find_meetings(margin);
    workers.for_each(meetings_, [&](std::size_t m) { find_blocks(meeting_[m], margin); });
    list_near_blocks();
    // Most of them are apart as a whole.
    const auto for_near_blocks = [&](const auto& call) {
        const ParticleRange all{0, static_cast<std::uint32_t>(near_blocks_.size())};
        workers.for_ranges(all, kBlocksAtOnce, [&](std::size_t from, std::size_t to) {
            std::for_each(near_blocks_.begin() + static_cast<std::ptrdiff_t>(from),
                          near_blocks_.begin() + static_cast<std::ptrdiff_t>(to), call);
        });
    };
    for_near_blocks([&](std::uint32_t block) {
        blocks_.place(block, [&](std::uint32_t v) {
            return std::pair(start[v], takes_part_[v] != 0 ? vector_of(end_[v]) : end[v]);
        });
    });
    workers.for_each(meetings_, [&](std::size_t m) {
        std::erase_if(meeting_[m].blocks,
                      [&](const BlockPair& pair) { return blocks_.are_apart(pair.first, pair.second, apart); });
    });
    list_near_blocks();
    // Then of the others their features.
    for (const std::uint32_t block : near_blocks_) {
        for (const std::uint32_t v : blocks_.corners_of(block)) {
            take_part(v, start, end);
        }
    }
    for (const std::uint32_t v : taking_part_) {
        searched_[v] = end_[v];
    }
    for_near_blocks([&](std::uint32_t block) {
        blocks_.fit(block, [&](std::uint32_t v) {
            const Vec3 at = vector_of(start_[v]);
            return VertexPath{.start = at, .way = vector_of(end_[v]) - at, .margin = Vec3(0.5 * apart)};
        });
    });
    workers.for_each(meetings_, [&](std::size_t m) { find_pairs(meeting_[m]); });
    for (std::size_t m = 0; m < meetings_; ++m) {
        counts_.candidates += meeting_[m].candidates;
        counts_.pairs += meeting_[m].pairs[0].size() + meeting_[m].pairs[1].size();
    }
}

/// Those of all meetings, each once.
void SolidSurfaces::list_near_blocks() {
    near_blocks_.clear();
    for (std::size_t m = 0; m < meetings_; ++m) {
        for (const BlockPair& pair : meeting_[m].blocks) {
            for (const std::uint32_t block : {pair.first, pair.second}) {
                if (std::exchange(is_near_[block], std::uint8_t{1}) == 0) {
                    near_blocks_.push_back(block);
                }
            }
        }
    }
    for (const std::uint32_t block : near_blocks_) {
        is_near_[block] = 0;
    }
}

void SolidSurfaces::take_part(std::uint32_t vertex, std::span<const Vec3> start, std::span<const Vec3> end) {
    if (std::exchange(takes_part_[vertex], std::uint8_t{1}) == 0) {
        taking_part_.push_back(vertex);
        start_[vertex] = row_of(start[vertex]);
        asked_[vertex] = end_[vertex] = row_of(end[vertex]);
    }
}

/// Blocks of two surfaces whose boxes, one of them grown by a margin, overlap.
void SolidSurfaces::find_blocks(Meeting& meeting, double margin) const {
    const auto [first, second] = meeting.surfaces;
    meeting.blocks.clear();
    surfaces_[first].tree->query_pairs(*surfaces_[second].tree, margin, [&](std::uint32_t one, std::uint32_t other) {
        meeting.blocks.push_back({first_block_[first] + one, first_block_[second] + other});
    });
}

void SolidSurfaces::find_pairs(Meeting& meeting) const {
    meeting.candidates = 0;
    for (FeaturePairs& pairs : meeting.pairs) {
        pairs.clear();
        pairs.end_gap.clear();
    }
    const auto prove = [&](std::size_t at_least) {
        for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
            PairCandidates& some = meeting.comparison.candidates[kind == PairKind::VertexTriangle ? 0 : 1];
            if (some.size() >= at_least) {
                meeting.candidates += some.size();
                keep_near(meeting, kind, some.vertices());
                some.clear();
            }
        }
    };
    for (const BlockPair& pair : meeting.blocks) {
        blocks_.compare(pair.first, pair.second, meeting.comparison);
        prove(kProvedTogether);
    }
    prove(1);
}

/// Keeps those of the pairs that are not proved to stay apart while their vertices end within reach.
void SolidSurfaces::keep_near(Meeting& meeting, PairKind kind, const PairCandidates::Vertices& vertex) const {
    const auto may_close = [&](const FeaturePairs& pairs, std::size_t k) {
        return !(pairs.gap[k] > 0.0 && pairs.end_gap[k] >= least_gap_ + 2.0 * reach_);
    };
    // Along the quick normals most stay apart.
    FeaturePairs& some = meeting.some;
    some.assign(kind, vertex);
    kernels_.find_normals(kind, some.rows(some.gap), some.size(), start_.data());
    kernels_.find_gaps(kind, some.rows(some.end_gap), some.size(), end_.data());
    FeaturePairs& doubtful = meeting.doubtful;
    doubtful.clear();
    doubtful.kind = kind;
    for (std::size_t k = 0; k < some.size(); ++k) {
        if (may_close(some, k)) {
            doubtful.append(some, k);
        }
    }
    // The quick normal may be a bad one. That of the nearest points costs more.
    doubtful.end_gap.resize(doubtful.size());
    meeting.nearest.resize(doubtful.size());
    kernels_.find_nearest(kind, doubtful.rows(doubtful.gap), doubtful.size(), start_.data(), meeting.nearest.rows());
    kernels_.find_gaps(kind, doubtful.rows(doubtful.end_gap), doubtful.size(), end_.data());
    FeaturePairs& kept = meeting.pairs[kind == PairKind::VertexTriangle ? 0 : 1];
    for (std::size_t k = 0; k < doubtful.size(); ++k) {
        // What touches already is left alone: nothing tells its sides apart.
        if (doubtful.gap[k] > 0.0 && may_close(doubtful, k)) {
            kept.append(doubtful, k);
            kept.end_gap.push_back(doubtful.end_gap[k]);
        }
    }
}

/// Lists the pairs that are not proved apart all the way. Whether there are any. Those of one patch are apart.
bool SolidSurfaces::find_unsafe() {
    unsafe_.clear();
    for (std::uint32_t m = 0; m < meetings_; ++m) {
        for (std::uint32_t list = 0; list < 2; ++list) {
            FeaturePairs& pairs = meeting_[m].pairs[list];
            kernels_.find_gaps(pairs.kind, pairs.rows(pairs.end_gap), pairs.size(), end_.data());
            for (std::uint32_t k = 0; k < pairs.size(); ++k) {
                const bool apart = pairs.gap[k] > 0.0 && pairs.end_gap[k] >= (1.0 - kRoundingOfGap) * least_gap_;
                if (!apart && !is_of_one_patch(pairs, k) &&
                    pairs.safe_part(k, start_.data(), end_.data(), (1.0 - kRoundingOfGap) * least_gap_) < 1.0) {
                    unsafe_.push_back({m, list, k});
                }
            }
        }
    }
    return !unsafe_.empty();
}

/// Pushes unsafe pairs apart at the ends of their ways, between points at which they were, and are, nearest.
void SolidSurfaces::push_unsafe() {
    const double keep = kPushedGaps * least_gap_;
    for (const Unsafe& u : unsafe_) {
        const FeaturePairs& pairs = meeting_[u.meeting].pairs[u.list];
        const PairVertices vertex = pairs.vertices(u.pair);
        const NearestPoints first = nearest_points(pairs.kind, pairs.positions(u.pair, start_.data()));
        const auto push = [&](const NearestPoints& nearest) {
            const Vec3 normal = nearest.normal();
            const double clearance = glm::dot(normal, weighted(nearest.weight, vertex, end_.data())) - keep;
            double mobility = 0.0;
            for (std::size_t k = 0; k < 4; ++k) {
                mobility += surfaces_[surface_of_[vertex[k]]].movable ? nearest.weight[k] * nearest.weight[k] : 0.0;
            }
            if (!(clearance < 0.0 && mobility > 0.0 && glm::dot(normal, first.normal()) > 0.0)) {
                return;
            }
            for (std::size_t k = 0; k < 4; ++k) {
                if (const SolidSurface& of = surfaces_[surface_of_[vertex[k]]]; of.movable) {
                    Row& end = end_[vertex[k]];
                    add_vector(end, -clearance / mobility * nearest.weight[k] * normal);
                    end.number[1] = std::max(end.number[1], of.floor);
                }
            }
        };
        push(first);
        push(nearest_points(pairs.kind, pairs.positions(u.pair, end_.data())));
    }
}

std::uint32_t SolidSurfaces::patch_of(std::uint32_t vertex) noexcept {
    while (parent_[vertex] != vertex) {
        vertex = parent_[vertex] = parent_[parent_[vertex]];
    }
    return vertex;
}

bool SolidSurfaces::is_of_one_patch(const FeaturePairs& pairs, std::size_t at) noexcept {
    const PairVertices vertex = pairs.vertices(at);
    if (std::ranges::any_of(vertex, [&](std::uint32_t v) { return parent_[v] == kFree; })) {
        return false;
    }
    const std::uint32_t patch = patch_of(vertex[0]);
    return std::ranges::all_of(vertex, [&](std::uint32_t v) { return patch_of(v) == patch; });
}

/// Binds the vertices of each unsafe pair in one patch.
void SolidSurfaces::bind_unsafe() {
    for (const Unsafe& u : unsafe_) {
        const PairVertices vertex = meeting_[u.meeting].pairs[u.list].vertices(u.pair);
        for (const std::uint32_t v : vertex) {
            if (parent_[v] == kFree) {
                parent_[v] = v;
                bound_.push_back(v);
            }
            parent_[patch_of(v)] = patch_of(vertex[0]);
        }
    }
}

/// The common motion of each patch: the mean of what is asked of its vertices, but none where one of them cannot be
/// pushed, and not below the floor.
void SolidSurfaces::find_common_motions() {
    for (const std::uint32_t v : bound_) {
        patch_[v] = {};
    }
    for (const std::uint32_t v : bound_) {
        Patch& patch = patch_[patch_of(v)];
        const SolidSurface& of = surfaces_[surface_of_[v]];
        patch.motion += vector_of(asked_[v]) - vector_of(start_[v]);
        patch.vertices += 1.0;
        patch.stands = patch.stands || !of.movable;
        patch.lowest = std::max(patch.lowest, of.floor - start_[v].number[1]);
    }
    for (const std::uint32_t v : bound_) {
        if (parent_[v] == v) {
            Patch& patch = patch_[v];
            patch.motion = patch.stands ? Vec3(0.0) : patch.motion / patch.vertices;
            patch.motion.y = std::max(patch.motion.y, std::min(patch.lowest, 0.0));
        }
    }
}

/// Moves the bound vertices as far toward their asked ends as the planes of their pairs permit.
void SolidSurfaces::move_bound() {
    if (bound_.empty()) {
        return;
    }
    find_common_motions();
    for (const std::uint32_t v : bound_) {
        part_[v] = 1.0;
    }
    for (std::size_t m = 0; m < meetings_; ++m) {
        for (const FeaturePairs& pairs : meeting_[m].pairs) {
            for (std::size_t k = 0; k < pairs.size(); ++k) {
                if (is_of_one_patch(pairs, k)) {
                    keep_to_sides(pairs, k);
                }
            }
        }
    }
    for (const std::uint32_t v : bound_) {
        const Vec3 led = vector_of(start_[v]) + patch_[patch_of(v)].motion;
        set_vector(end_[v], led + part_[v] * (vector_of(asked_[v]) - led));
    }
}

/// Shortens the ways of a pair's vertices so that each stays on its side of the plane in the middle of their gap at the
/// start, which moves as their patch does.
void SolidSurfaces::keep_to_sides(const FeaturePairs& pairs, std::size_t at) noexcept {
    const PairVertices vertex = pairs.vertices(at);
    const FeatureVertices from = pairs.positions(at, start_.data());
    const Vec3 normal = pairs.normal_of(at);
    const Vec3 common = patch_[patch_of(vertex[0])].motion;
    const auto in_first = static_cast<std::size_t>(pairs.kind);
    double first = std::numeric_limits<double>::max();
    double second = std::numeric_limits<double>::lowest();
    for (std::size_t k = 0; k < 4; ++k) {
        const double height = glm::dot(normal, from[k]);
        (k < in_first ? first : second) = k < in_first ? std::min(first, height) : std::max(second, height);
    }
    const double middle = 0.5 * (first + second);
    const double half = 0.5 * std::min(first - second, least_gap_);
    for (std::size_t k = 0; k < 4; ++k) {
        const double side = k < in_first ? 1.0 : -1.0;
        const double room = side * (glm::dot(normal, from[k]) - middle) - half;
        const double approach = -side * glm::dot(normal, vector_of(asked_[vertex[k]]) - from[k] - common);
        if (approach > room) {
            part_[vertex[k]] = std::min(part_[vertex[k]], std::max(0.0, room) / approach);
        }
    }
}

/// Whether a vertex ends farther from where pairs were searched than its reach.
bool SolidSurfaces::have_left_reach() const noexcept {
    return std::ranges::any_of(taking_part_, [&](std::uint32_t v) {
        const Vec3 off = vector_of(end_[v]) - vector_of(searched_[v]);
        return glm::dot(off, off) > reach_ * reach_;
    });
}

}  // namespace haptic::sim
