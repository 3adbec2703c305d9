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
constexpr double kOwnApartOfEdge = 1.0 / 64.0;  // pairs of one surface that rounds may bring too near
// Of the same edge: a lag that only bodies have that passed through one another.
constexpr double kTornOfEdge = 6.0;
constexpr double kWayIfTornOfEdge = 1.0;  // that a vertex then goes in a step at most
// A surface that had to stand still is asked for less of its way, then for more again in each step.
constexpr double kLeastEase = 1.0 / 64.0;
constexpr double kEasesBy = 1.25;
// Unsafe pairs are pushed to this many least gaps.
constexpr double kPushedGaps = 2.0;
// The least gap counts as kept down to this share below it: more than rounding takes.
constexpr double kRoundingOfGap = 1e-6;
// Rounds: pairs that are unsafe are pushed apart, then bound; after the last their surfaces stand still.
constexpr int kPushes = 6;
constexpr int kBindings = 12;
// Searches of an attempt after its first: rounds have moved vertices.
constexpr int kMaxSearches = 12;
// Attempts after which all surfaces that are near one that stands still do so too.
constexpr int kAttempts = 3;
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
// A block for each leaf.
static_assert(SweptTree::kMaxInLeaf <= FeatureBlocks::kMaxInBlock);
constexpr std::size_t kMany = std::numeric_limits<std::size_t>::max();  // more than any number of pairs
constexpr std::uint32_t kFree = 0xffff'ffff;

/// m, of the triangles of a surface.
double mean_edge(const SolidSurface& surface, std::span<const Vec3> vertices) {
    double sum = 0.0;
    for (const Triangle& t : surface.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            sum += glm::length(vertices[surface.first_vertex + t[k]] - vertices[surface.first_vertex + t[(k + 1) % 3]]);
        }
    }
    return sum / (3.0 * static_cast<double>(surface.triangles.size()));
}

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

bool is_before(const BodyPair& a, const BodyPair& b) noexcept {
    return std::pair(a.first, a.second) < std::pair(b.first, b.second);
}

}  // namespace

