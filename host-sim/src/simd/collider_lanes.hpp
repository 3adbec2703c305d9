// Collider kernels of collider_rows.hpp for any number of lanes. Only the source file compiled for registers of that
// width may instantiate them (see lanes.hpp).
#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "simd/collider_rows.hpp"
#include "simd/ellipsoid_lanes.hpp"
#include "simd/lane_rotation.hpp"

namespace haptic::sim {

// Both return `a` where `b` is not a number.
template <class Real>
HAPTIC_LANES Real min_of(Real a, Real b) noexcept {
    return select(b < a, b, a);
}
template <class Real>
HAPTIC_LANES Real max_of(Real a, Real b) noexcept {
    return select(b > a, b, a);
}
template <class Real>
HAPTIC_LANES LaneVec<Real> min_of(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return {min_of(a.x, b.x), min_of(a.y, b.y), min_of(a.z, b.z)};
}
template <class Real>
HAPTIC_LANES LaneVec<Real> max_of(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return {max_of(a.x, b.x), max_of(a.y, b.y), max_of(a.z, b.z)};
}

/// Sets each lane to number(lane).
template <class Real, class NumberOf>
HAPTIC_LANES Real fill(const NumberOf& number) noexcept {
    if constexpr (kLanes<Real> == 1) {
        return number(0);
    } else {
        return [&]<std::size_t... I>(std::index_sequence<I...>) {
            return Real{number(I)...};
        }(std::make_index_sequence<kLanes<Real>>{});
    }
}

/// Loads a row's numbers of consecutive particles.
class ConsecutiveParticles {
  public:
    HAPTIC_LANES explicit ConsecutiveParticles(std::size_t first) noexcept : first_(first) {}
    template <class Real>
    [[nodiscard]] HAPTIC_LANES Real of(const double* row) const noexcept {
        return load<Real>(row + first_);
    }

  private:
    std::size_t first_;
};
/// Loads a row's numbers of the particles that `index` lists.
class ScatteredParticles {
  public:
    HAPTIC_LANES explicit ScatteredParticles(const std::uint32_t* index) noexcept : index_(index) {}
    template <class Real>
    [[nodiscard]] HAPTIC_LANES Real of(const double* row) const noexcept {
        return fill<Real>([&](std::size_t lane) { return row[index_[lane]]; });
    }

  private:
    const std::uint32_t* index_;
};

template <class Real, class Which>
HAPTIC_LANES LaneVec<Real> vector_of(const ColliderRows& rows, std::size_t row, const Which& which) noexcept {
    return {which.template of<Real>(rows[row]), which.template of<Real>(rows[row + 1]),
            which.template of<Real>(rows[row + 2])};
}
template <class Real, class Which>
HAPTIC_LANES LaneQuat<Real> quaternion_of(const ColliderRows& rows, std::size_t row, const Which& which) noexcept {
    return {which.template of<Real>(rows[row]), which.template of<Real>(rows[row + 1]),
            which.template of<Real>(rows[row + 2]), which.template of<Real>(rows[row + 3])};
}
template <class Real, class Which>
HAPTIC_LANES LaneSymmetric<Real> shape_of(const ColliderRows& rows, const Which& which) noexcept {
    const auto number = [&](std::size_t k) { return which.template of<Real>(rows[collider_row::kShape + k]); };
    return {number(0), number(1), number(2), number(3), number(4), number(5)};
}

template <class Real>
HAPTIC_LANES void store_vector(const LaneVec<Real>& v, const ColliderRows& rows, std::size_t row,
                               std::size_t at) noexcept {
    store(v.x, rows[row] + at);
    store(v.y, rows[row + 1] + at);
    store(v.z, rows[row + 2] + at);
}

/// Elements first, first + 1, ... of an array, one per lane; lanes beyond the last element repeat it.
template <class Real>
class ClampedElements {
  public:
    HAPTIC_LANES ClampedElements(std::size_t first, std::size_t count) noexcept {
        for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
            element_[lane] = first + lane < count ? first + lane : count - 1;
        }
    }
    /// Of an array of vectors.
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> of(const double* vector) const noexcept {
        const auto number = [&](std::size_t k) {
            return fill<Real>([&](std::size_t lane) { return vector[3 * element_[lane] + k]; });
        };
        return {number(0), number(1), number(2)};
    }

