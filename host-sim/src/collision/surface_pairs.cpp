#include "collision/surface_pairs.hpp"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <utility>

#include "contact/swept_tree.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "simd/aabb.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Of the mean edge of the finest surface.
constexpr double kReachOfEdge = 1.0 / 16.0;     // how far rounds may move a vertex before pairs are searched again
constexpr double kOwnApartOfEdge = 1.0 / 64.0;  // pairs of one surface that rounds may bring too near
// Pairs of one surface that are farther apart at the start than this, in its mean edges, and are not proved apart; and
// how many of them are too many: it is turned inside out, and to keep it from that would take seconds.
constexpr double kAfarInEdges = 2.0;
constexpr std::size_t kMostFromAfar = 1U << 15;
// Candidates that are proved at once, and what a thread takes at once.
constexpr std::size_t kProvedTogether = 2048;
constexpr std::size_t kPlacedAtOnce = 32;   // blocks
constexpr std::size_t kTestedAtOnce = 64;   // pairs of blocks
constexpr std::size_t kFittedAtOnce = 8;    // blocks
constexpr std::size_t kMinPairsInPart = 8;  // of blocks
constexpr std::size_t kMaxPairsInPart = 64;
// Parts of a search, if each then has neither too few pairs nor too many.
constexpr std::size_t kParts = 8;
constexpr std::size_t kPartsWithRoom = 24;
// Room at first: meetings, pairs of blocks in each and in all, and pairs of features in a list.
constexpr std::size_t kMeetingsPerSurface = 3;
constexpr std::size_t kPairsPerMeeting = 4096;
constexpr std::size_t kPairsOfAll = 1U << 17;
constexpr std::size_t kPairsInOwn = 1U << 18;  // of all surfaces that meet themselves
constexpr std::size_t kPairsInList = kProvedTogether + FeatureBlocks::kMaxOfTwoBlocks;
constexpr std::uint32_t kNotOwn = 0xffff'ffff;
// A block for each leaf.
static_assert(SweptTree::kMaxInLeaf <= FeatureBlocks::kMaxInBlock);

/// Sizes of blocks, those that follow one another together as far as they fit.
std::vector<std::uint32_t> merged(std::span<const std::uint32_t> blocks) {
    std::vector<std::uint32_t> sizes;
    for (const std::uint32_t size : blocks) {
        if (!sizes.empty() && sizes.back() + size <= FeatureBlocks::kMaxInBlock) {
            sizes.back() += size;
        } else {
            sizes.push_back(size);
        }
    }
    return sizes;
}

std::vector<std::uint32_t> that_meet(std::span<const SolidSurface> surfaces) {
    std::vector<std::uint32_t> meet;
    for (std::uint32_t s = 0; s < surfaces.size(); ++s) {
        if (surfaces[s].meets_others && !surfaces[s].triangles.empty()) {
            meet.push_back(s);
        }
    }
    return meet.size() < 2 ? std::vector<std::uint32_t>{} : meet;
}

BodyPair ordered(std::uint32_t one, std::uint32_t other) noexcept {
    return {std::min(one, other), std::max(one, other)};
}

/// All of a list.
template <class List>
ParticleRange range_of(const List& list) noexcept {
    return {0, static_cast<std::uint32_t>(list.size())};
}

bool is_before(const BodyPair& a, const BodyPair& b) noexcept {
    return std::pair(a.first, a.second) < std::pair(b.first, b.second);
}

}  // namespace

