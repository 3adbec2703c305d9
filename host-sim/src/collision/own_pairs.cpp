#include "collision/own_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "collision/rounded_boxes.hpp"
#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

// Of the mean edge: how far apart features are that are listed, and how far they may come nearer before they are looked
// at again.
constexpr double kListedOfEdge = 0.625;
constexpr double kRoomOfEdge = 0.125;
// Of the reach: what one motion has to leave of it, else no list is made.
constexpr double kLeastOfReach = 0.25;
// Distances are taken again when as many listed pairs were due since then as this, and these times the list.
constexpr std::size_t kMinWork = 64;
constexpr std::size_t kWorkOfList = 2;
// Of the reach of lists: blocks nearer than it surround one another; those that are farther than this do not any more,
// and how far others are listed.
constexpr float kLeavesAtReaches = 1.5F;
constexpr float kHorizonInReaches = 6.0F;
constexpr float kStepsOfHorizon = 16.0F;  // for which it is to last
// Distances of far blocks are taken again when so many times all of them had to be compared by their boxes.
constexpr std::size_t kWorkOfFar = 8;
constexpr float kLeastStretch = 0.1F;  // below, a map says nothing
// A list numbers corners of its surroundings by 16 bits: those of more blocks are compared in each step.
constexpr std::size_t kMostBlocks = 1024;
static_assert(3 * FeatureBlocks::kMaxInBlock * kMostBlocks <= std::numeric_limits<std::uint16_t>::max());
// Room: pairs of far blocks, and of what lists and surroundings have at first.
constexpr std::size_t kFarPerBlock = 256;
constexpr std::size_t kTimesMore = 3;        // listed pairs, where a surface moves
constexpr std::size_t kTimesMoreBlocks = 6;  // in surroundings, where it is crumpled
constexpr std::size_t kSomeMore = 64;
constexpr std::size_t kAhead = 2;  // memory is fetched so many turns in advance
// Of lengths: more than what a few sums and products of floats lose.
constexpr float kRoundingOfPlaces = 4e-6F;
constexpr float kInfinite = std::numeric_limits<float>::infinity();

using FourFloats = LaneTypes<4, float>::Real;

HAPTIC_LANES FourFloats least(const FourFloats& a, const FourFloats& b) {
    return a < b ? a : b;
}
HAPTIC_LANES FourFloats greatest(const FourFloats& a, const FourFloats& b) {
    return a > b ? a : b;
}
HAPTIC_LANES FourFloats cross_of(const FourFloats& a, const FourFloats& b) {
    const auto next = [](const FourFloats& x) { return __builtin_shufflevector(x, x, 1, 2, 0, 3); };
    const auto last = [](const FourFloats& x) { return __builtin_shufflevector(x, x, 2, 0, 1, 3); };
    return next(a) * last(b) - last(a) * next(b);
}
/// The greater one, or one that is not a number.
HAPTIC_LANES float greater_or_none(float one, float most) {
    return one <= most ? most : one;
}
/// Of each block, of what is known of vertices from the first one on: the greatest of its corners.
void take_greatest(const FeatureBlocks& blocks, std::uint32_t first_vertex, const std::vector<float>& of_vertex,
                   std::vector<float>& of_block) {
    for (std::uint32_t k = 0; k < of_block.size(); ++k) {
        of_block[k] = 0.0F;
        for (const std::uint32_t v : blocks.corners_of(k)) {
            of_block[k] = greater_or_none(of_vertex[v - first_vertex], of_block[k]);
        }
    }
}
HAPTIC_LANES float greatest_of_three(const FourFloats& x) {
    return std::max({x[0], x[1], x[2]});
}
HAPTIC_LANES Vec3 vector_of_three(const FourFloats& x) {
    return {x[0], x[1], x[2]};
}

}  // namespace

