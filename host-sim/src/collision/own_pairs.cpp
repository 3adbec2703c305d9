#include "collision/own_pairs.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <utility>

#include "collision/rounded_boxes.hpp"
#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

// Lists are made to last for some steps. Of the mean edge: their least and greatest reach, if one step needs no more.
constexpr double kStepsOfList = 4.0;
constexpr double kLeastReachOfEdge = 0.375;
constexpr double kGreatestReaches = 2.0;
// What is left of a reach is to last for some steps.
constexpr double kStepsOfReach = 2.0;
// Of the least reach: what has been used when a list is made again in any case, as sums of floats lose more and more.
constexpr double kMostReachesUsed = 1000.0;
// Of the reach with which a list was made: what must be left of it, else it is made again.
constexpr double kLeastOfReach = 0.4;
// Of the least reach: blocks whose boxes are farther apart are not near any more, and how far others are searched for.
constexpr double kLeavesAtReaches = 1.25;
constexpr double kHorizonInReaches = 12.0;
// A search is to last for at least so many steps.
constexpr double kStepsOfSearch = 16.0;
// Room: pairs of blocks, and of features of two blocks.
constexpr std::size_t kNearPerBlock = 64;
constexpr std::size_t kFarPerBlock = 256;
constexpr std::uint32_t kMoreThanAtFirst = 3;  // of listed features, where a surface moves
// By how many sorts of distances listed pairs are ordered.
constexpr std::size_t kSorts = 8;
// Memory is fetched so many turns in advance.
constexpr std::size_t kAhead = 6;
// Of lengths: more than what a few sums and products of floats lose.
constexpr double kRoundingOfMotion = 2e-6;
// Of the squares of its corners' distances: corners in a line have no moment about it.
constexpr double kLeastMoment = 1e-6;
constexpr float kNever = std::numeric_limits<float>::infinity();

/// The turn that fits ways best, of points about their centre: `moment` is the sum of r.r I - r r^T, `angular` that of
/// r x way.
Vec3 best_turn(const Mat3& moment, const Vec3& angular) {
    const double least = kLeastMoment * (moment[0][0] + moment[1][1] + moment[2][2]);
    Mat3 regular = moment;
    for (int k = 0; k < 3; ++k) {
        regular[k][k] += least;
    }
    // Symmetric.
    const Vec3 across = glm::cross(regular[1], regular[2]);
    const double determinant = glm::dot(regular[0], across);
    if (!(determinant > 0.0)) {
        return Vec3(0.0);
    }
    return Vec3(glm::dot(across, angular), glm::dot(glm::cross(regular[2], regular[0]), angular),
                glm::dot(glm::cross(regular[0], regular[1]), angular)) /
           determinant;
}

using FourFloats = LaneTypes<4, float>::Real;

HAPTIC_LANES FourFloats next_axis(const FourFloats& x) {
    return __builtin_shufflevector(x, x, 1, 2, 0, 3);
}
HAPTIC_LANES FourFloats last_axis(const FourFloats& x) {
    return __builtin_shufflevector(x, x, 2, 0, 1, 3);
}
HAPTIC_LANES FourFloats cross(const FourFloats& a, const FourFloats& b) {
    return next_axis(a) * last_axis(b) - last_axis(a) * next_axis(b);
}
/// In the first three.
HAPTIC_LANES FourFloats square_of(const FourFloats& x) {
    const FourFloats squares = x * x;
    return squares + next_axis(squares) + last_axis(squares);
}
HAPTIC_LANES double length(const FourFloats& x) {
    return static_cast<double>(std::sqrt(square_of(x)[0]));
}
HAPTIC_LANES Vec3 vector_of(const FourFloats& x) {
    return {x[0], x[1], x[2]};
}
HAPTIC_LANES FourFloats four_of(const Vec3& x) {
    return FourFloats{static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z), 0.0F};
}
HAPTIC_LANES FourFloats least(const FourFloats& a, const FourFloats& b) {
    return a < b ? a : b;
}
HAPTIC_LANES FourFloats greatest(const FourFloats& a, const FourFloats& b) {
    return a > b ? a : b;
}