  private:
    std::size_t element_[kLanes<Real>] = {};
};

template <class Real>
void find_path_boxes(const ColliderRows& rows, std::size_t count, const Paths& paths, PathSlack slack) noexcept {
    using namespace collider_row;
    const Real step = broadcast<Real>(paths.step);
    for (std::size_t i = 0; i < count; i += kLanes<Real>) {
        const ClampedElements<Real> element(i, count);
        const LaneVec<Real> start = element.of(paths.start);
        const LaneVec<Real> end = start + step * element.of(paths.velocity);
        // Box about the path, and the margin for displacement by constraints.
        const LaneVec<Real> low = min_of(start, end);
        const LaneVec<Real> high = max_of(start, end);
        const LaneVec<Real> side = high - low;
        const Real longest = max_of(max_of(side.x, side.y), side.z);
        const Real margin = slack.of_size * load<Real>(rows[kSize] + i) + slack.of_path * longest;
        // A ball of the largest semi-axis contains the ellipsoid in any orientation.
        const Real around = load<Real>(rows[kReach] + i) + margin;
        const LaneVec<Real> moved = start - vector_of<Real>(rows, kFrom, ConsecutiveParticles(i));
        const Real travel = load<Real>(rows[kTravel] + i) + square_root(dot(moved, moved));
        store(travel, rows[kTravel] + i);
        store(travel + square_root(dot(side, side)) + margin, rows[kTravelToEnd] + i);
        // Path for the planes; box for culling and the broad phase.
        store_vector(start, rows, kFrom, i);
        store_vector(end, rows, kTo, i);
        store(margin, rows[kSlack] + i);
        store_vector(low - LaneVec<Real>{around, around, around}, rows, kLow, i);
        store_vector(high + LaneVec<Real>{around, around, around}, rows, kHigh, i);
    }
}

template <class Real>
Bounds bounds(const ColliderRows& rows, std::size_t begin, std::size_t end) noexcept {
    Bounds result{};
    for (std::size_t k = 0; k < 3; ++k) {
        const double* low = rows[collider_row::kLow + k];
        const double* high = rows[collider_row::kHigh + k];
        // Minimum and maximum of each lane over whole vectors.
        Real lane_lowest = broadcast<Real>(kUnbounded);
        Real lane_highest = broadcast<Real>(-kUnbounded);
        std::size_t i = begin;
        for (; i + kLanes<Real> <= end; i += kLanes<Real>) {
            lane_lowest = min_of(lane_lowest, load<Real>(low + i));
            lane_highest = max_of(lane_highest, load<Real>(high + i));
        }
        // Then across the lanes, and over the rest one by one.
        double lowest[kLanes<Real>];
        double highest[kLanes<Real>];
        store(lane_lowest, lowest);
        store(lane_highest, highest);
        for (std::size_t lane = 1; lane < kLanes<Real>; ++lane) {
            lowest[0] = min_of(lowest[0], lowest[lane]);
            highest[0] = max_of(highest[0], highest[lane]);
        }
        for (; i < end; ++i) {
            lowest[0] = min_of(lowest[0], low[i]);
            highest[0] = max_of(highest[0], high[i]);
        }
        result.low[k] = lowest[0];
        result.high[k] = highest[0];
    }
    return result;
}

/// All bits in each lane whose box overlaps `bounds`, else 0.
template <class Real>
HAPTIC_LANES BitsOf<Real> overlapping(const ColliderRows& rows, std::size_t at, const Bounds& bounds) noexcept {
    BitsOf<Real> result = ~BitsOf<Real>{};
    for (std::size_t k = 0; k < 3; ++k) {
        const Real low = load<Real>(rows[collider_row::kLow + k] + at);
        const Real high = load<Real>(rows[collider_row::kHigh + k] + at);
        result = select(low <= bounds.high[k], result, BitsOf<Real>{});
        result = select(high >= bounds.low[k], result, BitsOf<Real>{});
    }
    return result;
}