OwnPairs::OwnPairs(const FeatureBlocks& blocks, const DeformationKernels& kernels, double edge)
    : kernels_(kernels),
      reach_(kListedOfEdge * edge),
      greatest_room_(static_cast<float>(kRoomOfEdge * edge)),
      surroundings_(blocks.size()),
      is_moved_(blocks.size(), 1),
      most_(blocks.size(), 0.0F),
      deviation_(blocks.size(), 0.0F),
      sweep_(blocks.size()),
      bounds_(blocks.size()) {
    const auto count = static_cast<std::uint32_t>(blocks.size());
    // The blocks that have a vertex as a corner.
    std::vector<std::pair<std::uint32_t, std::uint32_t>> corners;
    for (std::uint32_t k = 0; k < count; ++k) {
        for (const std::uint32_t v : blocks.corners_of(k)) {
            corners.emplace_back(v, k);
        }
    }
    std::ranges::sort(corners);
    first_vertex_ = corners.front().first;
    for (const auto& [vertex, block] : corners) {
        first_of_.resize(vertex - first_vertex_ + 1, static_cast<std::uint32_t>(has_corner_.size()));
        has_corner_.push_back(block);
    }
    first_of_.push_back(static_cast<std::uint32_t>(has_corner_.size()));
    const std::size_t vertices = first_of_.size() - 1;
    corner_of_.resize(vertices, 0);
    is_corner_.resize(vertices, 0);
    corners_.reserve(vertices);
    far_corners_.reserve(vertices);
    distance_.reserve(vertices);
    residuals_.make_room(vertices);
    deviation_of_vertex_.resize(vertices, 0.0F);
    for (Places* of : {&start_, &end_}) {
        of->vertex.resize(vertices);
        of->box.resize(count);
    }
    // Room for what usual surfaces need; more allocates.
    for (auto& of : new_) {
        of.reserve(FeatureBlocks::kMaxOfTwoBlocks);
    }
    for (std::vector<std::uint32_t>* of : {&to_list_, &to_compare_, &in_turn_, &new_near_}) {
        of->reserve(count);
    }
    in_order_.reserve(2 * surroundings_.size());
    far_.reserve(std::min<std::size_t>(kFarPerBlock, count) * count);
    new_far_.reserve(std::min<std::size_t>(kFarPerBlock, count) * count);
    found_.reserve(2 * new_far_.capacity());
}

void OwnPairs::Due::make_room(std::size_t count) {
    pairs.make_room(count);
    block.reserve(count);
}

void OwnPairs::place(std::uint32_t vertex, const Row* position, Places& places) noexcept {
    const Vec3 at = vector_of(position[vertex]) - origin_;
    places.vertex[vertex - first_vertex_] = {
        {static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z), 0.0F}};
}

void OwnPairs::fit_box(std::uint32_t block, const FeatureBlocks& blocks, Places& places) noexcept {
    Box box{Four{} + kInfinite, Four{} - kInfinite};
    for (const std::uint32_t v : blocks.corners_of(block)) {
        const Four at = load<Four>(places.vertex[v - first_vertex_].number);
        box = {least(at, box.low), greatest(at, box.high)};
    }
    places.box[block] = box;
}

/// m, what floats may take from distances of places as far out as a box.
float OwnPairs::rounding_in(const Box& box) noexcept {
    return kRoundingOfPlaces * greatest_of_three(greatest(box.high, -box.low));
}

void OwnPairs::take_motion(const FeatureBlocks& blocks, const Row* start, const Row* end, double apart) {
    const auto place_all = [&](const Row* position, Places& places) {
        origin_ = vector_of(position[first_vertex_]);
        for (std::uint32_t v = 0; v < places.vertex.size(); ++v) {
            place(first_vertex_ + v, position, places);
        }
        for (std::uint32_t k = 0; k < blocks.size(); ++k) {
            fit_box(k, blocks, places);
        }
    };
    if (!std::exchange(is_placed_, true)) {
        place_all(start, start_);
    }
    place_all(end, end_);
    rounding_ = 0.0F;
    for (std::uint32_t k = 0; k < blocks.size(); ++k) {
        rounding_ = std::max({rounding_, rounding_in(start_.box[k]), rounding_in(end_.box[k])});
    }
    for (Surroundings& of : surroundings_) {
        of.is_new = true;
        of.is_followed = false;
    }
    is_first_motion_ = true;
    follow_whole(blocks, apart);
    find_deviations(blocks);
    for (Surroundings& of : surroundings_) {
        of.used += deviation_between(of);
    }
}