SolidSurfaces::SolidSurfaces(std::vector<SolidSurface> surfaces, std::span<const Vec3> start,
                             SurfacesAtStart left_alone, double catch_up_speed, std::size_t lanes)
    : surfaces_(std::move(surfaces)),
      surface_of_(start.size(), 0),
      blocks_(collider_kernels(lanes)),
      kernels_(*find_kernels(&Kernels::features, lanes)),
      catch_up_speed_(catch_up_speed),
      left_alone_(std::move(left_alone.crossing)),
      meets_(that_meet(surfaces_)),
      sweep_(meets_.size()),
      bounds_(meets_.size(), Bounds{}),
      yields_(surfaces_.size(), 0),
      stands_(surfaces_.size(), 0),
      changes_(surfaces_.size(), 0),
      most_lag_(surfaces_.size(), 0.0),
      ease_(surfaces_.size(), 1.0),
      lag_(start.size(), Vec3(0.0)),
      leaves_alone_(start.size(), 0),
      takes_part_(surfaces_.size(), 0),
      is_moved_(start.size(), 0),
      moved_in_(start.size(), 0) {
    for (std::uint32_t s = 0; s < surfaces_.size(); ++s) {
        const SolidSurface& surface = surfaces_[s];
        std::fill_n(surface_of_.begin() + static_cast<std::ptrdiff_t>(surface.first_vertex), surface.vertices, s);
        yields_[s] = surface.movable ? 1 : 0;
    }
    for (const std::uint32_t v : left_alone.vertices) {
        leaves_alone_[v] = 1;
    }
    const auto meets_itself = [](const SolidSurface& of) { return of.meets_itself && !of.triangles.empty(); };
    if (meets_.empty() && std::ranges::none_of(surfaces_, meets_itself)) {
        left_alone_.clear();
        return;
    }
    for (std::vector<Row>* of_vertices : {&start_, &asked_, &end_, &searched_, &own_searched_}) {
        of_vertices->resize(start.size());
    }
    parent_.resize(start.size(), kFree);
    part_.resize(start.size());
    patch_.resize(start.size());
    led_.resize(start.size());
    led_sum_.resize(start.size());
    first_block_.resize(surfaces_.size(), 0);
    own_of_.resize(surfaces_.size(), kFree);
    double finest = std::numeric_limits<double>::max();
    for (std::uint32_t s = 0; s < surfaces_.size(); ++s) {
        const SolidSurface& surface = surfaces_[s];
        if (!meets_itself(surface) && !std::ranges::binary_search(meets_, s)) {
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
        const double edge = mean_edge(surface, start);
        some_are_exact_ = some_are_exact_ || surface.exact;
        finest = surface.exact ? finest : std::min(finest, edge);
        if (meets_itself(surface)) {
            own_of_[s] = static_cast<std::uint32_t>(own_.size());
            FeatureBlocks own(collider_kernels(lanes));
            own.add_surface(triangles, merged(in_block));
            own.make_boxes();
            own_.emplace_back(s, std::move(own), *find_kernels(&Kernels::deformation, lanes), edge);
        }
    }
    blocks_.make_boxes();
    is_near_.resize(blocks_.size(), 0);
    least_gap_ = kLeastGapOfEdge * finest;
    reach_ = kReachOfEdge * finest;
    own_apart_ = least_gap_ + kOwnApartOfEdge * finest;
    torn_ = kTornOfEdge * finest;
    way_if_torn_ = kWayIfTornOfEdge * finest;
    std::ranges::sort(left_alone_, is_before);
    make_room();
    // Those that touch from the start.
    std::vector<Vec3> end(start.begin(), start.end());
    Workers alone(1);
    touching_ = least_gap_;
    begin_attempt();
    search_own_first(start, end, alone);
    search(start, end, alone);
    touching_ = 0.0;
    end_step(start, end, alone);
    for (Own& own : own_) {
        own.pairs.make_room_for_more();
    }
}

/// For what usual states need; more allocates.
void SolidSurfaces::make_room() {
    const std::size_t count = meets_.size();
    const std::size_t meetings = std::min(count * (count - 1) / 2, kMeetingsPerSurface * count);
    const std::size_t pairs = std::min(kPairsPerMeeting, kPairsOfAll / std::max<std::size_t>(1, meetings));
    near_.reserve(meetings);
    meeting_.resize(meetings);
    for (Meeting& meeting : meeting_) {
        meeting.blocks.reserve(pairs);
    }
    block_pairs_.reserve(meetings * pairs);
    apart_.reserve(meetings * pairs);
    near_blocks_.reserve(blocks_.size());
    moved_.reserve(surface_of_.size());
    bound_.reserve(surface_of_.size());
    parts_.resize(own_.size() + (meets_.empty() ? 0 : kPartsWithRoom));
    const std::size_t in_own = kPairsInOwn / std::max(kParts, own_.size());
    for (std::size_t k = 0; k < parts_.size(); ++k) {
        parts_[k].make_room(k < own_.size() ? std::min(kPairsInList, in_own) : kPairsInList);
    }
    for (std::size_t k = 0; k < own_.size(); ++k) {
        own_[k].make_room(surfaces_[own_[k].surface].vertices, in_own);
        for (ListedPairs& list : parts_[k].pairs) {
            list.make_room(in_own);
        }
    }
    unsafe_.reserve(4 * kPairsInList);
}

/// For so many vertices, and so many pairs of features in a list.
void SolidSurfaces::Own::make_room(std::size_t vertices, std::size_t in_list) {
    moved.reserve(vertices);
    for (std::size_t list = 0; list < 2; ++list) {
        retained[list].reserve(in_list);
        is_dropped.reserve(in_list);
        due[list].make_room(in_list);
    }
}

void SolidSurfaces::ListedPairs::make_room(std::size_t size) {
    reserve(size);
    known.reserve(size);
}

void SolidSurfaces::ListedPairs::forget_all() noexcept {
    clear();
    known.clear();
}

void SolidSurfaces::ListedPairs::add(const FeaturePairs& from, std::size_t at) {
    append(from, at);
    end_gap.push_back(from.end_gap[at]);
    known.emplace_back();
}

template <class IsDropped>
void SolidSurfaces::ListedPairs::leave_out(const IsDropped& is_dropped) {
    drop(is_dropped);
    keep_others(known, is_dropped);
}

const NearestPoints& SolidSurfaces::ListedPairs::nearest_at_start(std::size_t at, const Row* start) noexcept {
    NearestPoints& first = known[at].first;
    if (first.distance < 0.0) {
        first = nearest_points(kind, positions(at, start));
    }
    return first;
}

void SolidSurfaces::Part::make_room(std::size_t in_list) {
    for (ListedPairs& list : pairs) {
        list.make_room(in_list);
    }
    in_doubt.reserve(in_list);
    for (PairCandidates& of : comparison.candidates) {
        of.make_room(in_list);
    }
}

bool SolidSurfaces::keeps_apart(std::uint32_t one, std::uint32_t other) const noexcept {
    const SolidSurface& first = surfaces_[one];
    const SolidSurface& second = surfaces_[other];
    return first.meets_others && second.meets_others && (first.movable || second.movable) &&
           !std::ranges::binary_search(left_alone_, ordered(one, other), is_before);
}

bool SolidSurfaces::may_hold_back() const noexcept {
    return !meets_.empty() || !own_.empty() || std::ranges::any_of(most_lag_, [](double lag) { return lag > 0.0; });
}

void SolidSurfaces::ask(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end, double step) noexcept {
    const SolidSurface& of = surfaces_[surface];
    const auto each_vertex = [&](const auto& visit) {
        for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
            visit(v);
        }
    };
    const auto go_to = [&](std::size_t v, const Vec3& place) {
        const Vec3 skin = end[v];
        end[v] = place;
        end[v].y = std::max(end[v].y, of.floor);
        lag_[v] = skin - end[v];
    };
    if (most_lag_[surface] > torn_) {
        // What is elsewhere than its skin cannot share the skin's motion, but the mean of it: it goes straight there.
        Vec3 mean(0.0);
        each_vertex([&](std::size_t v) { mean += (end[v] - (start[v] + lag_[v])) / static_cast<double>(of.vertices); });
        double part = 1.0;
        each_vertex([&](std::size_t v) {
            part = std::min(part, ease_[surface] * way_if_torn_ / glm::length(end[v] - (start[v] + mean)));
        });
        each_vertex([&](std::size_t v) {
            const Vec3 shared = start[v] + mean;
            go_to(v, shared + part * (end[v] - shared));
        });
    } else if (lags(surface)) {
        const double catch_up = step * catch_up_speed_;
        each_vertex([&](std::size_t v) {
            if (const double length = glm::length(lag_[v]); length > catch_up) {
                go_to(v, end[v] - (1.0 - catch_up / length) * lag_[v]);
            } else {
                lag_[v] = Vec3(0.0);
            }
        });
    }
    ease_[surface] = std::min(1.0, kEasesBy * ease_[surface]);
}

void SolidSurfaces::let_sleep(std::span<const std::uint8_t> asleep) noexcept {
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
        yields_[s] = surfaces_[s].movable && asleep[s] == 0 ? 1 : 0;
    }
}