template <class Real>
void mark(const ColliderRows& rows, std::size_t begin, std::size_t end, const Bounds& bounds, std::int64_t bit,
          std::int64_t* near) noexcept {
    // Set the bit of overlapping particles, whole vectors first, the rest one by one.
    std::size_t i = begin;
    for (; i + kLanes<Real> <= end; i += kLanes<Real>) {
        BitsOf<Real> bits;
        __builtin_memcpy(&bits, near + i, sizeof(bits));
        bits |= overlapping<Real>(rows, i, bounds) & bit;
        __builtin_memcpy(near + i, &bits, sizeof(bits));
    }
    for (; i < end; ++i) {
        near[i] |= overlapping<double>(rows, i, bounds) & bit;
    }
}

/// How far the rotation since the last orientation moves any plane that touches the ellipsoids, at most: the angle
/// times what the largest semi-axis is longer than the smallest. The angle, 4 asin(|q - q'| / 2), is less than 2.25
/// times the sum of the differences.
template <class Real>
HAPTIC_LANES void store_turn(const ColliderRows& rows, std::size_t i, const LaneQuat<Real>& orientation) noexcept {
    using namespace collider_row;
    const LaneQuat<Real> last = quaternion_of<Real>(rows, kLastOrientation, ConsecutiveParticles(i));
    const Real differences = (absolute(orientation.w - last.w) + absolute(orientation.x - last.x)) +
                             (absolute(orientation.y - last.y) + absolute(orientation.z - last.z));
    const Real turned = 2.25 * differences * load<Real>(rows[kStretch] + i);
    store(load<Real>(rows[kTravel] + i) + turned, rows[kTravel] + i);
    store(load<Real>(rows[kTravelToEnd] + i) + turned, rows[kTravelToEnd] + i);
    store(orientation.w, rows[kLastOrientation] + i);
    store(orientation.x, rows[kLastOrientation + 1] + i);
    store(orientation.y, rows[kLastOrientation + 2] + i);
    store(orientation.z, rows[kLastOrientation + 3] + i);
}

template <class Real>
void find_ellipsoid_boxes(const ColliderRows& rows, std::size_t count, const std::int64_t* near,
                          Ground ground) noexcept {
    using namespace collider_row;
    for (std::size_t i = 0; i < count; i += kLanes<Real>) {
        // Skip vectors of particles that nothing is near.
        std::int64_t any = 0;
        for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
            any |= near[i + lane];
        }
        if (any == 0) {
            continue;
        }
        // Shape matrix in the scene: R diag(semi-axes^2) R^T with R = orientation * axes.
        const ConsecutiveParticles here(i);
        const LaneQuat<Real> axes = quaternion_of<Real>(rows, kAxes, here);
        const LaneQuat<Real> orientation = quaternion_of<Real>(rows, kOrientation, here);
        const LaneSymmetric<Real> shape =
            lane_shape(vector_of<Real>(rows, kSemiAxes, here), lane_matrix(orientation * axes));
        store_turn(rows, i, orientation);
        store(shape.xx, rows[kShape] + i);
        store(shape.yy, rows[kShape + 1] + i);
        store(shape.zz, rows[kShape + 2] + i);
        store(shape.yx, rows[kShape + 3] + i);
        store(shape.zx, rows[kShape + 4] + i);
        store(shape.zy, rows[kShape + 5] + i);
        // Half extents of the ellipsoid's box are the roots of the diagonal; the path extends the box.
        const LaneVec<Real> extent{square_root(shape.xx), square_root(shape.yy), square_root(shape.zz)};
        const Real slack = here.of<Real>(rows[kSlack]);
        const LaneVec<Real> around = extent + LaneVec<Real>{slack, slack, slack};
        const LaneVec<Real> from = vector_of<Real>(rows, kFrom, here);
        const LaneVec<Real> to = vector_of<Real>(rows, kTo, here);
        store_vector(min_of(from, to) - around, rows, kLow, i);
        store_vector(max_of(from, to) + around, rows, kHigh, i);
        // Height at which it touches the ground. One that starts lower is raised slowly.
        const Real resting = ground.height + extent.y;
        store(resting + ground.push_out.least_gap(from.y - resting), rows[kGroundHeight] + i);
    }
}