/// Of points about the origin, from sums of squares and of products of the next and the last coordinate.
Mat3 moment_of(const Vec3& squares, const Vec3& products) {
    return {squares.y + squares.z, -products.z, -products.y, -products.z,          squares.z + squares.x,
            -products.x,           -products.y, -products.x, squares.x + squares.y};
}

/// The motion that fits those of some points best.
class MotionSums {
  public:
    HAPTIC_LANES void add(const FourFloats& place, const FourFloats& way) {
        place_ += place;
        way_ += way;
        square_ += place * place;
        product_ += next_axis(place) * last_axis(place);
        angular_ += cross(place, way);
        count_ += 1.0;
    }
    [[nodiscard]] Vec3 centre() const { return vector_of(place_) / count_; }
    [[nodiscard]] Vec3 way() const { return vector_of(way_) / count_; }
    /// rad, about the centre.
    [[nodiscard]] Vec3 turn() const {
        const Vec3 c = centre();
        return best_turn(moment_of(vector_of(square_) - count_ * c * c,
                                   vector_of(product_) - count_ * Vec3(c.y * c.z, c.z * c.x, c.x * c.y)),
                         vector_of(angular_) - count_ * glm::cross(c, way()));
    }

  private:
    FourFloats place_{};
    FourFloats way_{};
    FourFloats square_{};
    FourFloats product_{};
    FourFloats angular_{};
    double count_ = 0.0;
};

/// A rotation by about a small turn.
Quat rotation_by(const Vec3& turn) {
    const Vec3 half = 0.5 * turn;
    return glm::normalize(Quat(1.0, half.x, half.y, half.z));
}

/// A rotation of points.
class Turned {
  public:
    explicit Turned(const Quat& by) {
        const Mat3 matrix = glm::mat3_cast(by);
        for (int k = 0; k < 3; ++k) {
            axis_[k] = four_of(matrix[k]);
        }
    }
    HAPTIC_LANES FourFloats operator()(const FourFloats& x) const {
        return axis_[0] * __builtin_shufflevector(x, x, 0, 0, 0, 0) +
               axis_[1] * __builtin_shufflevector(x, x, 1, 1, 1, 1) +
               axis_[2] * __builtin_shufflevector(x, x, 2, 2, 2, 2);
    }

  private:
    FourFloats axis_[3] = {};
};

std::uint64_t key_of(std::uint32_t first, std::uint32_t second) noexcept {
    return (static_cast<std::uint64_t>(first) << 32U) | second;
}

}  // namespace