SurfacePairs::SurfacePairs(SurfacePaths& paths, std::span<const Vec3> start, SurfacesAtStart left_alone,
                           std::size_t lanes)
    : paths_(paths),
      blocks_(collider_kernels(lanes)),
      first_block_(paths.surfaces.size(), 0),
      kernels_(*find_kernels(&Kernels::features, lanes)),
      reach_(kReachOfEdge * paths.finest_edge),
      own_apart_(paths.least_gap + kOwnApartOfEdge * paths.finest_edge),
      leaves_alone_(start.size(), 0),
      is_due_(start.size(), 1),
      left_alone_(std::move(left_alone.crossing)),
      meets_(that_meet(paths.surfaces)),
      sweep_(meets_.size()),
      bounds_(meets_.size(), Bounds{}),
      own_of_(paths.surfaces.size(), kNotOwn) {
    for (const std::uint32_t v : left_alone.vertices) {
        leaves_alone_[v] = 1;
    }
    for (std::uint32_t s = 0; s < paths.surfaces.size(); ++s) {
        const SolidSurface& surface = paths.surfaces[s];
        const bool meets_itself = surface.meets_itself && !surface.triangles.empty();
        if (!meets_itself && !std::ranges::binary_search(meets_, s)) {
            continue;
        }
        first_block_[s] = static_cast<std::uint32_t>(blocks_.size());
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
        if (meets_itself) {
            own_of_[s] = static_cast<std::uint32_t>(own_.size());
            FeatureBlocks own(collider_kernels(lanes));
            own.add_surface(triangles, merged(in_block));
            own.make_boxes();
            own_.emplace_back(s, std::move(own), *find_kernels(&Kernels::deformation, lanes),
                              mean_edge_of(surface, start));
        }
    }
    if (is_empty()) {
        left_alone_.clear();
        return;
    }
    blocks_.make_boxes();
    is_near_.resize(blocks_.size(), 0);
    std::ranges::sort(left_alone_, is_before);
    make_room();
    // Those that touch from the start.
    Workers alone(1);
    touching_ = paths.least_gap;
    paths.begin_attempt();
    search(start, start, alone);
    touching_ = 0.0;
    for (Own& own : own_) {
        own.pairs.make_room_for_more();
    }
}

/// For what usual states need; more allocates.
void SurfacePairs::make_room() {
    const std::size_t count = meets_.size();
    const std::size_t meetings = std::min(count * (count - 1) / 2, kMeetingsPerSurface * count);
    const std::size_t pairs = std::min(kPairsPerMeeting, kPairsOfAll / std::max<std::size_t>(1, meetings));
    near_.reserve(meetings);
    meetings_.reserve(meetings);
    overlapping_.resize(meetings);
    for (std::vector<BlockPair>& of_meeting : overlapping_) {
        of_meeting.reserve(pairs);
    }
    block_pairs_.reserve(meetings * pairs);
    apart_.reserve(meetings * pairs);
    near_blocks_.reserve(blocks_.size());
    for (auto& of : retained_) {
        of.reserve(kPairsInList);
    }
    parts_.resize(own_.size() + (meets_.empty() ? 0 : kPartsWithRoom));
    const std::size_t in_own = kPairsInOwn / std::max(kParts, own_.size());
    for (std::size_t k = 0; k < parts_.size(); ++k) {
        parts_[k].make_room(k < own_.size() ? in_own : kPairsInList);
    }
    for (std::size_t k = 0; k < own_.size(); ++k) {
        own_[k].make_room(paths_.surfaces[own_[k].surface].vertices, in_own);
    }
}

/// For so many vertices, and so many pairs of features in a list.
void SurfacePairs::Own::make_room(std::size_t vertices, std::size_t in_list) {
    moved.reserve(vertices);
    for (std::size_t list = 0; list < 2; ++list) {
        retained[list].reserve(in_list);
        due[list].make_room(in_list);
    }
}

/// For so many pairs of features in a list, and for all that are looked at together.
void SurfacePairs::Part::make_room(std::size_t in_list) {
    for (ListedPairs& list : pairs) {
        list.make_room(in_list);
    }
    is_dropped.reserve(in_list);
    in_doubt.reserve(kPairsInList);
    for (PairCandidates& of : comparison.candidates) {
        of.make_room(kPairsInList);
    }
}

bool SurfacePairs::keeps_apart(std::uint32_t one, std::uint32_t other) const noexcept {
    const SolidSurface& first = paths_.surfaces[one];
    const SolidSurface& second = paths_.surfaces[other];
    return first.meets_others && second.meets_others && (first.movable || second.movable) &&
           !std::ranges::binary_search(left_alone_, ordered(one, other), is_before);
}

void SurfacePairs::begin_step() noexcept {
    for (Own& own : own_) {
        if (own.motion_is_taken) {
            own.pairs.advance();
        }
    }
}

void SurfacePairs::jump(std::uint32_t surface) {
    Own& own = own_[own_of_[surface]];
    if (std::exchange(own.motion_is_taken, false)) {
        own.pairs.advance();
    }
    own.pairs.take_motion(own.blocks, paths_.start.data(), paths_.end.data(), own_apart_);
    own.pairs.advance();
}