template <class Real>
void find_planes(const ColliderRows& rows, std::size_t count, const PlaneRows& planes, PushOut push_out) noexcept {
    using namespace collider_row;
    for (std::size_t k = 0; k < count; k += kLanes<Real>) {
        // Gather shapes and paths of both particles of each pair.
        const ScatteredParticles first(planes.first + k);
        const ScatteredParticles second(planes.second + k);
        const LaneSymmetric<Real> a = shape_of<Real>(rows, first);
        const LaneSymmetric<Real> b = shape_of<Real>(rows, second);
        const LaneVec<Real> a_from = vector_of<Real>(rows, kFrom, first);
        const LaneVec<Real> b_from = vector_of<Real>(rows, kFrom, second);
        const LaneVec<Real> a_to = vector_of<Real>(rows, kTo, first);
        const LaneVec<Real> b_to = vector_of<Real>(rows, kTo, second);
        // Normal at the first contact of the relative motion (ellipsoids.hpp).
        const LaneVec<Real> from = a_from - b_from;
        const LaneVec<Real> normal = lane_separating_normal(
            LaneSweep<Real>{a, b, second.of<Real>(rows[kSize]) / first.of<Real>(rows[kSize]), from, a_to - b_to});
        // Support distances add up. A pair that overlaps at the start comes apart slowly.
        const Real reach = lane_reach(a, normal) + lane_reach(b, normal);
        const Real min_distance = reach + push_out.least_gap(dot(normal, from) - reach);
        // Worst case: each may stop anywhere on its path.
        const Real a_lowest = min_of(dot(normal, a_from), dot(normal, a_to));
        const Real b_highest = max_of(dot(normal, b_from), dot(normal, b_to));
        const Real slack = first.of<Real>(rows[kSlack]) + second.of<Real>(rows[kSlack]);
        store(normal.x, planes.normal[0] + k);
        store(normal.y, planes.normal[1] + k);
        store(normal.z, planes.normal[2] + k);
        store(min_distance, planes.min_distance + k);
        store(a_lowest - b_highest - min_distance - slack, planes.clearance + k);
    }
}

/// Vectors of 32-bit numbers. Results of comparisons leave wider ones more slowly.
template <std::size_t Count>
struct BoxTypes {
    static constexpr std::size_t kLanes = Count < 4 ? 4 : 8;
    using Floats [[gnu::vector_size(kLanes * sizeof(float))]] = float;
    using Mask [[gnu::vector_size(kLanes * sizeof(float))]] = std::int32_t;
    using Indices [[gnu::vector_size(kLanes * sizeof(float))]] = std::uint32_t;
};

/// For each set of lanes, as bits: the lanes in it, in order.
template <std::size_t Lanes>
struct LaneLists {
    std::uint32_t lane[std::size_t{1} << Lanes][Lanes];
    std::uint8_t count[std::size_t{1} << Lanes];
};
template <std::size_t Lanes>
constexpr LaneLists<Lanes> make_lane_lists() noexcept {
    LaneLists<Lanes> lists{};
    for (std::size_t set = 0; set < std::size_t{1} << Lanes; ++set) {
        std::size_t found = 0;
        for (std::uint32_t lane = 0; lane < Lanes; ++lane) {
            if ((set >> lane & 1U) != 0) {
                lists.lane[set][found++] = lane;
            }
        }
        lists.count[set] = static_cast<std::uint8_t>(found);
    }
    return lists;
}
template <std::size_t Count>
inline constexpr LaneLists<BoxTypes<Count>::kLanes> kLaneLists = make_lane_lists<BoxTypes<Count>::kLanes>();

