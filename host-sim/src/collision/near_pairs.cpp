#include "collision/near_pairs.hpp"

#include <algorithm>
#include <limits>

namespace haptic::sim {
namespace {

// Room behind rows that vectors read: a whole one.
constexpr std::size_t kPadding = 16;
// Pairs of bodies for which there is room, per body; more allocate.
constexpr std::size_t kBodiesNear = 64;
// So many boxes are compared with one another faster than they are sorted.
constexpr std::size_t kMaxUnsorted = 256;
// Margin of the boxes of a search, of their longest side. More keeps its pairs longer, and finds more of them.
constexpr float kMargin = 0.125F;
constexpr float kFar = std::numeric_limits<float>::max();
// m: a gap that is larger is one from a box that holds nothing.
constexpr auto kMostGap = static_cast<float>(NearPairs::kMaxCoordinate);

using Four = LaneTypes<4, float>::Real;

/// Whether two pairs of three numbers are in order; the fourth ones are 0.
bool in_order(const float* low, const float* high, const float* other_low, const float* other_high) noexcept {
    const auto holds = (load<Four>(low) <= load<Four>(high)) & (load<Four>(other_low) <= load<Four>(other_high));
    std::int64_t bits[2];
    __builtin_memcpy(bits, &holds, sizeof bits);
    return (bits[0] & bits[1]) == -1;
}

/// m, the largest along an axis of the gaps between two boxes; 0: they overlap.
template <class Box>
float gap_between(const Box& first, const Box& second) noexcept {
    const Four after = load<Four>(first.low) - load<Four>(second.high);
    const Four before = load<Four>(second.low) - load<Four>(first.high);
    const Four gap = after > before ? after : before;
    return std::max(std::max(gap[0], gap[1]), std::max(gap[2], 0.0F));
}

Bounds box_of(const ColliderRows& rows, std::size_t particle) noexcept {
    Bounds box{};
    for (std::size_t k = 0; k < 3; ++k) {
        box.low[k] = rows[collider_row::kLow + k][particle];
        box.high[k] = rows[collider_row::kHigh + k][particle];
    }
    return box;
}

RoundedBox rounded(const Bounds& box) noexcept {
    RoundedBox result{};
    for (std::size_t k = 0; k < 3; ++k) {
        result.number[k] = static_cast<float>(box.low[k]);
        result.number[k + 3] = static_cast<float>(box.high[k]);
    }
    return result;
}

/// Number of particles of the largest body.
std::size_t largest(const std::vector<ParticleRange>& bodies) noexcept {
    std::size_t most = 0;
    for (const ParticleRange& body : bodies) {
        most = std::max<std::size_t>(most, body.end - body.begin);
    }
    return most;
}

}  // namespace

NearPairs::Boxes::Boxes(std::size_t size)
    : length((size + 2 * kPadding - 1) / kPadding * kPadding), number(kRows * length) {}

void NearPairs::Boxes::set(std::size_t at, const Boxes& from, std::size_t index) noexcept {
    for (std::size_t k = 0; k < kRows; ++k) {
        number[k * length + at] = from.number[k * from.length + index];
    }
}

BoxRows NearPairs::Boxes::rows() const noexcept {
    return {number.data(), length};
}

NearPairs::Scratch::Scratch(std::size_t largest_body)
    : outer(largest_body + kPadding),
      inner(largest_body + kPadding),
      hits(largest_body + kPadding),
      boxes(largest_body) {
    order.reserve(largest_body);
}

NearPairs::NearPairs(std::vector<ParticleRange> bodies, std::size_t capacity, const ColliderKernels& kernels)
    : kernels_(kernels),
      bodies_(std::move(bodies)),
      sweep_(bodies_.size()),
      box_(bodies_.empty() ? 0 : bodies_.back().end),
      pair_(capacity),
      place_(capacity),
      wide_(box_.size()),
      wide_rows_(box_.size()),
      wide_body_(bodies_.size()),
      kept_pair_(capacity),
      apart_until_(capacity),
      scratch_(largest(bodies_)) {
    const std::size_t near = kBodiesNear * bodies_.size();
    bodies_near_.reserve(near);
    kept_bodies_.reserve(near);
    range_.reserve(near);
    kept_range_.reserve(near);
}

std::span<const NearPairs::Pair> NearPairs::find_bodies(std::span<const Bounds> box) {
    sweep_.find(box, bodies_near_);
    return bodies_near_;
}

/// Rounds all boxes; those that cannot collide become boxes that hold nothing.
void NearPairs::round_boxes(const ColliderRows& rows) noexcept {
    using namespace collider_row;
    const double* const low[] = {rows[kLow], rows[kLow + 1], rows[kLow + 2]};
    const double* const high[] = {rows[kHigh], rows[kHigh + 1], rows[kHigh + 2]};
    const double* const size = rows[kSize];
    for (std::size_t i = 0; i < box_.size(); ++i) {
        const bool usable = (size[i] > 0.0) & (low[0][i] > -kMaxCoordinate) & (low[1][i] > -kMaxCoordinate) &
                            (low[2][i] > -kMaxCoordinate) & (high[0][i] < kMaxCoordinate) &
                            (high[1][i] < kMaxCoordinate) & (high[2][i] < kMaxCoordinate);
        for (std::size_t k = 0; k < 3; ++k) {
            box_[i].low[k] = usable ? static_cast<float>(low[k][i]) : kFar;
            box_[i].high[k] = usable ? static_cast<float>(high[k][i]) : -kFar;
        }
    }
}

/// Whether all particles that have something near are within the boxes of the last search.
bool NearPairs::are_within_wide(std::span<const std::int64_t> near) const noexcept {
    for (std::size_t i = 0; i < box_.size(); ++i) {
        if ((near.empty() || near[i] != 0) && !in_order(wide_[i].low, box_[i].low, box_[i].high, wide_[i].high)) {
            return false;
        }
    }
    return true;
}

void NearPairs::find_particles(const ColliderRows& rows, std::span<const std::int64_t> near) {
    range_.assign(bodies_near_.size(), {});
    dropped_ = 0;
    if (bodies_near_.empty()) {
        return;
    }
    round_boxes(rows);
    if (!kept_ || !are_within_wide(near)) {
        search(kMargin);
        if (!kept_) {  // without a margin there may be room
            search(0.0F);
        }
    }
    choose(rows);
}

/// Finds all pairs of boxes with a margin, of their longest side.
void NearPairs::search(float margin) {
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        Bounds& bounds = wide_body_[b] = {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
        for (std::size_t i = bodies_[b].begin; i < bodies_[b].end; ++i) {
            const Box& box = box_[i];
            const float side =
                std::max({box.high[0] - box.low[0], box.high[1] - box.low[1], box.high[2] - box.low[2], 0.0F});
            const float around = margin * side;
            for (std::size_t k = 0; k < 3; ++k) {
                const float low = wide_[i].low[k] = box.low[k] - around;
                const float high = wide_[i].high[k] = box.high[k] + around;
                wide_rows_.number[k * wide_rows_.length + i] = low;
                wide_rows_.number[(k + 3) * wide_rows_.length + i] = high;
                bounds.low[k] = std::min<double>(bounds.low[k], low);
                bounds.high[k] = std::max<double>(bounds.high[k], high);
            }
        }
    }
    sweep_.find(wide_body_, kept_bodies_);
    kept_range_.clear();
    kept_pairs_ = 0;
    dropped_ = 0;
    for (const Pair& bodies : kept_bodies_) {
        const auto begin = static_cast<std::uint32_t>(kept_pairs_);
        search_bodies(bodies);
        kept_range_.push_back({begin, static_cast<std::uint32_t>(kept_pairs_)});
    }
    kept_ = dropped_ == 0 && margin > 0.0F;
    std::fill_n(apart_until_.begin(), kept_pairs_, 0.0);
}

/// Of the pairs that were found, those whose present boxes overlap and that are not known to be apart.
void NearPairs::choose(const ColliderRows& rows) {
    const auto order = [](const Pair& p) { return std::pair(p.first, p.second); };
    const double* const travel = rows[collider_row::kTravelToEnd];
    const Pair* const kept_pair = kept_pair_.data();
    double* const apart_until = apart_until_.data();
    std::uint32_t found = 0;
    std::size_t kept = 0;
    for (std::size_t k = 0; k < bodies_near_.size(); ++k) {
        range_[k] = {found, found};
        // Both lists are in order. Bodies that are near without any of their particles may be missing from the kept.
        while (kept < kept_bodies_.size() && order(kept_bodies_[kept]) < order(bodies_near_[k])) {
            ++kept;
        }
        if (kept == kept_bodies_.size() || order(kept_bodies_[kept]) != order(bodies_near_[k])) {
            continue;
        }
        const ParticleRange all = kept_range_[kept];
        for (std::uint32_t p = all.begin; p < all.end; ++p) {
            const Pair pair = kept_pair[p];
            if (travel[pair.first] + travel[pair.second] < apart_until[p]) {
                continue;
            }
            // Rounded boxes first; what is left exactly.
            const float gap = gap_between(box_[pair.first], box_[pair.second]);
            if (gap > 0.0F) {
                apart_until[p] = gap < kMostGap ? travel_until(pair, gap, rows) : 0.0;
            } else if (overlap(box_of(rows, pair.first), box_of(rows, pair.second))) {
                place_[found] = p;
                pair_[found++] = pair;
            }
        }
        range_[k].end = found;
    }
}

/// Writes those particles of a body that reach into a box; returns their number.
std::size_t NearPairs::reaching_into(const RoundedBox& box, const ParticleRange& body,
                                     std::vector<std::uint32_t>& particles) const {
    return kernels_.find_overlaps(wide_rows_.rows(), box, body.begin, body.end, particles.data());
}

/// The box around the first so many particles; of none, one that nothing overlaps.
RoundedBox NearPairs::around(const std::vector<std::uint32_t>& particles, std::size_t count) const {
    RoundedBox box{{kFar, kFar, kFar, -kFar, -kFar, -kFar}};
    // Six minima and maxima side by side, which need not wait for one another.
    const BoxRows rows = wide_rows_.rows();
    for (std::size_t p = 0; p < count; ++p) {
        for (std::size_t k = 0; k < 3; ++k) {
            box.number[k] = std::min(box.number[k], rows[k][particles[p]]);
            box.number[k + 3] = std::max(box.number[k + 3], rows[k + 3][particles[p]]);
        }
    }
    return box;
}

void NearPairs::search_bodies(const Pair& bodies) {
    Scratch& s = scratch_;
    // The particles of each body that reach into the box of the other, then of those of the other that do.
    const auto [first, second] = bodies;
    std::size_t outer = reaching_into(rounded(wide_body_[second]), bodies_[first], s.outer);
    const std::size_t inner = reaching_into(around(s.outer, outer), bodies_[second], s.inner);
    outer = reaching_into(around(s.inner, inner), bodies_[first], s.outer);
    if (outer == 0 || inner == 0) {
        return;
    }
    // The boxes of the second body side by side; in order along an axis if they are many.
    const auto number = [&](std::size_t row, std::size_t particle) {
        return wide_rows_.number[row * wide_rows_.length + particle];
    };
    std::size_t axis = 0;
    float longest = 0.0F;
    s.order.clear();
    if (inner > kMaxUnsorted) {
        axis = widest_axis(inner, [&](std::size_t at, std::size_t row) { return number(row, s.inner[at]); });
        for (std::size_t at = 0; at < inner; ++at) {
            const float low = number(axis, s.inner[at]);
            s.order.emplace_back(low, s.inner[at]);
            longest = std::max(longest, number(axis + 3, s.inner[at]) - low);
        }
        std::ranges::sort(s.order);
        std::ranges::transform(s.order, s.inner.begin(), &std::pair<float, std::uint32_t>::second);
    }
    for (std::size_t at = 0; at < inner; ++at) {
        s.boxes.set(at, wide_rows_, s.inner[at]);
    }
    // One after the other of the first body against them.
    for (std::size_t o = 0; o < outer; ++o) {
        const std::uint32_t particle = s.outer[o];
        RoundedBox near{};
        for (std::size_t row = 0; row < kRows; ++row) {
            near.number[row] = number(row, particle);
        }
        std::size_t begin = 0;
        std::size_t end = inner;
        if (!s.order.empty()) {
            // Those that begin neither so early that they end before it, nor after its end. Twice the longest: the
            // difference is rounded.
            const auto by_low = &std::pair<float, std::uint32_t>::first;
            const auto from = std::ranges::lower_bound(s.order, near.number[axis] - 2.0F * longest, {}, by_low);
            const auto to = std::ranges::upper_bound(s.order, near.number[axis + 3], {}, by_low);
            begin = static_cast<std::size_t>(from - s.order.begin());
            end = static_cast<std::size_t>(to - s.order.begin());
        }
        std::size_t hits = kernels_.find_overlaps(s.boxes.rows(), near, begin, end, s.hits.data());
        // Those for which there is room, in the order of their particles.
        const std::size_t room = kept_pair_.size() - kept_pairs_;
        dropped_ += hits > room ? hits - room : 0;
        hits = std::min(hits, room);
        Pair* const pairs = kept_pair_.data() + kept_pairs_;
        for (std::size_t h = 0; h < hits; ++h) {
            pairs[h] = {particle, s.inner[s.hits[h]]};
        }
        if (!s.order.empty()) {
            std::ranges::sort(pairs, pairs + hits, {}, &Pair::second);
        }
        kept_pairs_ += hits;
    }
}

}  // namespace haptic::sim