/// By how much the motion of each block differs from that of a frame, x + way + turn x (x - middle), common to the
/// surface. A frame brings nothing nearer on straight paths, since |d + s turn x d| >= |d|, so distances shrink by no
/// more than both deviations.
void OwnPairs::find_deviations(const FeatureBlocks& blocks) {
    const auto four = [](const Vec3& x) {
        return Four{static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z), 0.0F};
    };
    const Deformation::Motion whole = whole_.motion();
    const Four middle = four(whole.middle);
    const Four way = four(whole.way);
    const Four turn = four(whole.turn);
    for (std::size_t v = 0; v < deviation_of_vertex_.size(); ++v) {
        const Four start = load<Four>(start_.vertex[v].number);
        const Four off = load<Four>(end_.vertex[v].number) - start - way - cross_of(turn, start - middle);
        deviation_of_vertex_[v] = std::sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]);
    }
    take_greatest(blocks, first_vertex_, deviation_of_vertex_, deviation_);
}

void OwnPairs::take_motion_of(std::span<const std::uint32_t> vertices, const FeatureBlocks& blocks, const Row* end,
                              double apart) {
    std::ranges::fill(is_moved_, std::uint8_t{0});
    is_first_motion_ = false;
    for (const std::uint32_t v : vertices) {
        place(v, end, end_);
        for (std::uint32_t k = first_of_[v - first_vertex_]; k < first_of_[v - first_vertex_ + 1]; ++k) {
            is_moved_[has_corner_[k]] = 1;
        }
    }
    for (std::uint32_t k = 0; k < blocks.size(); ++k) {
        if (is_moved_[k] != 0) {
            fit_box(k, blocks, end_);
            rounding_ = std::max(rounding_, rounding_in(end_.box[k]));
        }
    }
    for (Surroundings& of : surroundings_) {
        of.is_new = std::ranges::any_of(of.blocks, [&](std::uint32_t k) { return is_moved_[k] != 0; });
    }
    follow_whole(blocks, apart);
}

/// Sees to it that blocks that may come near surround one another.
void OwnPairs::follow_whole(const FeatureBlocks& blocks, double apart) {
    const auto gap_now = [&] { return above(static_cast<float>(apart)) + rounding_ + whole_.rounding(); };
    const auto follow = [&] {
        const float stretch = whole_.follow(kernels_, start_.vertex.data(), end_.vertex.data(), residuals_);
        take_greatest(blocks, first_vertex_, residuals_.of_point, most_);
        return stretch > kLeastStretch ? stretch : 0.0F;
    };
    // A horizon without an end is no list: it is for one step.
    const bool is_listed = !whole_.is_empty() && !(is_first_motion_ && horizon_ == kInfinite);
    if (is_listed && far_work_ < kWorkOfFar * (far_.size() + surroundings_.size())) {
        const float stretch = follow();
        if (horizon_holds(stretch, gap_now())) {
            find_due_blocks(stretch, gap_now());
            return;
        }
    }
    // From where it is now. All its points are first ones.
    corners_.resize(start_.vertex.size());
    std::iota(corners_.begin(), corners_.end(), 0U);
    whole_.refer_to(corners_, corners_.size(), corners_.size(), start_.vertex.data());
    far_work_ = 0;
    const float stretch = follow();
    const float gap = gap_now();
    horizon_ =
        stretch > 0.0F
            ? std::max(kHorizonInReaches * static_cast<float>(reach_),
                       (gap + 2.0F * kStepsOfHorizon * residuals_.most.of_first + static_cast<float>(reach_)) / stretch)
            : kInfinite;
    search();
    find_due_blocks(stretch, gap);
}

/// Whether no blocks that are not listed may come near.
bool OwnPairs::horizon_holds(float stretch, float apart) const noexcept {
    return horizon_ == kInfinite || stretch * horizon_ - 2.0F * residuals_.most.of_first >= apart;
}