void SolidSurfaces::keep_apart(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    std::ranges::fill(stands_, std::uint8_t{0});
    for (Own& own : own_) {
        if (own.motion_is_taken) {
            own.pairs.advance();
        }
    }
    follow(start, end, workers);
}

void SolidSurfaces::forget_lag(std::size_t surface) noexcept {
    const SolidSurface& of = surfaces_[surface];
    std::fill_n(lag_.begin() + static_cast<std::ptrdiff_t>(of.first_vertex), of.vertices, Vec3(0.0));
    most_lag_[surface] = 0.0;
}

void SolidSurfaces::let_stand(std::span<const std::uint8_t> stands, std::span<const Vec3> start, std::span<Vec3> end,
                              Workers& workers) {
    std::ranges::copy(stands, stands_.begin());
    follow(start, end, workers);
}

/// Lets all surfaces but those that stand still follow their skins as far as they can.
void SolidSurfaces::follow(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    for (int attempt = 1; !make_safe(start, end, workers); ++attempt) {
        // The surfaces that are left stand still, and everything is tried again.
        ++counts_.stood;
        bool some_meet = false;
        for (const Unsafe& u : unsafe_) {
            some_meet = some_meet || u.part >= own_.size();
            for (const std::uint32_t v : parts_[u.part].pairs[u.list].vertices(u.pair)) {
                const std::uint32_t surface = surface_of_[v];
                if (std::exchange(stands_[surface], std::uint8_t{1}) == 0) {
                    ease_[surface] = std::max(kLeastEase, 0.5 * ease_[surface]);
                }
            }
        }
        if (attempt >= kAttempts || (some_meet && some_are_torn())) {
            let_heap_stand();
        }
    }
    end_step(start, end, workers);
}

/// Forgets what rounds have done.
void SolidSurfaces::begin_attempt() noexcept {
    std::ranges::fill(takes_part_, std::uint8_t{0});
    for (const std::uint32_t v : moved_) {
        is_moved_[v] = 0;
    }
    moved_.clear();
    for (const std::uint32_t v : bound_) {
        parent_[v] = kFree;
    }
    bound_.clear();
    search_is_due_ = true;
    for (Own& own : own_) {
        own.motion_is_taken = false;
    }
}

/// Takes the ways that are asked of a surface, unless it has them. Different surfaces on any thread.
void SolidSurfaces::take_part(std::uint32_t surface, std::span<const Vec3> start, std::span<const Vec3> end) noexcept {
    if (std::exchange(takes_part_[surface], std::uint8_t{1}) != 0) {
        return;
    }
    const SolidSurface& of = surfaces_[surface];
    const std::span<const Vec3>& to = stands_[surface] != 0 ? start : end;
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        start_[v] = row_of(start[v]);
        end_[v] = row_of(to[v]);
    }
}

/// Is called before rounds move a vertex.
void SolidSurfaces::note_move(std::uint32_t vertex) {
    if (std::exchange(is_moved_[vertex], std::uint8_t{1}) == 0) {
        moved_.push_back(vertex);
        asked_[vertex] = searched_[vertex] = own_searched_[vertex] = end_[vertex];
    }
}

/// The only way in which rounds move a vertex: proofs in which it has a part do not hold any more.
void SolidSurfaces::move_end(std::uint32_t vertex, const Vec3& end) noexcept {
    if (vector_of(end_[vertex]) != end) {
        set_vector(end_[vertex], end);
        moved_in_[vertex] = round_;
    }
}

/// Whether bodies have passed through one another, so that a surface that may meet others is stretched between them.
/// Pushes will not help it.
bool SolidSurfaces::some_are_torn() const noexcept {
    return std::any_of(
        meeting_.begin(), meeting_.begin() + static_cast<std::ptrdiff_t>(meetings_),
        [&](const Meeting& m) { return most_lag_[m.surfaces.first] > torn_ || most_lag_[m.surfaces.second] > torn_; });
}

/// What is near a surface that stands still stands still too.
void SolidSurfaces::let_heap_stand() noexcept {
    for (bool grows = true; grows;) {
        grows = false;
        for (std::size_t m = 0; m < meetings_; ++m) {
            const auto [first, second] = meeting_[m].surfaces;
            grows = grows || stands_[first] != stands_[second];
            stands_[first] = stands_[second] = stands_[first] | stands_[second];
        }
    }
}

/// Moves ends until nothing crosses on the way to them. False: pairs are left, those of the last round.
bool SolidSurfaces::make_safe(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    begin_attempt();
    search_own_first(start, end, workers);
    search(start, end, workers);
    int round = some_are_torn() ? kPushes : 0;
    std::size_t unsafe_before = kMany;
    bool is_first = true;
    for (int searches = 0;;) {
        if (!find_unsafe()) {
            // Pairs are known where vertices have ended since they were searched.
            const bool were_searched = search_own_moved(workers);
            search_is_due_ = have_left_reach();
            if (!were_searched && !search_is_due_) {
                return true;
            }
            search(start, end, workers);
            if (++searches == kMaxSearches) {
                // The planes of these pairs are not known yet.
                return !find_unsafe(false);
            }
            move_bound();
            unsafe_before = kMany;
            continue;
        }
        counts_.unsafe += std::exchange(is_first, false) ? unsafe_.size() : 0;
        if (round == kPushes + kBindings) {
            return false;
        }
        // Pushes that do not help any more are given up.
        if (round < kPushes && unsafe_.size() < unsafe_before) {
            push_unsafe();
        } else {
            round = std::max(round, kPushes);
            if (!bind_unsafe()) {
                return false;  // nothing would change
            }
            move_bound();
        }
        ++round;
        unsafe_before = unsafe_.size();
    }
}