void SurfacePairs::search(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    for (Own& own : own_) {
        own.motion_is_taken = own.is_given_up = false;
    }
    search_own_first(start, end, workers);
    std::ranges::fill(is_due_, std::uint8_t{1});
    search_meetings(start, end, workers);
}

bool SurfacePairs::search_again(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    const bool own_have_moved = search_own_moved(workers);
    const bool others_have_moved = have_left_reach();
    if (others_have_moved) {
        find_due();
        search_meetings(start, end, workers);
    }
    return own_have_moved || others_have_moved;
}

bool SurfacePairs::knows_all() const noexcept {
    return std::ranges::none_of(own_, [](const Own& own) { return own.is_given_up; });
}

/// How far ends are out of the boxes of the paths that were asked for, at most, m.
double SurfacePairs::farthest_stray() const noexcept {
    Vec3 farthest(0.0);
    for (const std::uint32_t v : paths_.moved) {
        const Vec3 start = vector_of(paths_.start[v]);
        const Vec3 asked = vector_of(paths_.asked[v]);
        const Vec3 end = vector_of(paths_.end[v]);
        farthest = glm::max(farthest, glm::max(glm::min(start, asked) - end, end - glm::max(start, asked)));
    }
    return std::max({farthest.x, farthest.y, farthest.z});
}

/// Surfaces that are kept apart and may meet: their boxes over the step, one grown by a margin, overlap.
void SurfacePairs::find_meetings(double margin) {
    farthest_ = 0.0;
    for (std::size_t m = 0; m < meets_.size(); ++m) {
        const Aabb box = grown(paths_.surfaces[meets_[m]].tree->bounds(), 0.5 * margin);
        bounds_[m] = bounds_of(box);
        for (int k = 0; k < 3; ++k) {
            farthest_ = std::max({farthest_, -box.min[k], box.max[k]});
        }
    }
    sweep_.find(bounds_, near_);
    for (BodyPair& pair : near_) {
        pair = {meets_[pair.first], meets_[pair.second]};
    }
    // Those that no longer overlap have parted.
    std::erase_if(left_alone_, [&](const BodyPair& p) { return !std::ranges::binary_search(near_, p, is_before); });
    meetings_.clear();
    for (const BodyPair& pair : near_) {
        // Two that sleep stay apart.
        if (keeps_apart(pair.first, pair.second) && (paths_.yields[pair.first] | paths_.yields[pair.second]) != 0) {
            meetings_.push_back(pair);
        }
    }
    overlapping_.resize(std::max(overlapping_.size(), meetings_.size()));
}

/// The vertices that rounds have moved since pairs of two surfaces were searched.
void SurfacePairs::find_due() noexcept {
    std::ranges::fill(is_due_, std::uint8_t{0});
    for (const std::uint32_t v : paths_.moved) {
        is_due_[v] = vector_of(paths_.searched[v]) != vector_of(paths_.end[v]) ? 1 : 0;
    }
}

/// Finds the pairs of features of two surfaces that have vertices that are due, and may come too near while vertices
/// end within their reach. All others stay listed.
void SurfacePairs::search_meetings(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    const double apart = paths_.least_gap + 2.0 * reach_;
    // Both sides may end beyond the boxes of their trees.
    const double margin = apart + 2.0 * farthest_stray();
    find_meetings(margin);
    for (const auto& [first, second] : meetings_) {
        paths_.take_part(first, start, end);
        paths_.take_part(second, start, end);
    }
    drop_due();
    find_block_pairs(margin, workers);
    drop_blocks_apart(apart, workers);
    for (const std::uint32_t v : paths_.moved) {
        paths_.searched[v] = paths_.end[v];
    }
    find_pairs_of_two(apart, workers);
    leave_touching_alone();
}