/// Lets those far blocks surround one another that may come near.
void OwnPairs::find_due_blocks(float stretch, float apart) {
    const float limit = stretch > 0.0F ? (apart + 2.0F * residuals_.most.of_first) / stretch : kInfinite;
    for (FarEntry& pair : std::span(far_).first(order_of_far_.count_within(limit))) {
        const auto [first, second] = pair.blocks;
        if (pair.distance == kInfinite || stretch * pair.distance - most_[first] - most_[second] >= apart) {
            continue;
        }
        ++far_work_;
        if (!boxes_stay_apart(first, second, apart)) {
            new_near_.assign(surroundings_[first].blocks.begin(), surroundings_[first].blocks.end());
            new_near_.insert(std::ranges::upper_bound(new_near_, second), second);
            surround(first, new_near_);
            pair.distance = kInfinite;
        }
    }
}

/// Finds all blocks that surround one another, and the far ones, at the start of the motion.
void OwnPairs::search() {
    const Vec3 half(std::min(0.5F * horizon_, std::numeric_limits<float>::max()));
    for (std::uint32_t k = 0; k < bounds_.size(); ++k) {
        bounds_[k] = bounds_of({vector_of_three(start_.box[k].low) - half, vector_of_three(start_.box[k].high) + half});
    }
    sweep_.find(bounds_, found_);
    new_far_.clear();
    std::size_t at = 0;
    const auto reach = static_cast<float>(reach_);
    for (std::uint32_t k = 0; k < surroundings_.size(); ++k) {
        new_near_.assign(1, k);
        for (; at < found_.size() && found_[at].first == k; ++at) {
            const std::uint32_t other = found_[at].second;
            const float distance = distance_of_boxes(k, other);
            const bool is_near = distance <= reach || (distance <= kLeavesAtReaches * reach &&
                                                       std::ranges::binary_search(surroundings_[k].blocks, other));
            if (is_near) {
                new_near_.push_back(other);
            } else {
                new_far_.push_back({distance, found_[at]});
            }
        }
        if (!std::ranges::equal(new_near_, surroundings_[k].blocks)) {
            surround(k, new_near_);
        }
    }
    far_.resize(new_far_.size());
    order_of_far_.arrange<FarEntry>(new_far_, std::min(horizon_, kHorizonInReaches * reach), far_.data());
}

void OwnPairs::surround(std::uint32_t block, std::span<const std::uint32_t> by) {
    Surroundings& of = surroundings_[block];
    of.blocks.assign(by.begin(), by.end());
    of.is_listed = of.is_complete = false;
    of.is_new = true;
}

/// m, of the blocks' boxes at the start, at most.
float OwnPairs::distance_of_boxes(std::uint32_t first, std::uint32_t second) const noexcept {
    return std::max(0.0F, distance_between(start_.box[first], start_.box[second]) - rounding_);
}

float OwnPairs::distance_between(const Box& a, const Box& b) noexcept {
    const Four apart = greatest(greatest(a.low - b.high, b.low - a.high), Four{});
    return std::sqrt(apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]);
}

/// Whether boxes are this far apart, m, along the same axis at the start and at the end, and so all the way.
bool OwnPairs::boxes_stay_apart(std::uint32_t first, std::uint32_t second, float gap) const noexcept {
    const auto gaps = [&](std::uint32_t high, std::uint32_t low) {
        return least(start_.box[high].low - start_.box[low].high, end_.box[high].low - end_.box[low].high);
    };
    return greatest_of_three(greatest(gaps(first, second), gaps(second, first))) >= gap;
}