/// Writes the ends that have changed.
void SolidSurfaces::end_step(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    changes_ = stands_;
    for (const std::uint32_t v : moved_) {
        if (vector_of(end_[v]) != vector_of(asked_[v])) {
            changes_[surface_of_[v]] = 1;
        }
    }
    workers.for_each(surfaces_.size(), [&](std::size_t s) {
        if (changes_[s] != 0 || lags(s)) {
            take_ends(s, start, end);
        }
    });
}

/// Writes the ends of a surface, and how far they are from where its skin would be.
void SolidSurfaces::take_ends(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end) noexcept {
    const SolidSurface& of = surfaces_[surface];
    double most = 0.0;
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        const Vec3 asked = end[v];
        if (stands_[surface] != 0) {
            end[v] = start[v];
        } else if (is_moved_[v] != 0) {
            end[v] = vector_of(end_[v]);
        }
        // Besides what ask() has left of it.
        lag_[v] += asked - end[v];
        most = std::max(most, glm::dot(lag_[v], lag_[v]));
    }
    most_lag_[surface] = std::sqrt(most);
    if (changes_[surface] != 0) {
        of.tree->refit(
            {start.subspan(of.first_vertex, of.vertices), end.subspan(of.first_vertex, of.vertices), of.triangles});
    }
}

/// How far ends are out of the boxes of the ways that were asked for, at most, m.
double SolidSurfaces::farthest_stray() const noexcept {
    Vec3 farthest(0.0);
    for (const std::uint32_t v : moved_) {
        const Vec3 start = vector_of(start_[v]);
        const Vec3 asked = vector_of(asked_[v]);
        const Vec3 end = vector_of(end_[v]);
        farthest = glm::max(farthest, glm::max(glm::min(start, asked) - end, end - glm::max(start, asked)));
    }
    return std::max({farthest.x, farthest.y, farthest.z});
}