/// Drops the pairs of a part for which is_due(list, index) holds, but those of one patch, which keep their planes: adds
/// these to the retained ones.
template <class IsDue>
void SurfacePairs::drop(Part& part, RetainedPairs& retained, const IsDue& is_due) const {
    for (std::size_t list = 0; list < 2; ++list) {
        ListedPairs& pairs = part.pairs[list];
        part.is_dropped.resize(pairs.size());
        for (std::size_t k = 0; k < pairs.size(); ++k) {
            const bool due = is_due(pairs, k);
            const bool is_retained = due && paths_.is_of_one_patch(pairs.vertices(k));
            if (is_retained) {
                retained[list].push_back(pairs.vertices(k));
            }
            part.is_dropped[k] = due && !is_retained ? 1 : 0;
        }
        pairs.leave_out([&](std::size_t k) { return part.is_dropped[k] != 0; });
    }
}

/// Drops the pairs of two surfaces that have vertices that are due.
void SurfacePairs::drop_due() {
    for (auto& of : retained_) {
        of.clear();
    }
    for (Part& part : std::span(parts_).subspan(own_.size())) {
        part.touching.clear();
        drop(part, retained_, [&](const ListedPairs& pairs, std::size_t k) { return some_are_due(pairs.vertices(k)); });
    }
    for (auto& of : retained_) {
        std::ranges::sort(of);
    }
}

bool SurfacePairs::some_are_due(std::span<const std::uint32_t> vertices) const noexcept {
    return std::ranges::any_of(vertices, [&](std::uint32_t v) { return is_due_[v] != 0; });
}

/// Finds the leaves of trees whose boxes overlap, with vertices that are due.
void SurfacePairs::find_block_pairs(double margin, Workers& workers) {
    workers.for_each(meetings_.size(), [&](std::size_t m) {
        overlapping_[m].clear();
        if (!paths_.move_alike(meetings_[m].first, meetings_[m].second)) {
            find_blocks(meetings_[m], margin, overlapping_[m]);
        }
    });
    block_pairs_.clear();
    for (std::size_t m = 0; m < meetings_.size(); ++m) {
        std::ranges::copy_if(overlapping_[m], std::back_inserter(block_pairs_), [&](const BlockPair& pair) {
            return some_are_due(blocks_.corners_of(pair.first)) || some_are_due(blocks_.corners_of(pair.second));
        });
    }
}

/// Drops the pairs of blocks that are apart as a whole, which most of them are.
void SurfacePairs::drop_blocks_apart(double apart, Workers& workers) {
    list_near_blocks();
    workers.for_ranges(range_of(near_blocks_), kPlacedAtOnce, [&](std::size_t from, std::size_t to) {
        for (std::size_t k = from; k < to; ++k) {
            blocks_.place(near_blocks_[k], [&](std::uint32_t v) {
                return std::pair(vector_of(paths_.start[v]), vector_of(paths_.end[v]));
            });
        }
    });
    const double rounded_apart = apart + FeatureBlocks::rounding_of_places(farthest_);
    apart_.resize(block_pairs_.size());
    workers.for_ranges(range_of(block_pairs_), kTestedAtOnce, [&](std::size_t from, std::size_t to) {
        for (std::size_t k = from; k < to; ++k) {
            apart_[k] = blocks_.are_apart(block_pairs_[k].first, block_pairs_[k].second, rounded_apart) ? 1 : 0;
        }
    });
    std::size_t left = 0;
    for (std::size_t k = 0; k < block_pairs_.size(); ++k) {
        block_pairs_[left] = block_pairs_[k];
        left += apart_[k] == 0 ? 1U : 0U;
    }
    block_pairs_.resize(left);
}

/// Finds the pairs of features of the blocks that are left, in parts.
void SurfacePairs::find_pairs_of_two(double apart, Workers& workers) {
    list_near_blocks();
    workers.for_ranges(range_of(near_blocks_), kFittedAtOnce, [&](std::size_t from, std::size_t to) {
        for (std::size_t k = from; k < to; ++k) {
            blocks_.fit(near_blocks_[k], [&](std::uint32_t v) {
                const Vec3 at = vector_of(paths_.start[v]);
                return VertexPath{.start = at, .way = vector_of(paths_.end[v]) - at, .margin = Vec3(0.5 * apart)};
            });
        }
    });
    const std::size_t count = block_pairs_.size();
    const std::size_t in_part = std::clamp((count + kParts - 1) / kParts, kMinPairsInPart, kMaxPairsInPart);
    parts_.resize(std::max(parts_.size(), own_.size() + (count + in_part - 1) / in_part));
    workers.for_ranges(range_of(block_pairs_), in_part, [&](std::size_t from, std::size_t to) {
        find_pairs(parts_[own_.size() + from / in_part], std::span(block_pairs_).subspan(from, to - from));
    });
}