void OwnPairs::find(double apart, std::array<Due, 2>& due) {
    to_list_.clear();
    to_compare_.clear();
    for (Due& of : due) {
        of.pairs.clear();
        of.block.clear();
    }
    // Those whose room is used up. What is known of them does not fit the memory that is next to a processor, so it is
    // fetched in advance.
    in_turn_.clear();
    for (std::uint32_t k = 0; k < surroundings_.size(); ++k) {
        const Surroundings& of = surroundings_[k];
        if (of.is_new && !(is_first_motion_ && of.is_listed && of.used <= of.room)) {
            in_turn_.push_back(k);
        }
    }
    for (std::size_t turn = 0; turn < in_turn_.size(); ++turn) {
        if (turn + kAhead < in_turn_.size()) {
            prefetch(surroundings_[in_turn_[turn + kAhead]]);
        }
        const std::uint32_t k = in_turn_[turn];
        Surroundings& of = surroundings_[k];
        if (of.blocks.size() > kMostBlocks) {
            compare(k);
            continue;
        }
        const std::size_t listed = of.lists[0].order.size() + of.lists[1].order.size();
        const bool is_worn = is_first_motion_ && of.work > kMinWork + kWorkOfList * listed;
        const bool lasts = of.is_listed && list_lasts(k, apart);
        of.is_complete = lasts;
        if (lasts && !is_worn) {
            take_due(k, apart, due);
        } else if (lasts || new_list_would_last(of, apart)) {
            to_list_.push_back(k);
        } else {
            compare(k);
        }
    }
}

/// Whether it is worth while to list surroundings: not for what rounds do with their vertices, nor for a motion that
/// uses up most of the reach.
bool OwnPairs::new_list_would_last(const Surroundings& of, double apart) const noexcept {
    return is_first_motion_ && reach_ - static_cast<double>(deviation_between(of)) > kLeastOfReach * reach_ + apart;
}

/// m, by which features of surroundings come nearer over the first motion, at most.
float OwnPairs::deviation_between(const Surroundings& of) const noexcept {
    float most = 0.0F;
    for (const std::uint32_t k : of.blocks) {
        most = greater_or_none(deviation_[k], most);
    }
    return deviation_[of.blocks.front()] + most + rounding_;
}

/// Lets all features of surroundings be compared over the motion. A list that they have stays.
void OwnPairs::compare(std::uint32_t block) {
    surroundings_[block].room = -1.0F;
    to_compare_.push_back(block);
}

/// Whether features of surroundings that are not listed stay apart over the motion. Leaves the stretch and residuals.
///
/// Such a feature lies in a triangle of its block. Each corner of this is measured as no farther from the first block
/// than the triangle is, so the corner with the greatest residual tells no more than what is true of the whole feature.
/// The other feature of a pair is of the first block.
bool OwnPairs::list_lasts(std::uint32_t block, double apart) {
    Surroundings& of = surroundings_[block];
    stretch_ = of.deformation.follow(kernels_, start_.vertex.data(), end_.vertex.data(), residuals_);
    of.is_followed = true;
    of.unlisted_distance = residuals_.most.left - residuals_.most.of_first - rounding_ - of.deformation.rounding();
    return stretch_ > kLeastStretch && of.unlisted_distance >= above(static_cast<float>(apart));
}

/// Takes those listed pairs that may come too near, from what list_lasts() has left. Those that are farther than the
/// limit have the greatest room at least, since one feature is of the first block and no corner of the other is
/// measured as farther than the reach.
void OwnPairs::take_due(std::uint32_t block, double apart, std::array<Due, 2>& due) {
    Surroundings& of = surroundings_[block];
    const float gap = above(static_cast<float>(apart)) + rounding_ + of.deformation.rounding();
    const float limit = (gap + residuals_.most.of_first + residuals_.most.of_near + greatest_room_) / stretch_;
    of.room = std::min(greatest_room_, of.unlisted_distance - above(static_cast<float>(apart)));
    of.used = 0.0F;
    const float* const residual = residuals_.of_point.data();
    const float stretch = stretch_;
    float room_left = of.room;
    const auto take = [&](PairKind kind, const auto& lost_of) {
        Due& to = due[list_of(kind)];
        const List& list = of.lists[list_of(kind)];
        const std::span<const FeatureEntry> near(entry_.data() + list.begin, list.order.count_within(limit));
        to.pairs.make_room(to.pairs.size() + near.size());
        for (const FeatureEntry& pair : near) {
            const Feature& corner = pair.feature;
            const float room =
                stretch * pair.distance - gap -
                lost_of(residual[corner[0]], residual[corner[1]], residual[corner[2]], residual[corner[3]]);
            room_left = room >= room_left ? room_left : room;  // also what is not a number
            if (!(room >= 0.0F)) {
                ++of.work;
                add(of, corner, to.pairs);
                to.block.push_back(block);
            }
        }
    };
    take(PairKind::VertexTriangle, [](float a, float b, float c, float d) { return a + std::max(std::max(b, c), d); });
    take(PairKind::EdgeEdge, [](float a, float b, float c, float d) { return std::max(a, b) + std::max(c, d); });
    of.room = room_left;
}