/// The lanes where a comparison holds, as bits.
template <std::size_t Count>
HAPTIC_LANES unsigned set_of(const typename BoxTypes<Count>::Mask& holds) noexcept {
#if defined(__SSE2__)
    if constexpr (BoxTypes<Count>::kLanes == 4) {
        return static_cast<unsigned>(_mm_movemask_ps(__builtin_bit_cast(__m128, holds)));
    }
#endif
#if defined(__AVX__)
    if constexpr (BoxTypes<Count>::kLanes == 8) {
        return static_cast<unsigned>(_mm256_movemask_ps(__builtin_bit_cast(__m256, holds)));
    }
#endif
    unsigned set = 0;
    for (std::size_t lane = 0; lane < BoxTypes<Count>::kLanes; ++lane) {
        set |= static_cast<unsigned>(holds[lane]) & (1U << lane);
    }
    return set;
}

#if defined(__AVX512F__)
/// find_overlaps() with mask registers, sixteen boxes at a time.
HAPTIC_LANES std::size_t find_overlaps_masked(const BoxRows& boxes, const RoundedBox& box, std::size_t begin,
                                              std::size_t end, std::uint32_t* overlapping) noexcept {
    __m512 side[6];
    for (std::size_t k = 0; k < 6; ++k) {
        side[k] = _mm512_set1_ps(box.number[k]);
    }
    const __m512i lane = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    std::size_t found = 0;
    for (std::size_t j = begin; j < end; j += 16) {
        // The last vector reads beyond the range.
        const unsigned within = end - j < 16 ? (1U << (end - j)) - 1U : 0xFFFFU;
        auto set = static_cast<__mmask16>(within);
        for (std::size_t k = 0; k < 3; ++k) {
            set = _mm512_mask_cmp_ps_mask(set, _mm512_loadu_ps(boxes[k] + j), side[k + 3], _CMP_LE_OQ);
            set = _mm512_mask_cmp_ps_mask(set, _mm512_loadu_ps(boxes[k + 3] + j), side[k], _CMP_GE_OQ);
        }
        const __m512i index = _mm512_add_epi32(_mm512_set1_epi32(static_cast<int>(j)), lane);
        _mm512_storeu_si512(overlapping + found, _mm512_maskz_compress_epi32(set, index));
        found += static_cast<std::size_t>(__builtin_popcount(set));
    }
    return found;
}
#endif

template <std::size_t Count>
std::size_t find_overlaps(const BoxRows& boxes, const RoundedBox& box, std::size_t begin, std::size_t end,
                          std::uint32_t* overlapping) noexcept {
    using Floats = typename BoxTypes<Count>::Floats;
    using Indices = typename BoxTypes<Count>::Indices;
    constexpr std::size_t lanes = BoxTypes<Count>::kLanes;
#if defined(__AVX512F__)
    if constexpr (Count == 8) {
        return find_overlaps_masked(boxes, box, begin, end, overlapping);
    }
#endif
    const auto numbers = [&](std::size_t row, std::size_t at) __attribute__((always_inline)) {
        Floats result;
        __builtin_memcpy(&result, boxes[row] + at, sizeof(result));
        return result;
    };
    std::size_t found = 0;
    for (std::size_t j = begin; j < end; j += lanes) {
        auto overlap = numbers(0, j) <= box.number[3];
        for (std::size_t k = 0; k < 3; ++k) {
            overlap &= numbers(k, j) <= box.number[k + 3];
            overlap &= numbers(k + 3, j) >= box.number[k];
        }
        unsigned set = set_of<Count>(overlap);
        // The last vector reads beyond the range.
        if (end - j < lanes) {
            set &= (1U << (end - j)) - 1U;
        }
        // Writes a whole vector, however many there are: to count them takes longer than to overwrite the rest.
        Indices index;
        __builtin_memcpy(&index, kLaneLists<Count>.lane[set], sizeof(index));
        index += static_cast<std::uint32_t>(j);
        __builtin_memcpy(overlapping + found, &index, sizeof(index));
        found += kLaneLists<Count>.count[set];
    }
    return found;
}

/// Coulomb friction: the factor of the wanted tangential displacement that a normal displacement `push` permits, 1
/// while it sticks (see collisions.hpp).
template <class Real>
HAPTIC_LANES Real friction_fraction(Real wanted_squared, Real push, FrictionCoefficients friction) noexcept {
    const Real length = square_root(wanted_squared);
    const Real fraction = friction.sliding * push / length;  // not a number if length is 0: not selected
    return select(length <= friction.sticking * push, broadcast<Real>(1.0), fraction);
}