/// Nothing tells the sides of features apart that touch.
void SurfacePairs::leave_touching_alone() {
    for (const Part& part : std::span(parts_).subspan(own_.size())) {
        for (const BodyPair& pair : part.touching) {
            if (const auto at = std::ranges::lower_bound(left_alone_, pair, is_before);
                at == left_alone_.end() || is_before(pair, *at)) {
                left_alone_.insert(at, pair);
            }
        }
    }
}

/// Finds the pairs of features of surfaces that meet themselves that would come too near on the paths that are asked.
void SurfacePairs::search_own_first(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    workers.for_each(own_.size(), [&](std::size_t k) {
        Own& own = own_[k];
        for (std::size_t list = 0; list < 2; ++list) {
            parts_[k].pairs[list].forget_all();
            own.retained[list].clear();
        }
        if (!rests(own)) {
            paths_.take_part(own.surface, start, end);
            take_motion(own);
            // What is carried keeps all its distances; its motion is followed all the same.
            if (!paths_.move_alike(own.surface, own.surface)) {
                list_own(own, parts_[k]);
                find_own(own, parts_[k]);
            }
        }
    });
}

/// The same on the paths to which rounds have led vertices by now. False: they have moved none since the last search.
bool SurfacePairs::search_own_moved(Workers& workers) {
    collect_moved();
    if (std::ranges::all_of(own_, [](const Own& own) { return own.moved.empty(); })) {
        return false;
    }
    workers.for_each(own_.size(), [&](std::size_t k) {
        Own& own = own_[k];
        if (own.moved.empty()) {
            return;
        }
        take_motion(own);
        drop_new(own, parts_[k]);
        list_own(own, parts_[k]);
        find_own(own, parts_[k]);
    });
    return true;
}

/// What rests keeps all its distances, until rounds move some of it.
bool SurfacePairs::rests(const Own& own) const noexcept {
    const Aabb& moved = paths_.surfaces[own.surface].tree->displacement();
    return !(touching_ > 0.0) && moved.min == moved.max && moved.max == Vec3(0.0);
}

/// Collects the vertices of each surface that rounds have moved since its pairs were searched.
void SurfacePairs::collect_moved() {
    for (Own& own : own_) {
        own.moved.clear();
    }
    for (const std::uint32_t v : paths_.moved) {
        const std::uint32_t own = own_of_[paths_.surface_of[v]];
        if (own != kNotOwn && vector_of(paths_.own_searched[v]) != vector_of(paths_.end[v])) {
            paths_.own_searched[v] = paths_.end[v];
            own_[own].moved.push_back(v);
        }
    }
}

/// Takes the motion of a surface for the first time in the attempt, or later of what rounds have moved.
void SurfacePairs::take_motion(Own& own) {
    if (!std::exchange(own.motion_is_taken, true)) {
        own.pairs.take_motion(own.blocks, paths_.start.data(), paths_.end.data(), own_apart_);
    } else {
        own.pairs.take_motion_of(own.moved, own.blocks, paths_.end.data(), own_apart_);
    }
}

/// Drops the pairs of blocks that move in another way now.
void SurfacePairs::drop_new(Own& own, Part& part) const {
    for (auto& of : own.retained) {
        of.clear();
    }
    drop(part, own.retained,
         [&](const ListedPairs& pairs, std::size_t k) { return own.pairs.is_new(pairs.origin[k]); });
    for (auto& of : own.retained) {
        std::ranges::sort(of);
    }
}