/// Adds the vertices of a pair of features.
void OwnPairs::add(const Surroundings& of, const Feature& feature, PairCandidates& to) const noexcept {
    const auto vertex = [&](std::size_t k) { return first_vertex_ + of.deformation.number_of(feature[k]); };
    to.add(true, vertex(0), vertex(1), vertex(2), vertex(3));
}

void OwnPairs::begin_list(std::uint32_t block, const FeatureBlocks& blocks) {
    for (auto& of : new_) {
        of.clear();
    }
    corners_.clear();
    far_corners_.clear();
    // What is bent leaves the less of what is near the narrower the map is that is fitted to it.
    const auto reach = static_cast<float>(reach_);
    for (const std::uint32_t k : surroundings_[block].blocks) {
        for (const std::uint32_t of_all : blocks.corners_of(k)) {
            const std::uint32_t v = of_all - first_vertex_;
            if (std::exchange(is_corner_[v], std::uint8_t{1}) == 0) {
                const Four at = load<Four>(start_.vertex[v].number);
                const bool is_near = k == block || distance_between(start_.box[block], {at, at}) <= reach;
                (is_near ? corners_ : far_corners_).push_back(v);
            }
        }
        corners_of_first_ = k == block ? corners_.size() : corners_of_first_;
    }
    fitted_corners_ = corners_.size();
    corners_.insert(corners_.end(), far_corners_.begin(), far_corners_.end());
    for (std::size_t k = 0; k < corners_.size(); ++k) {
        corner_of_[corners_[k]] = static_cast<std::uint16_t>(k);
        is_corner_[corners_[k]] = 0;
    }
}

void OwnPairs::take_listed(std::uint32_t block, std::array<PairCandidates, 2>& listed) const {
    const Surroundings& of = surroundings_[block];
    for (std::size_t kind = 0; kind < listed.size(); ++kind) {
        const List& list = of.lists[kind];
        PairCandidates& to = listed[kind];
        to.make_room(to.size() + list.order.size());
        for (const FeatureEntry& pair : std::span(entry_).subspan(list.begin, list.order.size())) {
            add(of, pair.feature, to);
        }
    }
}

void OwnPairs::list(PairKind kind, const PairVertices& vertex, double distance) {
    if (distance <= reach_) {
        Feature feature{};
        for (std::size_t k = 0; k < vertex.size(); ++k) {
            feature[k] = corner_of_[vertex[k] - first_vertex_];
        }
        new_[list_of(kind)].push_back({below(static_cast<float>(distance)), feature});
    }
}

void OwnPairs::end_list(std::uint32_t block, const FeatureBlocks& blocks, double apart, std::array<Due, 2>& due) {
    Surroundings& of = surroundings_[block];
    of.deformation.refer_to(corners_, corners_of_first_, fitted_corners_, start_.vertex.data());
    const float listed = of.is_complete ? of.unlisted_distance : below(static_cast<float>(reach_));
    measure(of, blocks, listed);
    of.work = 0;
    for (std::size_t kind = 0; kind < 2; ++kind) {
        write_list(of.lists[kind], new_[kind]);
    }
    of.is_listed = true;
    if (list_lasts(block, apart)) {
        take_due(block, apart, due);
    } else {
        compare(block);
    }
}

