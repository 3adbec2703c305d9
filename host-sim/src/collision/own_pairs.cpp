#include "collision/own_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <utility>

#include "simd/lanes.hpp"

namespace haptic::sim {
namespace {

// Lists are made to last for some steps. Of the mean edge: their least and greatest reach, if one step needs no more.
constexpr double kStepsOfList = 4.0;
constexpr double kLeastReachOfEdge = 0.375;
constexpr double kGreatestReaches = 2.0;
// Of the least reach: blocks whose boxes are farther apart are not near any more, and how far others are searched for.
constexpr double kLeavesAtReaches = 4.0;
constexpr double kHorizonInReaches = 12.0;
// A search is to last for at least so many steps.
constexpr double kStepsOfSearch = 16.0;
// Room: pairs of blocks, and of features of two blocks.
constexpr std::size_t kNearPerBlock = 64;
constexpr std::size_t kFarPerBlock = 256;
constexpr std::uint32_t kMoreThanAtFirst = 3;  // of listed features, where a surface moves
constexpr std::size_t kMostOfBlocks = 2 * FeatureBlocks::kMaxOfTwoBlocks;
// Of lengths within a block: more than what sums of floats lose.
constexpr double kRoundingInBlock = 4e-6;
// Of the squares of its corners' distances: corners in a line have no moment about it.
constexpr double kLeastMoment = 1e-6;
constexpr double kNever = std::numeric_limits<double>::infinity();

/// The turn that fits ways best, of points about their centre: `moment` is the sum of r.r I - r r^T, `angular` that of
/// r x way.
Vec3 best_turn(const Mat3& moment, const Vec3& angular) {
    Mat3 regular = moment;
    const double least = kLeastMoment * (moment[0][0] + moment[1][1] + moment[2][2]);
    for (int k = 0; k < 3; ++k) {
        regular[k][k] += least;
    }
    const double determinant = glm::determinant(regular);
    return determinant > 0.0 ? glm::inverse(regular) * angular : Vec3(0.0);
}

/// Adds a point at r from the centre.
void add_moment(Mat3& moment, const Vec3& r) noexcept {
    const double square = glm::dot(r, r);
    for (int k = 0; k < 3; ++k) {
        moment[k] -= r[k] * r;
        moment[k][k] += square;
    }
}

std::uint64_t key_of(std::uint32_t first, std::uint32_t second) noexcept {
    return (static_cast<std::uint64_t>(first) << 32U) | second;
}

}  // namespace

OwnPairs::OwnPairs(const FeatureBlocks& blocks, std::uint32_t first_block, std::uint32_t count, double edge)
    : first_block_(first_block),
      least_reach_(kLeastReachOfEdge * edge),
      motion_(count),
      is_new_(count, 1),
      path_(count, 0.0),
      margin_(count, 0.0),
      sweep_(count),
      bounds_(count) {
    // The blocks that have a vertex as a corner.
    std::vector<std::pair<std::uint32_t, std::uint32_t>> corners;
    for (std::uint32_t k = 0; k < count; ++k) {
        for (const std::uint32_t v : blocks.corners_of(first_block + k)) {
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
    // Room for what usual surfaces need; more allocates.
    new_until_.reserve(kMostOfBlocks);
    new_feature_.reserve(kMostOfBlocks);
    for (std::vector<std::uint32_t>* of : {&to_list_, &to_compare_, &order_}) {
        of->reserve(kNearPerBlock * count);
    }
    near_.reserve(kNearPerBlock * count);
    known_.reserve(kNearPerBlock * count);
    far_.reserve(std::min<std::size_t>(kFarPerBlock, count) * count);
    found_.reserve(far_.capacity() + near_.capacity());
}

void OwnPairs::fit_motion(Motion& motion, const Corners& corners) noexcept {
    using FourFloats = LaneTypes<Corners::kLanes, float>::Real;
    const auto sum_of = [](const FourFloats& x) { return static_cast<double>((x[0] + x[1]) + (x[2] + x[3])); };
    const auto at = [](const float (&row)[Corners::kLength], std::size_t c) { return load<FourFloats>(row + c); };
    const std::size_t count = corners.whole();
    // Sums about the first corner, to which those that fill the last vector add nothing.
    FourFloats place[3] = {};
    FourFloats way[3] = {};
    FourFloats square[3] = {};
    FourFloats mixed[3] = {};
    FourFloats angular[3] = {};
    FourFloats low[3] = {};
    FourFloats high[3] = {};
    for (std::size_t c = 0; c < count; c += Corners::kLanes) {
        for (std::size_t k = 0; k < 3; ++k) {
            const std::size_t next = (k + 1) % 3;
            const std::size_t last = (k + 2) % 3;
            const FourFloats x = at(corners.start[k], c);
            place[k] += x;
            way[k] += at(corners.way[k], c);
            square[k] += x * x;
            mixed[k] += at(corners.start[next], c) * at(corners.start[last], c);
            angular[k] += at(corners.start[next], c) * at(corners.way[last], c) -
                          at(corners.start[last], c) * at(corners.way[next], c);
            low[k] = x < low[k] ? x : low[k];
            high[k] = x > high[k] ? x : high[k];
        }
    }
    const auto vector_of_sums = [&](const FourFloats(&x)[3]) { return Vec3(sum_of(x[0]), sum_of(x[1]), sum_of(x[2])); };
    const double share = 1.0 / static_cast<double>(corners.count);
    const Vec3 centre = share * vector_of_sums(place);
    const Vec3 mean = share * vector_of_sums(way);
    // About the centre.
    const Vec3 squares = vector_of_sums(square) - static_cast<double>(corners.count) * centre * centre;
    const Vec3 products =
        vector_of_sums(mixed) -
        static_cast<double>(corners.count) * Vec3(centre.y * centre.z, centre.z * centre.x, centre.x * centre.y);
    const Mat3 moment{squares.y + squares.z, -products.z, -products.y, -products.z,          squares.z + squares.x,
                      -products.x,           -products.y, -products.x, squares.x + squares.y};
    motion.turn =
        best_turn(moment, vector_of_sums(angular) - static_cast<double>(corners.count) * glm::cross(centre, mean));
    // What is left.
    const auto rounded = [](const Vec3& x, float (&to)[3]) {
        for (int k = 0; k < 3; ++k) {
            to[k] = static_cast<float>(x[k]);
        }
    };
    float turn[3];
    float middle[3];
    float middle_way[3];
    rounded(motion.turn, turn);
    rounded(centre, middle);
    rounded(mean, middle_way);
    FourFloats farthest{};
    FourFloats most{};
    for (std::size_t c = 0; c < count; c += Corners::kLanes) {
        FourFloats r[3];
        for (std::size_t k = 0; k < 3; ++k) {
            r[k] = at(corners.start[k], c) - middle[k];
        }
        FourFloats left{};
        for (std::size_t k = 0; k < 3; ++k) {
            const std::size_t next = (k + 1) % 3;
            const std::size_t last = (k + 2) % 3;
            const FourFloats of = at(corners.way[k], c) - middle_way[k] - (turn[next] * r[last] - turn[last] * r[next]);
            left += of * of;
        }
        const FourFloats distance = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
        most = left > most ? left : most;
        farthest = distance > farthest ? distance : farthest;
    }
    const auto greatest = [](const FourFloats& x) {
        return std::sqrt(static_cast<double>(std::max(std::max(x[0], x[1]), std::max(x[2], x[3]))));
    };
    const auto least_of = [](const FourFloats& x) { return std::min(std::min(x[0], x[1]), std::min(x[2], x[3])); };
    const auto most_of = [](const FourFloats& x) { return std::max(std::max(x[0], x[1]), std::max(x[2], x[3])); };
    motion.radius = (1.0 + kRoundingInBlock) * greatest(farthest);
    motion.rest = greatest(most) + kRoundingInBlock * (motion.radius + glm::length(mean) + glm::length(centre));
    motion.centre = corners.first + centre;
    motion.way = corners.first_way + mean;
    for (int k = 0; k < 3; ++k) {
        const double slack = kRoundingInBlock * motion.radius;
        motion.low[k] = corners.first[k] + static_cast<double>(least_of(low[k])) - slack;
        motion.high[k] = corners.first[k] + static_cast<double>(most_of(high[k])) + slack;
    }
}

/// The frame of the whole surface.
void OwnPairs::find_frame() noexcept {
    const double share = 1.0 / static_cast<double>(motion_.size());
    frame_ = {};
    for (const Motion& of : motion_) {
        frame_.centre += share * of.centre;
        frame_.way += share * of.way;
    }
    Mat3 moment(0.0);
    Vec3 angular(0.0);
    for (const Motion& of : motion_) {
        add_moment(moment, of.centre - frame_.centre);
        angular += glm::cross(of.centre - frame_.centre, of.way);
    }
    frame_.turn = best_turn(moment, angular);
}

/// Of new blocks in the frame of the surface, and between those that are near.
void OwnPairs::find_motions() noexcept {
    longest_path_ = longest_motion_ = 0.0;
    for (std::size_t k = 0; k < motion_.size(); ++k) {
        Motion& of = motion_[k];
        if (is_new_[k] != 0) {
            of.in_surface = glm::length(of.way - frame_.way - glm::cross(frame_.turn, of.centre - frame_.centre)) +
                            of.radius * glm::length(of.turn - frame_.turn) + of.rest;
        }
        longest_motion_ = std::max(longest_motion_, of.in_surface);
        longest_path_ = std::max(longest_path_, path_[k] + of.in_surface);
    }
    for (std::uint32_t n = 0; n < near_.size(); ++n) {
        if (is_new(n)) {
            near_[n].motion = motion_between(near_[n].first, near_[n].second);
        }
    }
}

double OwnPairs::distance_of_boxes(std::uint32_t first, std::uint32_t second) const noexcept {
    const Motion& a = motion_[first];
    const Motion& b = motion_[second];
    return glm::length(glm::max(glm::max(a.low - b.high, b.low - a.high), Vec3(0.0)));
}

/// m, that two points of the blocks come nearer over the motion, at most.
double OwnPairs::motion_between(std::uint32_t first, std::uint32_t second) const noexcept {
    const Motion& a = motion_[first];
    const Motion& b = motion_[second];
    if (first == second) {
        return 2.0 * a.rest;
    }
    const Vec3 between = b.centre - a.centre;
    const Vec3 way = b.way - a.way;
    const double turn = glm::length(b.turn - a.turn);
    return a.rest + b.rest +
           std::min(glm::length(way - glm::cross(a.turn, between)) + turn * b.radius,
                    glm::length(way - glm::cross(b.turn, between)) + turn * a.radius);
}

void OwnPairs::find_near(double apart) {
    to_list_.clear();
    to_compare_.clear();
    // Blocks beyond the horizon.
    const double near = kLeavesAtReaches * least_reach_;
    if (2.0 * longest_path_ + near + apart > horizon_) {
        search(apart);
    }
    // Far blocks: those whose distance may be used up have become near, or have another distance.
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
        far_[left++] = pair;
    }
    far_.resize(left);
    // Near blocks.
    for (std::uint32_t n = 0; n < near_.size(); ++n) {
        Near& of = near_[n];
        if (is_new(n) && of.used + of.motion + apart >= of.reach) {
            // Without a list while their boxes are far enough.
            if (const double distance = distance_of_boxes(of.first, of.second);
                distance > std::max(least_reach_, of.motion + apart)) {
                begin_list(n);
                of.reach = distance;
                continue;
            }
            if (of.motion + apart > kGreatestReaches * least_reach_) {
                begin_list(n);
                of.used = kNever;
                to_compare_.push_back(n);
                continue;
            }
            of.reach = std::clamp(kStepsOfList * of.motion, least_reach_, kGreatestReaches * least_reach_);
            margin_[of.first] = margin_[of.second] = 0.0;
            to_list_.push_back(n);
        }
    }
    for (const std::uint32_t n : to_list_) {
        for (const std::uint32_t block : {near_[n].first, near_[n].second}) {
            margin_[block] = std::max(margin_[block], 0.5 * near_[n].reach);
        }
    }
}

/// Finds all far blocks, and those that have become near, at the start of the motion.
void OwnPairs::search(double apart) {
    std::ranges::fill(path_, 0.0);
    longest_path_ = longest_motion_;
    horizon_ = std::max(kHorizonInReaches * least_reach_,
                        kLeavesAtReaches * least_reach_ + apart + 2.0 * kStepsOfSearch * longest_motion_);
    // Between the searches of a step near blocks keep their numbers.
    if (std::ranges::find(is_new_, 0) == is_new_.end()) {
        std::erase_if(near_, [&](const Near& near) {
            return distance_of_boxes(near.first, near.second) > kLeavesAtReaches * least_reach_;
        });
    }
    known_.clear();
    for (const Near& near : near_) {
        known_.push_back(key_of(near.first, near.second));
    }
    std::ranges::sort(known_);
    far_.clear();
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
        bounds_[k] = bounds_of({motion_[k].low - half, motion_[k].high + half});
        add(k, k);
    }
    sweep_.find(bounds_, found_);
    for (const BodyPair& pair : found_) {
        add(pair.first, pair.second);
    }
}

void OwnPairs::add_near(std::uint32_t first, std::uint32_t second) {
    // Nothing is known of its features.
    near_.emplace_back();
    near_.back().first = first;
    near_.back().second = second;
    near_.back().used = kNever;
    near_.back().motion = motion_between(first, second);
}

void OwnPairs::make_room_for_more() {
    make_room(kMoreThanAtFirst * (free_ + static_cast<std::uint32_t>(near_.size())));
}

void OwnPairs::begin_list(std::uint32_t near) noexcept {
    near_[near].used = 0.0;
    near_[near].next = kNever;
    near_[near].size = 0;
    new_until_.clear();
    new_feature_.clear();
}

void OwnPairs::list(std::uint32_t near, PairKind kind, const PairVertices& vertex, double distance) {
    if (Near& of = near_[near]; distance <= of.reach) {
        new_until_.push_back(distance);
        new_feature_.push_back({vertex, kind});
        of.next = std::min(of.next, distance);
    }
}

/// Writes the list where its last one was, or behind all others.
void OwnPairs::end_list(std::uint32_t near) {
    const auto size = static_cast<std::uint32_t>(new_until_.size());
    if (size > near_[near].room) {
        const std::uint32_t room = size + size / 2;
        near_[near].room = 0;
        make_room(room);
        near_[near].begin = free_;
        near_[near].room = room;
        free_ += room;
    }
    std::ranges::copy(new_until_, until_.begin() + near_[near].begin);
    std::ranges::copy(new_feature_, feature_.begin() + near_[near].begin);
    near_[near].size = size;
}

/// Sees to it that so many features have room behind all lists: closes what is left between them, or allocates.
void OwnPairs::make_room(std::uint32_t features) {
    if (free_ + features <= until_.size()) {
        return;
    }
    order_.clear();
    for (std::uint32_t n = 0; n < near_.size(); ++n) {
        if (near_[n].room > 0) {
            order_.push_back(n);
        }
    }
    std::ranges::sort(order_, {}, [&](std::uint32_t n) { return near_[n].begin; });
    free_ = 0;
    for (const std::uint32_t n : order_) {
        Near& of = near_[n];
        std::copy_n(until_.begin() + of.begin, of.size, until_.begin() + free_);
        std::copy_n(feature_.begin() + of.begin, of.size, feature_.begin() + free_);
        of.begin = free_;
        of.room = of.size;
        free_ += of.room;
    }
    if (free_ + features > until_.size()) {
        until_.resize(std::size_t{2} * (free_ + features));
        feature_.resize(until_.size());
    }
}

void OwnPairs::set_distance(std::uint32_t near, std::uint32_t feature, double distance) noexcept {
    Near& of = near_[near];
    until_[feature] = of.used + distance;
    of.next = std::min(of.next, until_[feature]);
}

void OwnPairs::advance() noexcept {
    for (std::size_t k = 0; k < motion_.size(); ++k) {
        path_[k] += motion_[k].in_surface;
    }
    for (Near& near : near_) {
        near.used += near.motion;
    }
}

}  // namespace haptic::sim