/// Finds the pairs of a surface that are due, and lists the features of surroundings where that is.
void SurfacePairs::list_own(Own& own, Part& part) {
    own.pairs.find(own_apart_, own.due);
    const Vec3 margin(0.5 * own.pairs.reach());
    for (const std::uint32_t block : own.pairs.to_list()) {
        own.pairs.begin_list(block, own.blocks);
        const auto list = [&](PairKind kind, const PairCandidates::Vertices& vertices) {
            DoubtfulPairs& of = part.in_doubt;
            of.pairs.assign(kind, vertices);
            of.nearest.resize(of.pairs.size());
            kernels_.find_nearest(kind, of.pairs.rows(of.pairs.gap), of.pairs.size(), paths_.start.data(),
                                  of.nearest.rows());
            for (std::size_t k = 0; k < of.pairs.size(); ++k) {
                if (const PairVertices vertex = of.pairs.vertices(k); !are_left_alone(vertex)) {
                    own.pairs.list(kind, vertex, of.nearest.distance[k]);
                }
            }
        };
        if (own.pairs.is_complete(block)) {
            own.pairs.take_listed(block, part.comparison.candidates);
            part.comparison.hand_over(1, list);
        } else {
            const auto path_of = [&](std::uint32_t v) {
                return VertexPath{.start = vector_of(paths_.start[v]), .way = Vec3(0.0), .margin = margin};
            };
            compare_own(own, part, block, path_of, list);
        }
        own.pairs.end_list(block, own.blocks, own_apart_, own.due);
    }
    std::ranges::fill(own.is_fitted, std::uint8_t{0});
}

/// Keeps those of a surface's own pairs that are not proved to stay apart on the paths that are known.
void SurfacePairs::find_own(Own& own, Part& part) {
    own.from_afar = 0;
    for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
        const OwnPairs::Due& due = own.due[list_of(kind)];
        for (std::size_t from = 0; from < due.block.size() && !own.is_given_up; from += kProvedTogether) {
            const std::size_t count = std::min(kProvedTogether, due.block.size() - from);
            PairCandidates::Vertices some = due.pairs.vertices();
            for (std::span<const std::uint32_t>& of : some) {
                of = of.subspan(from, count);
            }
            keep_own(own, part, kind, some, [&](std::size_t k) { return due.block[from + k]; });
        }
    }
    // Of fast surroundings all features that may meet.
    const auto path_of = [&](std::uint32_t v) {
        const Vec3 at = vector_of(paths_.start[v]);
        return VertexPath{.start = at, .way = vector_of(paths_.end[v]) - at, .margin = Vec3(0.5 * own_apart_)};
    };
    for (const std::uint32_t block : own.pairs.to_compare()) {
        if (own.is_given_up) {
            break;
        }
        compare_own(own, part, block, path_of, [&](PairKind kind, const PairCandidates::Vertices& vertices) {
            keep_own(own, part, kind, vertices, [&](std::size_t) { return block; });
        });
    }
    std::ranges::fill(own.is_fitted, std::uint8_t{0});
}

/// Compares the features of a block with those of its surroundings, in boxes around path_of(vertex), a VertexPath.
/// Calls take(kind, vertices) with the pairs that may meet, many at a time.
template <class PathOf, class Take>
void SurfacePairs::compare_own(Own& own, Part& part, std::uint32_t block, const PathOf& path_of, const Take& take) {
    for (const std::uint32_t near : own.pairs.near(block)) {
        if (std::exchange(own.is_fitted[near], std::uint8_t{1}) == 0) {
            own.blocks.fit(near, path_of);
        }
        own.blocks.compare(block, near, part.comparison);
        part.comparison.hand_over(kProvedTogether, take);
    }
    part.comparison.hand_over(1, take);
}

/// keep_near() of pairs of one surface, of the surroundings of block_of(k). Those that touch are left alone.
template <class BlockOf>
void SurfacePairs::keep_own(Own& own, Part& part, PairKind kind, const PairCandidates::Vertices& vertices,
                            const BlockOf& block_of) {
    const FeaturePairs& doubtful = part.in_doubt.pairs;
    const std::vector<PairVertices>& retained = own.retained[list_of(kind)];
    FeaturePairs& list = part.pairs[list_of(kind)];
    const double afar = kAfarInEdges * own.edge;
    const auto is_left_out = [&](std::size_t k) {
        const PairVertices vertex = doubtful.vertices(k);
        if (!(part.in_doubt.nearest.distance[k] > touching_)) {
            for (const std::uint32_t v : vertex) {
                leaves_alone_[v] = 1;
            }
        }
        return are_left_alone(vertex) || std::ranges::binary_search(retained, vertex);
    };
    keep_near(part, kind, vertices, own_apart_, is_left_out, [&](std::size_t k) {
        list.origin.back() = block_of(doubtful.origin[k]);
        own.from_afar += part.in_doubt.nearest.distance[k] > afar ? 1U : 0U;
    });
    own.is_given_up = own.from_afar > kMostFromAfar;
}