/// Surfaces that are kept apart and may meet: their boxes over the step, one grown by a margin, overlap.
void SolidSurfaces::find_meetings(double margin) {
    farthest_ = 0.0;
    for (std::size_t m = 0; m < meets_.size(); ++m) {
        const Aabb box = grown(surfaces_[meets_[m]].tree->bounds(), 0.5 * margin);
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
    meetings_ = 0;
    for (const BodyPair& pair : near_) {
        // Two that sleep stay apart.
        if (keeps_apart(pair.first, pair.second) && (yields_[pair.first] | yields_[pair.second]) != 0) {
            if (meetings_ == meeting_.size()) {
                meeting_.emplace_back();
            }
            meeting_[meetings_++].surfaces = pair;
        }
    }
}

/// Finds the pairs of features of two surfaces that may come too near while vertices end within their reach, where that
/// is due.
void SolidSurfaces::search(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    if (!std::exchange(search_is_due_, false)) {
        return;
    }
    const double apart = least_gap_ + 2.0 * reach_;
    // Leaves of trees whose boxes overlap. Both sides may end beyond these.
    const double margin = apart + 2.0 * farthest_stray();
    find_meetings(margin);
    for (std::size_t m = 0; m < meetings_; ++m) {
        take_part(meeting_[m].surfaces.first, start, end);
        take_part(meeting_[m].surfaces.second, start, end);
    }
    workers.for_each(meetings_, [&](std::size_t m) { find_blocks(meeting_[m], margin); });
    block_pairs_.clear();
    for (std::size_t m = 0; m < meetings_; ++m) {
        block_pairs_.insert(block_pairs_.end(), meeting_[m].blocks.begin(), meeting_[m].blocks.end());
    }
    // Most of them are apart as a whole.
    list_near_blocks();
    const auto count_of = [](const auto& list) { return ParticleRange{0, static_cast<std::uint32_t>(list.size())}; };
    workers.for_ranges(count_of(near_blocks_), kPlacedAtOnce, [&](std::size_t from, std::size_t to) {
        for (std::size_t k = from; k < to; ++k) {
            blocks_.place(near_blocks_[k],
                          [&](std::uint32_t v) { return std::pair(vector_of(start_[v]), vector_of(end_[v])); });
        }
    });
    const double rounded_apart = apart + FeatureBlocks::rounding_of_places(farthest_);
    apart_.resize(block_pairs_.size());
    workers.for_ranges(count_of(block_pairs_), kTestedAtOnce, [&](std::size_t from, std::size_t to) {
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
    // Then of the others their features.
    list_near_blocks();
    for (const std::uint32_t v : moved_) {
        searched_[v] = end_[v];
    }
    workers.for_ranges(count_of(near_blocks_), kFittedAtOnce, [&](std::size_t from, std::size_t to) {
        for (std::size_t k = from; k < to; ++k) {
            blocks_.fit(near_blocks_[k], [&](std::uint32_t v) {
                const Vec3 at = vector_of(start_[v]);
                return VertexPath{.start = at, .way = vector_of(end_[v]) - at, .margin = Vec3(0.5 * apart)};
            });
        }
    });
    const std::size_t in_part = std::clamp((left + kParts - 1) / kParts, kMinPairsInPart, kMaxPairsInPart);
    part_count_ = own_.size() + (left + in_part - 1) / in_part;
    parts_.resize(std::max(parts_.size(), part_count_));
    workers.for_ranges(count_of(block_pairs_), in_part, [&](std::size_t from, std::size_t to) {
        find_pairs(parts_[own_.size() + from / in_part], std::span(block_pairs_).subspan(from, to - from));
    });
    // Nothing tells the sides of features apart that touch.
    for (std::size_t p = own_.size(); p < part_count_; ++p) {
        for (const BodyPair& pair : parts_[p].touching) {
            if (const auto at = std::ranges::lower_bound(left_alone_, pair, is_before);
                at == left_alone_.end() || is_before(pair, *at)) {
                left_alone_.insert(at, pair);
            }
        }
    }
}

/// Finds the pairs of features of surfaces that meet themselves that would come too near on the ways that are asked.
void SolidSurfaces::search_own_first(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    workers.for_each(own_.size(), [&](std::size_t k) {
        Own& own = own_[k];
        for (std::size_t list = 0; list < 2; ++list) {
            parts_[k].pairs[list].forget_all();
            own.retained[list].clear();
        }
        if (!rests(own)) {
            take_part(own.surface, start, end);
            take_motion(own);
            list_own(own, parts_[k]);
            find_own(own, parts_[k]);
        }
    });
    part_count_ = own_.size();
}

/// The same on the ways to which rounds have led vertices by now. False: they have moved none since the last search.
bool SolidSurfaces::search_own_moved(Workers& workers) {
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
bool SolidSurfaces::rests(const Own& own) const noexcept {
    const Aabb& moved = surfaces_[own.surface].tree->displacement();
    return !(touching_ > 0.0) && moved.min == moved.max && moved.max == Vec3(0.0);
}

/// Collects the vertices of each surface that rounds have moved since its pairs were searched.
void SolidSurfaces::collect_moved() {
    for (Own& own : own_) {
        own.moved.clear();
    }
    for (const std::uint32_t v : moved_) {
        const std::uint32_t own = own_of_[surface_of_[v]];
        if (own != kFree && vector_of(own_searched_[v]) != vector_of(end_[v])) {
            own_searched_[v] = end_[v];
            own_[own].moved.push_back(v);
        }
    }
}

/// Takes the motion of a surface for the first time in the attempt, or later of what rounds have moved.
void SolidSurfaces::take_motion(Own& own) {
    if (!std::exchange(own.motion_is_taken, true)) {
        own.pairs.take_motion(own.blocks, start_.data(), end_.data(), own_apart_);
    } else {
        own.pairs.take_motion_of(own.moved, own.blocks, end_.data(), own_apart_);
    }
}

/// Drops the pairs of blocks that move in another way now, but those of one patch, which keep their planes.
void SolidSurfaces::drop_new(Own& own, Part& part) const {
    for (std::size_t list = 0; list < 2; ++list) {
        ListedPairs& pairs = part.pairs[list];
        own.is_dropped.resize(pairs.size());
        own.retained[list].clear();
        for (std::size_t k = 0; k < pairs.size(); ++k) {
            const PairVertices vertex = pairs.vertices(k);
            const bool is_new = own.pairs.is_new(pairs.origin[k]);
            const bool is_retained = is_new && is_of_one_patch(vertex);
            if (is_retained) {
                own.retained[list].push_back(vertex);
            }
            own.is_dropped[k] = is_new && !is_retained ? 1 : 0;
        }
        std::ranges::sort(own.retained[list]);
        pairs.leave_out([&](std::size_t k) { return own.is_dropped[k] != 0; });
    }
}

/// Finds the pairs of a surface that are due, and lists the features of surroundings where that is.
void SolidSurfaces::list_own(Own& own, Part& part) {
    own.pairs.find(own_apart_, own.due);
    const Vec3 margin(0.5 * own.pairs.reach());
    for (const std::uint32_t block : own.pairs.to_list()) {
        own.pairs.begin_list(block, own.blocks);
        const auto list = [&](PairKind kind, const PairCandidates::Vertices& vertices) {
            DoubtfulPairs& of = part.in_doubt;
            of.pairs.assign(kind, vertices);
            of.nearest.resize(of.pairs.size());
            kernels_.find_nearest(kind, of.pairs.rows(of.pairs.gap), of.pairs.size(), start_.data(), of.nearest.rows());
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
                return VertexPath{.start = vector_of(start_[v]), .way = Vec3(0.0), .margin = margin};
            };
            compare_own(own, part, block, path_of, list);
        }
        own.pairs.end_list(block, own.blocks, own_apart_, own.due);
    }
    std::ranges::fill(own.is_fitted, std::uint8_t{0});
}

/// Keeps those of a surface's own pairs that are not proved to stay apart on the ways that are known.
void SolidSurfaces::find_own(Own& own, Part& part) {
    for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
        const OwnPairs::Due& due = own.due[list_of(kind)];
        for (std::size_t from = 0; from < due.block.size(); from += kProvedTogether) {
            const std::size_t count = std::min(kProvedTogether, due.block.size() - from);
            PairCandidates::Vertices some = due.vertices.vertices();
            for (std::span<const std::uint32_t>& of : some) {
                of = of.subspan(from, count);
            }
            keep_own(own, part, kind, some, [&](std::size_t k) { return due.block[from + k]; });
        }
    }
    // Of fast surroundings all features that may meet.
    const auto path_of = [&](std::uint32_t v) {
        const Vec3 at = vector_of(start_[v]);
        return VertexPath{.start = at, .way = vector_of(end_[v]) - at, .margin = Vec3(0.5 * own_apart_)};
    };
    for (const std::uint32_t block : own.pairs.to_compare()) {
        compare_own(own, part, block, path_of, [&](PairKind kind, const PairCandidates::Vertices& vertices) {
            keep_own(own, part, kind, vertices, [&](std::size_t) { return block; });
        });
    }
    std::ranges::fill(own.is_fitted, std::uint8_t{0});
}

/// Compares the features of a block with those of its surroundings, in boxes around path_of(vertex), a VertexPath.
/// Calls take(kind, vertices) with the pairs that may meet, many at a time.
template <class PathOf, class Take>
void SolidSurfaces::compare_own(Own& own, Part& part, std::uint32_t block, const PathOf& path_of, const Take& take) {
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
void SolidSurfaces::keep_own(Own& own, Part& part, PairKind kind, const PairCandidates::Vertices& vertices,
                             const BlockOf& block_of) {
    const FeaturePairs& doubtful = part.in_doubt.pairs;
    const std::vector<PairVertices>& retained = own.retained[list_of(kind)];
    FeaturePairs& list = part.pairs[list_of(kind)];
    const auto is_left_out = [&](std::size_t k) {
        const PairVertices vertex = doubtful.vertices(k);
        if (!(part.in_doubt.nearest.distance[k] > touching_)) {
            for (const std::uint32_t v : vertex) {
                leaves_alone_[v] = 1;
            }
        }
        return are_left_alone(vertex) || std::ranges::binary_search(retained, vertex);
    };
    keep_near(part, kind, vertices, own_apart_, is_left_out,
              [&](std::size_t k) { list.origin.back() = block_of(doubtful.origin[k]); });
}

bool SolidSurfaces::are_left_alone(const PairVertices& vertex) const noexcept {
    return (leaves_alone_[vertex[0]] & leaves_alone_[vertex[1]] & leaves_alone_[vertex[2]] &
            leaves_alone_[vertex[3]]) != 0;
}

/// Those that are in a pair, each once, in order: a thread that takes some of them has just moved their surface.
void SolidSurfaces::list_near_blocks() {
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
void SolidSurfaces::find_blocks(Meeting& meeting, double margin) const {
    const auto [first, second] = meeting.surfaces;
    meeting.blocks.clear();
    surfaces_[first].tree->query_pairs(*surfaces_[second].tree, margin, [&](std::uint32_t one, std::uint32_t other) {
        meeting.blocks.push_back({first_block_[first] + one, first_block_[second] + other});
    });
}

void SolidSurfaces::find_pairs(Part& part, std::span<const BlockPair> blocks) const {
    part.touching.clear();
    for (ListedPairs& pairs : part.pairs) {
        pairs.forget_all();
    }
    const auto prove = [&](PairKind kind, const PairCandidates::Vertices& vertices) {
        const FeaturePairs& doubtful = part.in_doubt.pairs;
        keep_near(
            part, kind, vertices, least_gap_ + 2.0 * reach_,
            [&](std::size_t k) {
                // Nothing tells the sides apart of what touches.
                const bool touches = !(part.in_doubt.nearest.distance[k] > touching_);
                if (touches) {
                    part.touching.push_back(
                        ordered(surface_of_[doubtful.vertex[0][k]], surface_of_[doubtful.vertex[3][k]]));
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

/// Keeps those of the pairs that are not proved to stay `apart`, m, on the ways that are known, but those for which
/// is_left_out(k) holds, and calls kept(k) when one has been kept. k: in `part.in_doubt.pairs`.
template <class IsLeftOut, class Kept>
void SolidSurfaces::keep_near(Part& part, PairKind kind, const PairCandidates::Vertices& vertex, double apart,
                              const IsLeftOut& is_left_out, const Kept& kept) const {
    const auto may_close = [&](const FeaturePairs& pairs, std::size_t k) {
        return !(pairs.gap[k] > 0.0 && pairs.end_gap[k] >= apart);
    };
    part.in_doubt.find(kernels_, kind, vertex, start_.data(), end_.data(), may_close);
    const FeaturePairs& doubtful = part.in_doubt.pairs;
    ListedPairs& list = part.pairs[list_of(kind)];
    for (std::size_t k = 0; k < doubtful.size(); ++k) {
        if (may_close(doubtful, k) && !is_left_out(k)) {
            list.add(doubtful, k);
            kept(k);
        }
    }
}

/// Lists the pairs that are not proved apart all the way. Whether there are any. Those of one patch need no proof once
/// their vertices keep to the sides of their planes. Those that follow exact surfaces do so roughly only.
bool SolidSurfaces::find_unsafe(bool patches_are_apart) {
    ++round_;
    unsafe_.clear();
    const double least = (1.0 - kRoundingOfGap) * least_gap_;
    for (std::uint32_t p = 0; p < part_count_; ++p) {
        for (std::uint32_t list = 0; list < 2; ++list) {
            ListedPairs& pairs = parts_[p].pairs[list];
            kernels_.find_gaps(pairs.kind, pairs.rows(pairs.end_gap), pairs.size(), end_.data());
            for (std::uint32_t k = 0; k < pairs.size(); ++k) {
                const bool apart = pairs.gap[k] > 0.0 && pairs.end_gap[k] >= least;
                if (apart || stands_proved(pairs, k) || (patches_are_apart && is_kept_by_planes(pairs.vertices(k)))) {
                    continue;
                }
                const NearestPoints& first = pairs.nearest_at_start(k, start_.data());
                if (pairs.safe_part(k, first, start_.data(), end_.data(), least) < 1.0) {
                    unsafe_.push_back({p, list, k});
                } else {
                    pairs.known[k].proved = round_;
                }
            }
        }
    }
    return !unsafe_.empty();
}

/// Whether a pair was proved apart and no vertex of it has changed its end since.
bool SolidSurfaces::stands_proved(const ListedPairs& pairs, std::size_t at) const noexcept {
    return std::ranges::all_of(pairs.vertices(at),
                               [&](std::uint32_t v) { return pairs.known[at].proved > moved_in_[v]; });
}

/// Pushes unsafe pairs apart at the ends of their ways, between points at which they were, and are, nearest.
void SolidSurfaces::push_unsafe() {
    const double keep = kPushedGaps * least_gap_;
    for (const Unsafe& u : unsafe_) {
        ListedPairs& pairs = parts_[u.part].pairs[u.list];
        const PairVertices vertex = pairs.vertices(u.pair);
        const NearestPoints& first = pairs.nearest_at_start(u.pair, start_.data());
        const auto push = [&](const NearestPoints& nearest) {
            const Vec3 normal = nearest.normal();
            const double clearance = glm::dot(normal, weighted(nearest.weight, vertex, end_.data())) - keep;
            double mobility = 0.0;
            for (std::size_t k = 0; k < 4; ++k) {
                mobility += can_move(vertex[k]) ? nearest.weight[k] * nearest.weight[k] : 0.0;
            }
            if (!(clearance < 0.0 && mobility > 0.0 && glm::dot(normal, first.normal()) > 0.0)) {
                return;
            }
            for (std::size_t k = 0; k < 4; ++k) {
                if (can_move(vertex[k])) {
                    note_move(vertex[k]);
                    Vec3 end = vector_of(end_[vertex[k]]) + (-clearance / mobility * nearest.weight[k] * normal);
                    end.y = std::max(end.y, surfaces_[surface_of_[vertex[k]]].floor);
                    move_end(vertex[k], end);
                }
            }
        };
        push(first);
        push(nearest_points(pairs.kind, pairs.positions(u.pair, end_.data())));
    }
}

/// Whether rounds may move it.
bool SolidSurfaces::can_move(std::uint32_t vertex) const noexcept {
    const std::uint32_t surface = surface_of_[vertex];
    return yields_[surface] != 0 && stands_[surface] == 0;
}

/// While patches are joined.
std::uint32_t SolidSurfaces::patch_of(std::uint32_t vertex) noexcept {
    while (parent_[vertex] != vertex) {
        vertex = parent_[vertex] = parent_[parent_[vertex]];
    }
    return vertex;
}

bool SolidSurfaces::is_of_one_patch(const PairVertices& vertex) const noexcept {
    return parent_[vertex[0]] != kFree &&
           std::ranges::all_of(vertex, [&](std::uint32_t v) { return parent_[v] == parent_[vertex[0]]; });
}

bool SolidSurfaces::is_kept_by_planes(const PairVertices& vertex) const noexcept {
    return is_of_one_patch(vertex) && std::ranges::all_of(vertex, [&](std::uint32_t v) {
               return !is_exact(v) && led_[v] == patch_[parent_[v]].motion;
           });
}

/// Binds the vertices of each unsafe pair in one patch. Whether any were not yet.
bool SolidSurfaces::bind_unsafe() {
    bool binds = false;
    for (const Unsafe& u : unsafe_) {
        const PairVertices vertex = parts_[u.part].pairs[u.list].vertices(u.pair);
        binds = binds || !is_of_one_patch(vertex);
        for (const std::uint32_t v : vertex) {
            if (parent_[v] == kFree) {
                parent_[v] = v;
                bound_.push_back(v);
                note_move(v);
            }
            parent_[patch_of(v)] = patch_of(vertex[0]);
        }
    }
    for (const std::uint32_t v : bound_) {
        parent_[v] = patch_of(v);
    }
    return binds;
}

/// The common motion of each patch: the mean of what is asked of its vertices, or of those that cannot be pushed where
/// it has some; none where one of them stands still; and not below the floor.
void SolidSurfaces::find_common_motions() {
    for (const std::uint32_t v : bound_) {
        patch_[v] = {};
    }
    for (const std::uint32_t v : bound_) {
        Patch& patch = patch_[parent_[v]];
        const std::uint32_t surface = surface_of_[v];
        Patch::Sum& sum = is_exact(v) ? patch.exact : yields_[surface] != 0 ? patch.yielding : patch.led;
        sum.motion += vector_of(asked_[v]) - vector_of(start_[v]);
        sum.vertices += 1.0;
        patch.stands = patch.stands || stands_[surface] != 0;
        patch.lowest = std::max(patch.lowest, surfaces_[surface].floor - start_[v].number[1]);
    }
    for (const std::uint32_t v : bound_) {
        if (parent_[v] == v) {
            Patch& patch = patch_[v];
            const Patch::Sum& sum = patch.led.vertices > 0.0     ? patch.led
                                    : patch.exact.vertices > 0.0 ? patch.exact
                                                                 : patch.yielding;
            patch.motion = patch.stands ? Vec3(0.0) : sum.motion / sum.vertices;
            patch.motion.y = std::max(patch.motion.y, std::min(patch.lowest, 0.0));
        }
    }
}

/// Calls visit(pairs, index) for the pairs of one patch.
template <class Visit>
void SolidSurfaces::for_each_bound_pair(const Visit& visit) {
    for (std::size_t p = 0; p < part_count_; ++p) {
        for (ListedPairs& pairs : parts_[p].pairs) {
            for (std::size_t k = 0; k < pairs.size(); ++k) {
                if (is_of_one_patch(pairs.vertices(k))) {
                    visit(pairs, k);
                }
            }
        }
    }
}

/// Leads vertices as the features of exact surfaces go that they meet, and behind these.
void SolidSurfaces::follow_exact() {
    for (const std::uint32_t v : bound_) {
        led_[v] = patch_[parent_[v]].motion;
    }
    if (!some_are_exact_) {
        return;
    }
    for (const std::uint32_t v : bound_) {
        led_sum_[v] = {};
    }
    const auto for_each_exact_pair = [&](const auto& visit) {
        for_each_bound_pair([&](ListedPairs& pairs, std::size_t at) {
            if (const PairVertices vertex = pairs.vertices(at); meets_exact(vertex)) {
                visit(vertex, sides_of(pairs, at));
            }
        });
    };
    for_each_exact_pair([&](const PairVertices& vertex, const Sides& sides) {
        for (const std::uint32_t v : vertex) {
            led_sum_[v].motion += sides.common;
            led_sum_[v].vertices += 1.0;
        }
    });
    for (const std::uint32_t v : bound_) {
        if (led_sum_[v].vertices > 0.0) {
            led_[v] = led_sum_[v].motion / led_sum_[v].vertices;
        }
    }
    for_each_exact_pair([&](const PairVertices& vertex, const Sides& sides) {
        for (std::size_t k = 0; k < 4; ++k) {
            const double height = glm::dot(sides.normal, vector_of(start_[vertex[k]]) + led_[vertex[k]] - sides.common);
            const double missing = sides.half - sides.sign[k] * (height - sides.middle);
            if (missing > 0.0 && !is_exact(vertex[k])) {
                led_[vertex[k]] += missing * sides.sign[k] * sides.normal;
            }
        }
    });
    for (const std::uint32_t v : bound_) {
        if (led_sum_[v].vertices > 0.0) {
            led_[v].y = std::max(led_[v].y, std::min(surfaces_[surface_of_[v]].floor - start_[v].number[1], 0.0));
        }
    }
}

/// Moves the bound vertices as far toward their asked ends as the planes of their pairs permit.
void SolidSurfaces::move_bound() {
    if (bound_.empty()) {
        return;
    }
    find_common_motions();
    follow_exact();
    for (const std::uint32_t v : bound_) {
        part_[v] = 1.0;
    }
    for_each_bound_pair([&](ListedPairs& pairs, std::size_t at) { keep_to_sides(pairs, at); });
    for (const std::uint32_t v : bound_) {
        if (stands_[surface_of_[v]] != 0 || is_exact(v)) {
            continue;
        }
        const Vec3 led = vector_of(start_[v]) + led_[v];
        move_end(v, led + part_[v] * (vector_of(asked_[v]) - led));
    }
}

/// The plane in the middle of the gap in which a pair of one patch is at the start. It moves as the patch does, or as
/// the nearest point of an exact feature, and farther where it must for the others of that.
SolidSurfaces::Sides SolidSurfaces::sides_of(ListedPairs& pairs, std::size_t at) const noexcept {
    const PairVertices vertex = pairs.vertices(at);
    const FeatureVertices from = pairs.positions(at, start_.data());
    const NearestPoints& nearest = pairs.nearest_at_start(at, start_.data());
    const auto in_first = static_cast<std::size_t>(pairs.kind);
    Sides sides;
    // Along other normals that part them they may be apart by less than the gap.
    sides.normal = nearest.normal();
    double first = std::numeric_limits<double>::max();
    double second = std::numeric_limits<double>::lowest();
    for (std::size_t k = 0; k < 4; ++k) {
        const double height = glm::dot(sides.normal, from[k]);
        (k < in_first ? first : second) = k < in_first ? std::min(first, height) : std::max(second, height);
        sides.sign[k] = k < in_first ? 1.0 : -1.0;
    }
    sides.half = 0.5 * std::min(first - second, least_gap_);
    sides.middle = 0.5 * (first + second);
    if (!meets_exact(vertex)) {
        sides.common = patch_[parent_[vertex[0]]].motion;
        return sides;
    }
    for (std::size_t k = 0; k < 4; ++k) {
        if (is_exact(vertex[k])) {
            sides.common += std::abs(nearest.weight[k]) * (vector_of(asked_[vertex[k]]) - from[k]);
        }
    }
    for (std::size_t k = 0; k < 4; ++k) {
        if (is_exact(vertex[k])) {
            const double asked = glm::dot(sides.normal, vector_of(asked_[vertex[k]]) - sides.common);
            sides.middle =
                k < in_first ? std::min(sides.middle, asked - sides.half) : std::max(sides.middle, asked + sides.half);
        }
    }
    return sides;
}

/// Shortens the ways of a pair's vertices so that each stays on its side of their plane.
void SolidSurfaces::keep_to_sides(ListedPairs& pairs, std::size_t at) noexcept {
    const PairVertices vertex = pairs.vertices(at);
    const Sides sides = sides_of(pairs, at);
    for (std::size_t k = 0; k < 4; ++k) {
        const Vec3 from = vector_of(start_[vertex[k]]);
        const double room = sides.sign[k] * (glm::dot(sides.normal, from) - sides.middle) - sides.half;
        // Where it is led, and where it is asked to go, toward its side.
        const double led = sides.sign[k] * glm::dot(sides.normal, led_[vertex[k]] - sides.common);
        const double asked = sides.sign[k] * glm::dot(sides.normal, vector_of(asked_[vertex[k]]) - from - sides.common);
        if (-asked > room) {
            part_[vertex[k]] =
                std::min(part_[vertex[k]], led > asked ? std::max(0.0, room + led) / (led - asked) : 0.0);
        }
    }
}

/// Whether a vertex ends farther from where pairs of two surfaces were searched than its reach.
bool SolidSurfaces::have_left_reach() const noexcept {
    return std::ranges::any_of(moved_, [&](std::uint32_t v) {
        const Vec3 off = vector_of(end_[v]) - vector_of(searched_[v]);
        return glm::dot(off, off) > reach_ * reach_;
    });
}

}  // namespace haptic::sim