OwnPairs::OwnPairs(const FeatureBlocks& blocks, double edge)
    : least_reach_(kLeastReachOfEdge * edge),
      motion_(blocks.size()),
      orientation_(blocks.size(), Quat(1.0, 0.0, 0.0, 0.0)),
      is_new_(blocks.size(), 1),
      path_(blocks.size(), 0.0),
      margin_(blocks.size(), 0.0),
      sweep_(blocks.size()),
      bounds_(blocks.size()) {
    const auto count = static_cast<std::uint32_t>(blocks.size());
    // The blocks that have a vertex as a corner.
    std::vector<std::pair<std::uint32_t, std::uint32_t>> corners;
    for (std::uint32_t k = 0; k < count; ++k) {
        most_corners_ = std::max(most_corners_, 2 * blocks.corners_of(k).size());
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
    corner_.resize(first_of_.size() - 1);
    corner_index_.resize(corner_.size(), 0);
    // Room for what usual surfaces need; more allocates.
    for (Listed& of : new_) {
        of.until.reserve(FeatureBlocks::kMaxOfTwoBlocks);
        of.feature.reserve(FeatureBlocks::kMaxOfTwoBlocks);
    }
    for (std::vector<std::uint32_t>* of : {&to_list_, &to_compare_, &order_, &in_turn_}) {
        of->reserve(kNearPerBlock * count);
    }
    near_.reserve(kNearPerBlock * count);
    list_.reserve(kNearPerBlock * count);
    known_.reserve(kNearPerBlock * count);
    far_.reserve(std::min<std::size_t>(kFarPerBlock, count) * count);
    found_.reserve(far_.capacity() + near_.capacity());
}

void OwnPairs::take_motion(const FeatureBlocks& blocks, const Row* start, const Row* end) {
    const double share = 1.0 / static_cast<double>(corner_.size());
    Row place{};
    Row to{};
    for (std::size_t v = first_vertex_; v < first_vertex_ + corner_.size(); ++v) {
        add_scaled(place, share, start[v]);
        add_scaled(to, share, end[v]);
    }
    middle_ = vector_of(place);
    way_ = vector_of(to) - middle_;
    for (std::uint32_t v = 0; v < corner_.size(); ++v) {
        take_corner(first_vertex_ + v, start, end);
    }
    for (std::uint32_t k = 0; k < motion_.size(); ++k) {
        fit_motion(k, blocks);
    }
    std::ranges::fill(is_new_, std::uint8_t{1});
    is_first_motion_ = true;
    find_frame();
    find_motions();
}

void OwnPairs::take_motion_of(std::span<const std::uint32_t> vertices, const FeatureBlocks& blocks, const Row* start,
                              const Row* end) {
    std::ranges::fill(is_new_, std::uint8_t{0});
    is_first_motion_ = false;
    for (const std::uint32_t v : vertices) {
        take_corner(v, start, end);
        for (std::uint32_t k = first_of_[v - first_vertex_]; k < first_of_[v - first_vertex_ + 1]; ++k) {
            is_new_[has_corner_[k]] = 1;
        }
    }
    for (std::uint32_t k = 0; k < motion_.size(); ++k) {
        if (is_new_[k] != 0) {
            fit_motion(k, blocks);
        }
    }
    find_motions();
}

void OwnPairs::take_corner(std::uint32_t vertex, const Row* start, const Row* end) noexcept {
    const Vec3 from = vector_of(start[vertex]);
    Corner& corner = corner_[vertex - first_vertex_];
    corner.place = four_of(from - middle_);
    corner.way = four_of(vector_of(end[vertex]) - from - way_);
}

/// The motion of a block that fits those of its corners best.
void OwnPairs::fit_motion(std::uint32_t block, const FeatureBlocks& blocks) noexcept {
    const std::span<const std::uint32_t> vertex = blocks.corners_of(block);
    const Corner& first = corner_[vertex[0] - first_vertex_];
    // About the first corner.
    MotionSums sums;
    Four low{};
    Four high{};
    for (const std::uint32_t v : vertex) {
        const Corner& corner = corner_[v - first_vertex_];
        const Four r = corner.place - first.place;
        sums.add(r, corner.way - first.way);
        low = least(r, low);
        high = greatest(r, high);
    }
    Motion& motion = motion_[block];
    motion.centre = first.place + four_of(sums.centre());
    motion.way = first.way + four_of(sums.way());
    motion.turn = four_of(sums.turn());
    motion.low = first.place + low;
    motion.high = first.place + high;
    // What is left.
    Four farthest{};
    Four most{};
    for (const std::uint32_t v : vertex) {
        const Corner& corner = corner_[v - first_vertex_];
        const Four r = corner.place - motion.centre;
        farthest = greatest(square_of(r), farthest);
        most = greatest(square_of(corner.way - motion.way - cross(motion.turn, r)), most);
    }
    motion.radius = (1.0 + kRoundingOfMotion) * std::sqrt(static_cast<double>(farthest[0]));
    motion.rest = std::sqrt(static_cast<double>(most[0])) +
                  kRoundingOfMotion * (motion.radius * (1.0 + length(motion.turn)) + length(motion.way));
}

/// The frame of the whole surface, whose middle rests.
void OwnPairs::find_frame() noexcept {
    MotionSums sums;
    for (const Motion& of : motion_) {
        sums.add(of.centre, of.way);
    }
    turn_ = four_of(sums.turn());
    frame_way_ = four_of(sums.way() - glm::cross(vector_of(turn_), sums.centre()));
}

/// Of new blocks in the frame of the surface, and between those that are near.
void OwnPairs::find_motions() noexcept {
    double farthest = 0.0;
    double longest_way = 0.0;
    double widest_turn = 0.0;
    for (const Motion& of : motion_) {
        farthest = std::max(farthest, length(of.centre) + of.radius);
        longest_way = std::max(longest_way, length(of.way));
        widest_turn = std::max(widest_turn, length(of.turn));
    }
    rounding_of_places_ = kRoundingOfMotion * farthest;
    rounding_ = kRoundingOfMotion * (longest_way + widest_turn * farthest);
    longest_path_ = longest_motion_ = 0.0;
    for (std::size_t k = 0; k < motion_.size(); ++k) {
        Motion& of = motion_[k];
        if (is_new_[k] != 0) {
            of.in_surface = length(of.way - frame_way_ - cross(turn_, of.centre)) +
                            of.radius * length(of.turn - turn_) + of.rest + rounding_;
        }
        longest_motion_ = std::max(longest_motion_, of.in_surface);
        longest_path_ = std::max(longest_path_, path_[k] + of.in_surface);
    }
    for (std::uint32_t n = 0; n < near_.size(); ++n) {
        if (is_new(n)) {
            near_[n].motion = above(static_cast<float>(motion_between(near_[n].first, near_[n].second)));
        }
    }
}

double OwnPairs::distance_of_boxes(std::uint32_t first, std::uint32_t second) const noexcept {
    const Motion& a = motion_[first];
    const Motion& b = motion_[second];
    return std::max(0.0, length(greatest(greatest(a.low - b.high, b.low - a.high), Four{})) - rounding_of_places_);
}

/// m, that two points of the blocks come nearer over the motion, at most.
double OwnPairs::motion_between(std::uint32_t first, std::uint32_t second) const noexcept {
    const Motion& a = motion_[first];
    const Motion& b = motion_[second];
    if (first == second) {
        return 2.0 * a.rest;
    }
    const Four between = b.centre - a.centre;
    const Four way = b.way - a.way;
    const double turn = length(b.turn - a.turn);
    return a.rest + b.rest + rounding_ +
           std::min(length(way - cross(a.turn, between)) + turn * b.radius,
                    length(way - cross(b.turn, between)) + turn * a.radius);
}

void OwnPairs::find_near(const FeatureBlocks& blocks, double apart) {
    to_list_.clear();
    to_compare_.clear();
    // Blocks beyond the horizon.
    const double near = kLeavesAtReaches * least_reach_;
    if (2.0 * longest_path_ + near + apart > horizon_) {
        search(apart);
    }
    // Far blocks: those whose distance may be used up have become near, or have another distance.
    if (far_next_ <= 2.0 * longest_path_ + apart) {
        far_next_ = std::numeric_limits<double>::infinity();
        std::size_t left = 0;
        for (std::size_t k = 0; k < far_.size(); ++k) {
            Far pair = far_[k];
            const Motion& one = motion_[pair.first];
            const Motion& other = motion_[pair.second];
            const double before = path_[pair.first] + path_[pair.second];
            const double then = before + one.in_surface + other.in_surface + apart;
            if (pair.until <= then) {
                const double distance = distance_of_boxes(pair.first, pair.second);
                if (distance <= least_reach_ || before + distance <= then) {
                    add_near(pair.first, pair.second);
                    continue;
                }
                pair.until = before + distance;
            }
            far_next_ = std::min(far_next_, pair.until);
            far_[left++] = pair;
        }
        far_.resize(left);
    }
    // Near blocks.
    const float gap = above(static_cast<float>(apart));
    in_turn_.clear();
    for (std::uint32_t n = 0; n < near_.size(); ++n) {
        if (above(near_[n].used + near_[n].motion + gap) >= near_[n].reach && is_new(n)) {
            in_turn_.push_back(n);
        }
    }
    for (std::size_t k = 0; k < in_turn_.size(); ++k) {
        if (k + kAhead < in_turn_.size()) {
            fetch_corners(in_turn_[k + kAhead]);
        }
        const std::uint32_t n = in_turn_[k];
        Near& of = near_[n];
        const double motion = static_cast<double>(of.motion);
        // Without a list while their boxes are far enough.
        if (const double distance = distance_of_boxes(of.first, of.second);
            distance > std::max(least_reach_, motion + apart)) {
            forget_list(n, distance);
            continue;
        }
        // Its list may still do.
        if (const auto listed = static_cast<double>(list_[n].listed); listed > 0.0) {
            const double reach = listed - 2.0 * farthest_from_list(n, blocks);
            if (reach > std::max(kLeastOfReach * listed, kStepsOfReach * motion + apart) &&
                static_cast<double>(of.used) < kMostReachesUsed * least_reach_) {
                of.reach = below(of.used + static_cast<float>(reach));
                continue;
            }
        }
        if (motion + apart > kGreatestReaches * least_reach_) {
            forget_list(n, 0.0);
            to_compare_.push_back(n);
            continue;
        }
        of.reach = static_cast<float>(std::clamp(kStepsOfList * motion, least_reach_, kGreatestReaches * least_reach_));
        margin_[of.first] = margin_[of.second] = 0.0;
        to_list_.push_back(n);
    }
    for (const std::uint32_t n : to_list_) {
        for (const std::uint32_t block : {near_[n].first, near_[n].second}) {
            margin_[block] = std::max(margin_[block], 0.5 * static_cast<double>(near_[n].reach));
        }
    }
}

/// Finds all far blocks, and those that have become near, at the start of the motion.
void OwnPairs::search(double apart) {
    std::ranges::fill(path_, 0.0);
    longest_path_ = longest_motion_;
    horizon_ = std::max(kHorizonInReaches * least_reach_,
                        kLeavesAtReaches * least_reach_ + apart + 2.0 * kStepsOfSearch * longest_motion_);
    // Between the searches of an attempt near blocks keep their numbers.
    if (is_first_motion_) {
        std::uint32_t left = 0;
        for (std::uint32_t n = 0; n < near_.size(); ++n) {
            if (distance_of_boxes(near_[n].first, near_[n].second) <= kLeavesAtReaches * least_reach_) {
                near_[left] = near_[n];
                list_[left++] = list_[n];
            } else if (list_[n].then != kNone) {
                free_then_.push_back(list_[n].then);
            }
        }
        near_.resize(left);
        list_.resize(left);
    }
    known_.clear();
    for (const Near& near : near_) {
        known_.push_back(key_of(near.first, near.second));
    }
    std::ranges::sort(known_);
    far_.clear();
    far_next_ = 0.0;
    const auto add = [&](std::uint32_t first, std::uint32_t second) {
        if (std::ranges::binary_search(known_, key_of(first, second))) {
            return;
        }
        if (const double distance = distance_of_boxes(first, second); distance > kLeavesAtReaches * least_reach_) {
            far_.push_back({first, second, distance});
        } else {
            add_near(first, second);
        }
    };
    const Vec3 half(0.5 * horizon_);
    for (std::uint32_t k = 0; k < motion_.size(); ++k) {
        bounds_[k] = bounds_of({vector_of(motion_[k].low) - half, vector_of(motion_[k].high) + half});
        add(k, k);
    }
    sweep_.find(bounds_, found_);
    for (const BodyPair& pair : found_) {
        add(pair.first, pair.second);
    }
}

void OwnPairs::add_near(std::uint32_t first, std::uint32_t second) {
    // Nothing is known of its features.
    Near& near = near_.emplace_back();
    near.first = first;
    near.second = second;
    near.motion = above(static_cast<float>(motion_between(first, second)));
    list_.emplace_back();
}

/// Blocks without a list, whose features come near when `reach`, m, is used. 0: they are compared, now and in each step
/// that asks for it.
void OwnPairs::forget_list(std::uint32_t near, double reach) noexcept {
    near_[near].used = reach > 0.0 ? 0.0F : kNever;
    near_[near].reach = below(static_cast<float>(reach));
    near_[near].next = kNever;
    list_[near].edges = list_[near].end = list_[near].begin;
    list_[near].listed = 0.0F;
}

void OwnPairs::make_room_for_more() {
    then_.reserve(kMoreThanAtFirst * then_.size());
    free_then_.reserve(near_.capacity());
    make_room(kMoreThanAtFirst * (free_ + static_cast<std::uint32_t>(near_.size())));
    for (std::vector<GroupInTurn>& of : groups_) {
        of.reserve(group_.size());
    }
}

/// Visits the corners of both blocks, in order, by their vertices from the first one of the surface on.
template <class Visit>
void OwnPairs::for_each_corner(std::uint32_t near, const FeatureBlocks& blocks, const Visit& visit) const {
    for (const std::uint32_t v : blocks.corners_of(near_[near].first)) {
        visit(v - first_vertex_);
    }
    if (near_[near].second != near_[near].first) {
        for (const std::uint32_t v : blocks.corners_of(near_[near].second)) {
            visit(v - first_vertex_);
        }
    }
}

void OwnPairs::begin_list(std::uint32_t near, const FeatureBlocks& blocks) noexcept {
    near_[near].used = 0.0F;
    near_[near].next = kNever;
    for (Listed& of : new_) {
        of.until.clear();
        of.feature.clear();
    }
    std::uint8_t corner = 0;
    for_each_corner(near, blocks, [&](std::uint32_t v) { corner_index_[v] = corner++; });
}

void OwnPairs::list(std::uint32_t near, PairKind kind, const PairVertices& vertex, double distance) {
    if (distance <= static_cast<double>(near_[near].reach)) {
        Listed& of = new_[kind == PairKind::VertexTriangle ? 0 : 1];
        of.until.push_back(below(static_cast<float>(distance)));
        Feature& feature = of.feature.emplace_back();
        for (std::size_t k = 0; k < vertex.size(); ++k) {
            feature[k] = corner_index_[vertex[k] - first_vertex_];
        }
        near_[near].next = std::min(near_[near].next, of.until.back());
    }
}

/// Writes the list where its last one was, or behind all others.
void OwnPairs::end_list(std::uint32_t near, const FeatureBlocks& blocks) {
    keep_corners(near, blocks);
    List& list = list_[near];
    const auto in_groups = [](std::size_t size) { return static_cast<std::uint32_t>((size + kGroup - 1) / kGroup); };
    const std::uint32_t size = in_groups(new_[0].until.size()) + in_groups(new_[1].until.size());
    if (size > list.room) {
        const std::uint32_t room = size + size / 2;
        list.room = 0;
        make_room(room);
        list.begin = free_;
        list.room = room;
        free_ += room;
    }
    list.edges = list.begin + in_groups(new_[0].until.size());
    list.end = list.begin + size;
    write_list(new_[0], near_[near].reach, list.begin, list.edges);
    write_list(new_[1], near_[near].reach, list.edges, list.end);
}

/// Writes pairs of one kind into groups, roughly in the order of their distances, so that groups are due as a whole.
void OwnPairs::write_list(const Listed& listed, float reach, std::uint32_t begin, std::uint32_t end) noexcept {
    for (std::uint32_t g = begin; g < end; ++g) {
        std::ranges::fill(group_[g].until, kNever);
        least_of_group_[g] = kNever;
    }
    std::array<std::uint32_t, kSorts + 1> next{};
    const auto sort_of = [&](float distance) {
        return std::min(static_cast<std::size_t>(distance * (static_cast<float>(kSorts) / reach)), kSorts - 1);
    };
    for (const float distance : listed.until) {
        ++next[sort_of(distance) + 1];
    }
    for (std::size_t k = 1; k < next.size(); ++k) {
        next[k] += next[k - 1];
    }
    for (std::size_t k = 0; k < listed.until.size(); ++k) {
        const float distance = listed.until[k];
        const std::uint32_t at = next[sort_of(distance)]++;
        PairGroup& group = group_[begin + at / kGroup];
        group.until[at % kGroup] = distance;
        group.feature[at % kGroup] = listed.feature[k];
        float& least = least_of_group_[begin + at / kGroup];
        least = std::min(least, distance);
    }
}

void OwnPairs::fetch_corners(std::uint32_t near) const noexcept {
    if (list_[near].listed > 0.0F) {
        for (std::size_t k = 0; k < most_corners_; k += 4) {
            __builtin_prefetch(then_.data() + list_[near].then + k);
        }
    }
}

/// Keeps the places of both blocks' corners at the start of the motion, for which the list is made.
void OwnPairs::keep_corners(std::uint32_t near, const FeatureBlocks& blocks) {
    List& list = list_[near];
    if (list.then == kNone) {
        if (free_then_.empty()) {
            free_then_.push_back(static_cast<std::uint32_t>(then_.size()));
            then_.resize(then_.size() + most_corners_);
        }
        list.then = free_then_.back();
        free_then_.pop_back();
    }
    list.listed = near_[near].reach;
    list.orientation = orientation_[near_[near].first];
    Four* to = then_.data() + list.then;
    const Four centre = motion_[near_[near].first].centre;
    for_each_corner(near, blocks, [&](std::uint32_t v) { *to++ = corner_[v].place - centre; });
}

/// m, how far a corner of near blocks is from where it was when they were listed, after a common motion: at most.
double OwnPairs::farthest_from_list(std::uint32_t near, const FeatureBlocks& blocks) const noexcept {
    // Turned as the first block has since, and then as fits best.
    const List& list = list_[near];
    const std::uint32_t block = near_[near].first;
    const Quat guess = orientation_[block] * glm::conjugate(list.orientation);
    const Turned guessed(guess);
    const Four* then = then_.data() + list.then;
    const Four centre = motion_[block].centre;
    MotionSums sums;
    for_each_corner(near, blocks, [&](std::uint32_t v) {
        const Four place = guessed(*then++);
        sums.add(place, corner_[v].place - centre - place);
    });
    const Quat turn = rotation_by(sums.turn());
    const Turned turned(turn * guess);
    const Four middle = centre + four_of(sums.centre() + sums.way() - turn * sums.centre());
    Four most{};
    then = then_.data() + list.then;
    for_each_corner(near, blocks, [&](std::uint32_t v) {
        most = greatest(square_of(corner_[v].place - middle - turned(*then++)), most);
    });
    return std::sqrt(static_cast<double>(most[0])) + 4.0 * rounding_of_places_;
}

void OwnPairs::find_due(const FeatureBlocks& blocks, double apart, std::array<Due, 2>& due) {
    // Lists with pairs that are due, and of these groups. What surfaces know of their pairs does not fit the memory
    // that is next to a processor, so it is fetched in advance.
    const float gap = above(static_cast<float>(apart));
    const auto used_then = [&](const Near& near) { return above(near.used + near.motion + gap); };
    in_turn_.clear();
    for (std::uint32_t n = 0; n < near_.size(); ++n) {
        if (near_[n].next < kNever && near_[n].next <= used_then(near_[n]) && is_new(n)) {
            __builtin_prefetch(&list_[n]);
            in_turn_.push_back(n);
        }
    }
    for (std::vector<GroupInTurn>& of : groups_) {
        of.clear();
    }
    for (std::size_t k = 0; k < in_turn_.size(); ++k) {
        if (k + kAhead < in_turn_.size()) {
            const List& ahead = list_[in_turn_[k + kAhead]];
            __builtin_prefetch(&least_of_group_[ahead.begin]);
            __builtin_prefetch(&least_of_group_[ahead.end - 1]);
        }
        const std::uint32_t n = in_turn_[k];
        Near& near = near_[n];
        const List& list = list_[n];
        const float then = used_then(near);
        near.next = kNever;
        for (std::uint32_t g = list.begin; g < list.end; ++g) {
            if (least_of_group_[g] <= then) {
                groups_[g < list.edges ? 0 : 1].push_back({n, g, then});
                __builtin_prefetch(&group_[g]);
            } else {
                near.next = std::min(near.next, least_of_group_[g]);
            }
        }
    }
    for (std::size_t kind = 0; kind < due.size(); ++kind) {
        Due& of = due[kind];
        const std::vector<GroupInTurn>& groups = groups_[kind];
        of.vertices.clear();
        of.vertices.make_room(kGroup * groups.size());
        of.place.clear();
        for (const GroupInTurn& group : groups) {
            take_due(group, blocks, of);
        }
    }
}

/// Takes those of a group that are due.
void OwnPairs::take_due(const GroupInTurn& in_turn, const FeatureBlocks& blocks, Due& due) {
    Near& near = near_[in_turn.near];
    const std::span<const std::uint32_t> first = blocks.corners_of(near.first);
    const std::span<const std::uint32_t> second = blocks.corners_of(near.second);
    const auto vertex_of = [&](std::size_t corner) {
        return corner < first.size() ? first[corner] : second[corner - first.size()];
    };
    const PairGroup& group = group_[in_turn.group];
    std::uint32_t is_due = 0;
    float next = kNever;
    for (std::uint32_t k = 0; k < kGroup; ++k) {
        is_due |= (group.until[k] <= in_turn.then ? 1U : 0U) << k;
        next = std::min(next, group.until[k] <= in_turn.then ? kNever : group.until[k]);
    }
    least_of_group_[in_turn.group] = next;
    near.next = std::min(near.next, next);
    for (; is_due != 0; is_due &= is_due - 1) {
        const auto k = static_cast<std::uint32_t>(std::countr_zero(is_due));
        const Feature corner = group.feature[k];
        due.vertices.add(true, vertex_of(corner[0]), vertex_of(corner[1]), vertex_of(corner[2]), vertex_of(corner[3]));
        due.place.push_back({in_turn.near, in_turn.group * kGroup + k});
    }
}

/// Sees to it that so many groups have room behind all lists: closes what is left between them, or allocates.
void OwnPairs::make_room(std::uint32_t groups) {
    if (free_ + groups <= group_.size()) {
        return;
    }
    order_.clear();
    for (std::uint32_t n = 0; n < list_.size(); ++n) {
        if (list_[n].room > 0) {
            order_.push_back(n);
        }
    }
    std::ranges::sort(order_, {}, [&](std::uint32_t n) { return list_[n].begin; });
    free_ = 0;
    for (const std::uint32_t n : order_) {
        List& of = list_[n];
        of.room = of.end - of.begin;
        std::copy_n(group_.begin() + of.begin, of.room, group_.begin() + free_);
        std::copy_n(least_of_group_.begin() + of.begin, of.room, least_of_group_.begin() + free_);
        of.edges -= of.begin - free_;
        of.begin = free_;
        free_ += of.room;
        of.end = free_;
    }
    if (free_ + groups > group_.size()) {
        group_.resize(std::size_t{2} * (free_ + groups));
        least_of_group_.resize(group_.size());
    }
}

void OwnPairs::set_distance(const Due::Place& place, double distance) noexcept {
    Near& near = near_[place.near];
    const float until = below(near.used + static_cast<float>(distance));
    group_[place.feature / kGroup].until[place.feature % kGroup] = until;
    float& least = least_of_group_[place.feature / kGroup];
    least = std::min(least, until);
    near.next = std::min(near.next, until);
}

void OwnPairs::advance() noexcept {
    for (std::size_t k = 0; k < motion_.size(); ++k) {
        path_[k] += motion_[k].in_surface;
        orientation_[k] = glm::normalize(rotation_by(vector_of(motion_[k].turn)) * orientation_[k]);
    }
    for (Near& near : near_) {
        near.used = above(near.used + near.motion);
    }
}

}  // namespace haptic::sim