bool SurfacePairs::are_left_alone(const PairVertices& vertex) const noexcept {
    return (leaves_alone_[vertex[0]] & leaves_alone_[vertex[1]] & leaves_alone_[vertex[2]] &
            leaves_alone_[vertex[3]]) != 0;
}

/// Those that are in a pair, each once, in order: a thread that takes some of them has just moved their surface.
void SurfacePairs::list_near_blocks() {
    for (const BlockPair& pair : block_pairs_) {
        is_near_[pair.first] = is_near_[pair.second] = 1;
    }
    near_blocks_.clear();
    for (std::uint32_t block = 0; block < is_near_.size(); ++block) {
        if (std::exchange(is_near_[block], std::uint8_t{0}) != 0) {
            near_blocks_.push_back(block);
        }
    }
}

/// Blocks of two surfaces whose boxes, one of them grown by a margin, overlap.
void SurfacePairs::find_blocks(const BodyPair& surfaces, double margin, std::vector<BlockPair>& overlapping) const {
    const auto [first, second] = surfaces;
    paths_.surfaces[first].tree->query_pairs(
        *paths_.surfaces[second].tree, margin, [&](std::uint32_t one, std::uint32_t other) {
            overlapping.push_back({first_block_[first] + one, first_block_[second] + other});
        });
}

/// Adds those of blocks of two surfaces.
void SurfacePairs::find_pairs(Part& part, std::span<const BlockPair> blocks) const {
    const auto prove = [&](PairKind kind, const PairCandidates::Vertices& vertices) {
        const FeaturePairs& doubtful = part.in_doubt.pairs;
        keep_near(
            part, kind, vertices, paths_.least_gap + 2.0 * reach_,
            [&](std::size_t k) {
                // All others are listed.
                const PairVertices vertex = doubtful.vertices(k);
                if (!some_are_due(vertex) || std::ranges::binary_search(retained_[list_of(kind)], vertex)) {
                    return true;
                }
                // Nothing tells the sides apart of what touches.
                const bool touches = !(part.in_doubt.nearest.distance[k] > touching_);
                if (touches) {
                    part.touching.push_back(ordered(paths_.surface_of[vertex[0]], paths_.surface_of[vertex[3]]));
                }
                return touches;
            },
            [](std::size_t) {});
    };
    for (const BlockPair& pair : blocks) {
        blocks_.compare(pair.first, pair.second, part.comparison);
        part.comparison.hand_over(kProvedTogether, prove);
    }
    part.comparison.hand_over(1, prove);
}

/// Keeps those of the pairs that are not proved to stay `apart`, m, on the paths that are known, but those for which
/// is_left_out(k) holds, and calls kept(k) when one has been kept. k: in `part.in_doubt.pairs`.
template <class IsLeftOut, class Kept>
void SurfacePairs::keep_near(Part& part, PairKind kind, const PairCandidates::Vertices& vertex, double apart,
                             const IsLeftOut& is_left_out, const Kept& kept) const {
    const auto may_close = [&](const FeaturePairs& pairs, std::size_t k) {
        return !(pairs.gap[k] > 0.0 && pairs.end_gap[k] >= apart);
    };
    part.in_doubt.find(kernels_, kind, vertex, paths_.start.data(), paths_.end.data(), may_close);
    const FeaturePairs& doubtful = part.in_doubt.pairs;
    ListedPairs& list = part.pairs[list_of(kind)];
    for (std::size_t k = 0; k < doubtful.size(); ++k) {
        if (may_close(doubtful, k) && !is_left_out(k)) {
            list.add(doubtful, k);
            kept(k);
        }
    }
}

/// Whether a vertex ends farther from where pairs of two surfaces were searched than its reach.
bool SurfacePairs::have_left_reach() const noexcept {
    return std::ranges::any_of(paths_.moved, [&](std::uint32_t v) {
        const Vec3 off = vector_of(paths_.end[v]) - vector_of(paths_.searched[v]);
        return !(glm::dot(off, off) <= reach_ * reach_);
    });
}

}  // namespace haptic::sim