template <class Real>
HAPTIC_LANES void project_ground_batch(const GroundContacts& contacts, std::size_t at, FrictionCoefficients friction,
                                       double* position) noexcept {
    // Height of each particle and the height at which it may rest.
    const auto position_of = [&](std::size_t lane) __attribute__((always_inline)) {
        return position + 4 * std::size_t{contacts.particle[at + lane]};
    };
    const Real y = fill<Real>([&](std::size_t lane) __attribute__((always_inline)) { return position_of(lane)[1]; });
    const Real min_height = load<Real>(contacts.min_height + at);
    const Real push = load<Real>(contacts.push + at);
    // A contact is active while its particle is below the ground or has been pushed up: then the push may decrease.
    const BitsOf<Real> below = select(y < min_height, ~BitsOf<Real>{}, BitsOf<Real>{});
    const BitsOf<Real> active = select(push > 0.0, ~BitsOf<Real>{}, below);
    // Skip the gathers and stores of a batch without an active lane.
    std::int64_t bits[kLanes<Real>];
    __builtin_memcpy(bits, &active, sizeof(bits));
    std::int64_t any = 0;
    for (const std::int64_t bit : bits) {
        any |= bit;
    }
    if (any == 0) {
        return;
    }
    // Normal: move to the permitted height, keeping the total push at 0 or more.
    const Real change = max_of(min_height - y, -push);
    const Real pushed = push + change;
    // Friction: cancel the tangential displacement since the start, within the friction cone of the total push.
    const Real x = fill<Real>([&](std::size_t lane) __attribute__((always_inline)) { return position_of(lane)[0]; });
    const Real z = fill<Real>([&](std::size_t lane) __attribute__((always_inline)) { return position_of(lane)[2]; });
    const Real friction_x = load<Real>(contacts.friction[0] + at);
    const Real friction_z = load<Real>(contacts.friction[1] + at);
    const Real wanted_x = friction_x - (x - load<Real>(contacts.start[0] + at));
    const Real wanted_z = friction_z - (z - load<Real>(contacts.start[1] + at));
    const Real fraction = friction_fraction(wanted_x * wanted_x + wanted_z * wanted_z, pushed, friction);
    const Real held_x = fraction * wanted_x;
    const Real held_z = fraction * wanted_z;
    // Inactive lanes keep all bits, even the sign of a zero.
    store(select(active != 0, pushed, push), contacts.push + at);
    store(select(active != 0, held_x, friction_x), contacts.friction[0] + at);
    store(select(active != 0, held_z, friction_z), contacts.friction[1] + at);
    // Only active lanes are written back.
    double moved[3][kLanes<Real>];
    store(x + (held_x - friction_x), moved[0]);
    store(y + change, moved[1]);
    store(z + (held_z - friction_z), moved[2]);
    for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
        if (bits[lane] != 0) {
            for (std::size_t k = 0; k < 3; ++k) {
                position_of(lane)[k] = moved[k][lane];
            }
        }
    }
}

template <class Real>
void project_ground(const GroundContacts& contacts, FrictionCoefficients friction, double* position) noexcept {
    std::size_t k = 0;
    for (; k + kLanes<Real> <= contacts.count; k += kLanes<Real>) {
        project_ground_batch<Real>(contacts, k, friction, position);
    }
    for (; k < contacts.count; ++k) {
        project_ground_batch<double>(contacts, k, friction, position);
    }
}

template <std::size_t Count>
inline constexpr ColliderKernels kColliderKernels{Count,
                                                  find_path_boxes<typename LaneTypes<Count>::Real>,
                                                  bounds<typename LaneTypes<Count>::Real>,
                                                  mark<typename LaneTypes<Count>::Real>,
                                                  find_ellipsoid_boxes<typename LaneTypes<Count>::Real>,
                                                  find_planes<typename LaneTypes<Count>::Real>,
                                                  find_overlaps<Count>,
                                                  project_ground<typename LaneTypes<Count>::Real>};

}  // namespace haptic::sim