/// Tells surroundings how far from the first block, at least, the features of each corner are that are not listed.
void OwnPairs::measure(Surroundings& of, const FeatureBlocks& blocks, float listed) {
    const auto corner = [&](std::size_t at) {
        const auto [x, y, z] = of.deformation.reference_of(at);
        return Four{x, y, z, 0.0F};
    };
    Box first{Four{} + kInfinite, Four{} - kInfinite};
    for (std::size_t k = 0; k < corners_of_first_; ++k) {
        first = {least(corner(k), first.low), greatest(corner(k), first.high)};
    }
    distance_.assign(corners_.size(), kInfinite);
    for (const std::uint32_t k : of.blocks) {
        for (const Triangle& triangle : blocks.triangles_of(k)) {
            Box box{Four{} + kInfinite, Four{} - kInfinite};
            for (const std::uint32_t v : triangle) {
                const Four at = corner(corner_of_[v - first_vertex_]);
                box = {least(at, box.low), greatest(at, box.high)};
            }
            const float distance = std::max(listed, distance_between(first, box) - of.deformation.rounding());
            for (const std::uint32_t v : triangle) {
                float& of_corner = distance_[corner_of_[v - first_vertex_]];
                of_corner = std::min(of_corner, distance);
            }
        }
    }
    // What is listed is no farther than the reach.
    of.deformation.measure(distance_, above(static_cast<float>(reach_)));
}

/// Writes a list where the last one was, or behind all others.
void OwnPairs::write_list(List& list, std::span<const FeatureEntry> entries) {
    if (entries.size() > list.room) {
        const std::size_t room = entries.size() + entries.size() / 2;
        list.room = 0;
        make_room(room);
        list.begin = static_cast<std::uint32_t>(free_);
        list.room = static_cast<std::uint32_t>(room);
        free_ += room;
    }
    list.order.arrange(entries, static_cast<float>(reach_), entry_.data() + list.begin);
}

/// Sees to it that so many entries have room behind all lists: closes what is left between them, or allocates.
void OwnPairs::make_room(std::size_t entries) {
    if (free_ + entries <= entry_.size()) {
        return;
    }
    in_order_.clear();
    for (Surroundings& of : surroundings_) {
        for (List& list : of.lists) {
            if (list.room > 0) {
                in_order_.push_back(&list);
            }
        }
    }
    std::ranges::sort(in_order_, {}, [](const List* list) { return list->begin; });
    free_ = 0;
    for (List* const list : in_order_) {
        std::copy_n(entry_.begin() + list->begin, list->order.size(),
                    entry_.begin() + static_cast<std::ptrdiff_t>(free_));
        list->begin = static_cast<std::uint32_t>(free_);
        list->room = static_cast<std::uint32_t>(list->order.size());
        free_ += list->order.size();
    }
    if (free_ + entries > entry_.size()) {
        entry_.resize(2 * (free_ + entries));
    }
}

void OwnPairs::make_room_for_more() {
    make_room(kTimesMore * free_ + kSomeMore * surroundings_.size());
    for (Surroundings& of : surroundings_) {
        of.blocks.reserve(kTimesMoreBlocks * of.blocks.size() + kSomeMore);
        of.deformation.make_room_for_more(kSomeMore / kPointsInGroup, kTimesMoreBlocks);
    }
}

/// Fetches what looking at surroundings needs, but for the farther pairs.
void OwnPairs::prefetch(const Surroundings& of) const noexcept {
    of.deformation.prefetch();
    constexpr std::size_t entries_in_line = 5;
    for (const List& list : of.lists) {
        for (std::size_t k = 0; k < std::min<std::size_t>(4 * entries_in_line, list.room); k += entries_in_line) {
            __builtin_prefetch(entry_.data() + list.begin + k);
        }
    }
}

void OwnPairs::advance() noexcept {
    std::swap(start_, end_);
    whole_.advance();
    for (Surroundings& of : surroundings_) {
        if (of.is_followed) {
            of.deformation.advance();
        } else {
            of.deformation.lose_track();
        }
    }
}

}  // namespace haptic::sim
