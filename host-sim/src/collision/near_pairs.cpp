#include "collision/near_pairs.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace haptic::sim {
namespace {

// Room behind rows that vectors read: a whole one.
constexpr std::size_t kPadding = 16;
// Pairs of bodies for which there is room, per body; more allocate.
constexpr std::size_t kBodiesNear = 64;
// So many boxes are compared with one another faster than they are sorted.
constexpr std::size_t kMaxUnsorted = 256;

bool overlap(const Bounds& a, const Bounds& b) noexcept {
    bool both = true;
    for (int k = 0; k < 3; ++k) {
        both &= (a.low[k] <= b.high[k]) & (b.low[k] <= a.high[k]);
    }
    return both;
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

/// The axis along which the minima of boxes are spread most.
template <class Low>
std::size_t widest_axis(std::size_t count, const Low& low) noexcept {
    std::size_t widest = 0;
    double longest = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        double first = std::numeric_limits<double>::max();
        double last = std::numeric_limits<double>::lowest();
        for (std::size_t k = 0; k < count; ++k) {
            first = std::min(first, static_cast<double>(low(k, axis)));
            last = std::max(last, static_cast<double>(low(k, axis)));
        }
        if (last - first > longest) {
            longest = last - first;
            widest = axis;
        }
    }
    return widest;
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
      order_(bodies_.size()),
      box_(bodies_.empty() ? 0 : bodies_.back().end),
      pair_(capacity),
      scratch_(largest(bodies_)) {
    std::iota(order_.begin(), order_.end(), 0U);
    const std::size_t near = kBodiesNear * bodies_.size();
    bodies_near_.reserve(near);
    found_.reserve(near);
    dropped_.reserve(near);
}

std::span<const NearPairs::Pair> NearPairs::find_bodies(std::span<const Bounds> box) {
    body_box_ = box;
    bodies_near_.clear();
    const std::size_t axis = widest_axis(box.size(), [&](std::size_t b, std::size_t k) { return box[b].low[k]; });
    // Insertion: little to do while the boxes keep their order.
    for (std::size_t k = 1; k < order_.size(); ++k) {
        for (std::size_t l = k; l > 0 && box[order_[l]].low[axis] < box[order_[l - 1]].low[axis]; --l) {
            std::swap(order_[l], order_[l - 1]);
        }
    }
    // Sweep: each with those that begin before it ends.
    for (std::size_t k = 0; k < order_.size(); ++k) {
        const Bounds& first = box[order_[k]];
        for (std::size_t l = k + 1; l < order_.size() && box[order_[l]].low[axis] <= first.high[axis]; ++l) {
            if (overlap(first, box[order_[l]])) {
                const auto [low, high] = std::minmax({order_[k], order_[l]});
                bodies_near_.push_back({low, high});
            }
        }
    }
    // Results must not depend on how the bodies lay before.
    std::ranges::sort(bodies_near_, {}, [](const Pair& p) { return std::pair(p.first, p.second); });
    return bodies_near_;
}

/// Rounds all boxes. Comparisons with what is not a number are false.
void NearPairs::round_boxes(const ColliderRows& rows) {
    for (std::size_t k = 0; k < 3; ++k) {
        std::copy_n(rows[collider_row::kLow + k], bodies_.back().end,
                    box_.number.begin() + static_cast<std::ptrdiff_t>(k * box_.length));
        std::copy_n(rows[collider_row::kHigh + k], bodies_.back().end,
                    box_.number.begin() + static_cast<std::ptrdiff_t>((k + 3) * box_.length));
    }
    using namespace collider_row;
    const double* const row[] = {rows[kSize],     rows[kLow],  rows[kLow + 1], rows[kLow + 2],
                                 rows[kHigh + 1], rows[kHigh], rows[kHigh + 2]};
    for (std::size_t i = 0; i < bodies_.back().end; ++i) {
        const bool placed = (row[1][i] > -kMaxCoordinate) & (row[2][i] > -kMaxCoordinate) &
                            (row[3][i] > -kMaxCoordinate) & (row[4][i] < kMaxCoordinate) &
                            (row[5][i] < kMaxCoordinate) & (row[6][i] < kMaxCoordinate);
        const bool usable = placed & (row[0][i] > 0.0);
        box_.number[i] = usable ? box_.number[i] : std::numeric_limits<float>::quiet_NaN();
    }
}

void NearPairs::find_particles(const ColliderRows& rows) {
    const std::size_t count = bodies_near_.size();
    found_.assign(count, 0);
    dropped_.assign(count, 0);
    if (count == 0) {
        return;
    }
    share_ = pair_.size() / count;
    round_boxes(rows);
    for (std::size_t k = 0; k < count; ++k) {
        find_particles_of(k, rows);
    }
}

/// Writes those particles of a body that reach into a box; returns their number.
std::size_t NearPairs::reaching_into(const RoundedBox& box, const ParticleRange& body,
                                     std::vector<std::uint32_t>& particles) const {
    return kernels_.find_overlaps(box_.rows(), box, body.begin, body.end, particles.data());
}

/// The box around the first so many particles; of none, one that nothing overlaps.
RoundedBox NearPairs::around(const std::vector<std::uint32_t>& particles, std::size_t count) const {
    constexpr float far = std::numeric_limits<float>::max();
    RoundedBox box{{far, far, far, -far, -far, -far}};
    // Six minima and maxima side by side, which need not wait for one another.
    const BoxRows rows = box_.rows();
    for (std::size_t p = 0; p < count; ++p) {
        for (std::size_t k = 0; k < 3; ++k) {
            box.number[k] = std::min(box.number[k], rows[k][particles[p]]);
            box.number[k + 3] = std::max(box.number[k + 3], rows[k + 3][particles[p]]);
        }
    }
    return box;
}

void NearPairs::find_particles_of(std::size_t k, const ColliderRows& rows) {
    Scratch& s = scratch_;
    // The particles of each body that reach into the box of the other, then of those of the other that do.
    const auto [first, second] = bodies_near_[k];
    std::size_t outer = reaching_into(rounded(body_box_[second]), bodies_[first], s.outer);
    std::size_t inner = reaching_into(around(s.outer, outer), bodies_[second], s.inner);
    outer = reaching_into(around(s.inner, inner), bodies_[first], s.outer);
    const bool swapped = outer > inner;
    if (swapped) {
        std::swap(outer, inner);
        std::swap(s.outer, s.inner);
    }
    if (outer == 0 || inner == 0) {
        return;
    }
    // The boxes of the larger number side by side; in order along an axis if they are many.
    const auto number = [&](std::size_t row, std::size_t particle) {
        return box_.number[row * box_.length + particle];
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
        s.boxes.set(at, box_, s.inner[at]);
    }
    // One after the other of the smaller number against them.
    Pair* const pairs = pair_.data() + k * share_;
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
        const std::size_t hits = kernels_.find_overlaps(s.boxes.rows(), near, begin, end, s.hits.data());
        if (hits == 0) {
            continue;
        }
        const Bounds box = box_of(rows, particle);
        for (std::size_t h = 0; h < hits; ++h) {
            const std::uint32_t other = s.inner[s.hits[h]];
            if (!overlap(box, box_of(rows, other))) {
                continue;
            }
            if (found_[k] == share_) {
                ++dropped_[k];
                continue;
            }
            pairs[found_[k]++] = swapped ? Pair{other, particle} : Pair{particle, other};
        }
    }
}

std::size_t NearPairs::dropped() const noexcept {
    return std::accumulate(dropped_.begin(), dropped_.end(), std::size_t{0});
}

}  // namespace haptic::sim
