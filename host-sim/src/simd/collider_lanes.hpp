// The functions of collider_rows.hpp for any number of lanes. To be used by the translation unit that is compiled for
// registers of that width, and by no other (see lanes.hpp).
#pragma once

#include "simd/collider_rows.hpp"
#include "simd/ellipsoid_lanes.hpp"
#include "simd/lane_rotation.hpp"

namespace haptic::sim {

// The first where the second is not a number.
template <class Real>
HAPTIC_LANES Real less_of(Real a, Real b) noexcept {
    return select(b < a, b, a);
}
template <class Real>
HAPTIC_LANES Real greater_of(Real a, Real b) noexcept {
    return select(b > a, b, a);
}
template <class Real>
HAPTIC_LANES LaneVec<Real> less_of(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return {less_of(a.x, b.x), less_of(a.y, b.y), less_of(a.z, b.z)};
}
template <class Real>
HAPTIC_LANES LaneVec<Real> greater_of(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return {greater_of(a.x, b.x), greater_of(a.y, b.y), greater_of(a.z, b.z)};
}

/// number(lane) in each lane.
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

/// Numbers of particles that follow one another, or of any.
class Consecutive {
  public:
    HAPTIC_LANES explicit Consecutive(std::size_t first) noexcept : first_(first) {}
    template <class Real>
    [[nodiscard]] HAPTIC_LANES Real of(const double* row) const noexcept {
        return load<Real>(row + first_);
    }

  private:
    std::size_t first_;
};
class Scattered {
  public:
    HAPTIC_LANES explicit Scattered(const std::uint32_t* index) noexcept : index_(index) {}
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

/// The place of each lane's structure; those past the last one get the last one's.
template <class Real>
class Places {
  public:
    HAPTIC_LANES Places(std::size_t first, std::size_t count) noexcept {
        for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
            place_[lane] = first + lane < count ? first + lane : count - 1;
        }
    }
    [[nodiscard]] HAPTIC_LANES Real of(Strided array, std::size_t number) const noexcept {
        return fill<Real>([&](std::size_t lane) { return array.first[place_[lane] * array.stride + number]; });
    }
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> vector(Strided array) const noexcept {
        return {of(array, 0), of(array, 1), of(array, 2)};
    }

  private:
    std::size_t place_[kLanes<Real>] = {};
};

template <class Real>
void find_ways(const ColliderRows& rows, std::size_t count, Strided from, Strided to, WaySlack slack) noexcept {
    using namespace collider_row;
    for (std::size_t i = 0; i < count; i += kLanes<Real>) {
        const Places<Real> place(i, count);
        const LaneVec<Real> start = place.vector(from);
        const LaneVec<Real> end = place.vector(to);
        const LaneVec<Real> low = less_of(start, end);
        const LaneVec<Real> high = greater_of(start, end);
        const LaneVec<Real> side = high - low;
        const Real longest = greater_of(greater_of(side.x, side.y), side.z);
        const Real spare = slack.of_size * load<Real>(rows[kSize] + i) + slack.of_way * longest;
        const Real around = load<Real>(rows[kReach] + i) + spare;
        store_vector(start, rows, kFrom, i);
        store_vector(end, rows, kTo, i);
        store(spare, rows[kSlack] + i);
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
        Real lane_lowest = broadcast<Real>(kBeyondAll);
        Real lane_highest = broadcast<Real>(-kBeyondAll);
        std::size_t i = begin;
        for (; i + kLanes<Real> <= end; i += kLanes<Real>) {
            lane_lowest = less_of(lane_lowest, load<Real>(low + i));
            lane_highest = greater_of(lane_highest, load<Real>(high + i));
        }
        double lowest[kLanes<Real>];
        double highest[kLanes<Real>];
        store(lane_lowest, lowest);
        store(lane_highest, highest);
        for (std::size_t lane = 1; lane < kLanes<Real>; ++lane) {
            lowest[0] = less_of(lowest[0], lowest[lane]);
            highest[0] = greater_of(highest[0], highest[lane]);
        }
        for (; i < end; ++i) {
            lowest[0] = less_of(lowest[0], low[i]);
            highest[0] = greater_of(highest[0], high[i]);
        }
        result.low[k] = lowest[0];
        result.high[k] = highest[0];
    }
    return result;
}

/// -1 for each lane whose box overlaps these bounds, else 0.
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

template <class Real>
void find_shapes(const ColliderRows& rows, std::size_t count, const std::int64_t* near, Ground ground) noexcept {
    using namespace collider_row;
    for (std::size_t i = 0; i < count; i += kLanes<Real>) {
        std::int64_t any = 0;
        for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
            any |= near[i + lane];
        }
        if (any == 0) {
            continue;
        }
        const Consecutive here(i);
        const LaneQuat<Real> axes = quaternion_of<Real>(rows, kAxes, here);
        const LaneQuat<Real> turned = quaternion_of<Real>(rows, kTurn, here);
        const LaneSymmetric<Real> shape =
            lane_shape(vector_of<Real>(rows, kSemiAxes, here), lane_matrix(turned * axes));
        store(shape.xx, rows[kShape] + i);
        store(shape.yy, rows[kShape + 1] + i);
        store(shape.zz, rows[kShape + 2] + i);
        store(shape.yx, rows[kShape + 3] + i);
        store(shape.zx, rows[kShape + 4] + i);
        store(shape.zy, rows[kShape + 5] + i);
        const LaneVec<Real> extent{square_root(shape.xx), square_root(shape.yy), square_root(shape.zz)};
        const Real slack = here.of<Real>(rows[kSlack]);
        const LaneVec<Real> around = extent + LaneVec<Real>{slack, slack, slack};
        const LaneVec<Real> from = vector_of<Real>(rows, kFrom, here);
        const LaneVec<Real> to = vector_of<Real>(rows, kTo, here);
        store_vector(less_of(from, to) - around, rows, kLow, i);
        store_vector(greater_of(from, to) + around, rows, kHigh, i);
        const Real resting = ground.height + extent.y;
        store(resting + less_of(from.y - resting + ground.push_out, Real{}), rows[kGroundLeast] + i);
    }
}

template <class Real>
void lay_planes(const ColliderRows& rows, std::size_t count, const PlaneRows& planes, double push_out) noexcept {
    using namespace collider_row;
    for (std::size_t k = 0; k < count; k += kLanes<Real>) {
        const Scattered first(planes.first + k);
        const Scattered second(planes.second + k);
        const LaneSymmetric<Real> a = shape_of<Real>(rows, first);
        const LaneSymmetric<Real> b = shape_of<Real>(rows, second);
        const LaneVec<Real> a_from = vector_of<Real>(rows, kFrom, first);
        const LaneVec<Real> b_from = vector_of<Real>(rows, kFrom, second);
        const LaneVec<Real> a_to = vector_of<Real>(rows, kTo, first);
        const LaneVec<Real> b_to = vector_of<Real>(rows, kTo, second);
        const LaneVec<Real> from = a_from - b_from;
        const LaneVec<Real> normal = lane_parting_normal(
            LanePassage<Real>{a, b, second.of<Real>(rows[kSize]) / first.of<Real>(rows[kSize]), from, a_to - b_to});
        const Real reach = lane_reach(a, normal) + lane_reach(b, normal);
        const Real give = dot(normal, from) - reach + push_out;
        const Real least = reach + less_of(give, Real{});
        // Each may stop anywhere on its way.
        const Real a_lowest = less_of(dot(normal, a_from), dot(normal, a_to));
        const Real b_highest = greater_of(dot(normal, b_from), dot(normal, b_to));
        const Real slack = first.of<Real>(rows[kSlack]) + second.of<Real>(rows[kSlack]);
        store(normal.x, planes.normal[0] + k);
        store(normal.y, planes.normal[1] + k);
        store(normal.z, planes.normal[2] + k);
        store(least, planes.least + k);
        store(a_lowest - b_highest - least - slack, planes.clearance + k);
    }
}

/// As many small integers as fit into a register with 16-bit arithmetic: AVX-512F has no wider one than AVX2.
template <std::size_t Count>
struct SmallTypes {
    static constexpr std::size_t kBytes = Count < 4 ? 16 : 32;
    using Shorts [[gnu::vector_size(kBytes)]] = std::int16_t;
    using Longs [[gnu::vector_size(kBytes)]] = std::uint64_t;
};

template <std::size_t Count>
std::size_t compare_boxes(const LatticeRows& boxes, std::size_t box, std::size_t end,
                          std::uint32_t* overlapping) noexcept {
    using Shorts = typename SmallTypes<Count>::Shorts;
    using Longs = typename SmallTypes<Count>::Longs;
    constexpr std::size_t lanes = sizeof(Shorts) / sizeof(std::int16_t);
    constexpr std::size_t lanes_of_long = lanes / (sizeof(Longs) / sizeof(std::uint64_t));
    const auto number = [&](std::size_t row) { return boxes.row[row][box]; };
    const auto numbers = [&](std::size_t row, std::size_t at) {
        Shorts result;
        __builtin_memcpy(&result, boxes.row[row] + at, sizeof(result));
        return result;
    };
    std::size_t found = 0;
    for (std::size_t j = box + 1; j < end; j += lanes) {
        Shorts apart = numbers(6, j) == number(6);
        for (std::size_t k = 0; k < 3; ++k) {
            apart |= numbers(k, j) > number(k + 3);
            apart |= numbers(k + 3, j) < number(k);
        }
        const Longs meeting = ~__builtin_bit_cast(Longs, apart);
        for (std::size_t part = 0; part < lanes / lanes_of_long; ++part) {
            for (std::uint64_t bits = meeting[part]; bits != 0;) {
                const auto lane = static_cast<std::size_t>(__builtin_ctzll(bits)) / 16;
                bits &= ~(std::uint64_t{0xFFFF} << (16 * lane));
                const std::size_t other = j + part * lanes_of_long + lane;
                if (other < end) {
                    overlapping[found++] = static_cast<std::uint32_t>(other);
                }
            }
        }
    }
    return found;
}

/// A factor of `wanted`: 1 if the normal displacement `push` can hold it (see collisions.hpp).
template <class Real>
HAPTIC_LANES Real part_held(Real wanted_squared, Real push, FrictionOf friction) noexcept {
    const Real length = square_root(wanted_squared);
    const Real part = friction.moving * push / length;  // of nothing: not used
    return select(length <= friction.still * push, broadcast<Real>(1.0), part);
}

template <class Real>
HAPTIC_LANES void press_some(const GroundContacts& contacts, std::size_t at, FrictionOf friction,
                             double* place) noexcept {
    const auto of_place = [&](std::size_t lane) { return place + 4 * std::size_t{contacts.particle[at + lane]}; };
    const Real y = fill<Real>([&](std::size_t lane) { return of_place(lane)[1]; });
    const Real least = load<Real>(contacts.least + at);
    const Real push = load<Real>(contacts.push + at);
    const BitsOf<Real> below = select(y < least, ~BitsOf<Real>{}, BitsOf<Real>{});
    const BitsOf<Real> active = select(push > 0.0, ~BitsOf<Real>{}, below);
    std::int64_t bits[kLanes<Real>];
    __builtin_memcpy(bits, &active, sizeof(bits));
    std::int64_t any = 0;
    for (const std::int64_t bit : bits) {
        any |= bit;
    }
    if (any == 0) {
        return;
    }
    const Real change = greater_of(least - y, -push);
    const Real pushed = push + change;
    const Real x = fill<Real>([&](std::size_t lane) { return of_place(lane)[0]; });
    const Real z = fill<Real>([&](std::size_t lane) { return of_place(lane)[2]; });
    const Real rub_x = load<Real>(contacts.rub[0] + at);
    const Real rub_z = load<Real>(contacts.rub[1] + at);
    const Real wanted_x = rub_x - (x - load<Real>(contacts.start[0] + at));
    const Real wanted_z = rub_z - (z - load<Real>(contacts.start[1] + at));
    const Real part = part_held(wanted_x * wanted_x + wanted_z * wanted_z, pushed, friction);
    const Real held_x = part * wanted_x;
    const Real held_z = part * wanted_z;
    // What is not active stays as it is, to the sign of a zero.
    store(select(active != 0, pushed, push), contacts.push + at);
    store(select(active != 0, held_x, rub_x), contacts.rub[0] + at);
    store(select(active != 0, held_z, rub_z), contacts.rub[1] + at);
    double moved[3][kLanes<Real>];
    store(x + (held_x - rub_x), moved[0]);
    store(y + change, moved[1]);
    store(z + (held_z - rub_z), moved[2]);
    for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
        if (bits[lane] != 0) {
            for (std::size_t k = 0; k < 3; ++k) {
                of_place(lane)[k] = moved[k][lane];
            }
        }
    }
}

template <class Real>
void press_ground(const GroundContacts& contacts, FrictionOf friction, double* place) noexcept {
    std::size_t k = 0;
    for (; k + kLanes<Real> <= contacts.count; k += kLanes<Real>) {
        press_some<Real>(contacts, k, friction, place);
    }
    for (; k < contacts.count; ++k) {
        press_some<double>(contacts, k, friction, place);
    }
}

template <std::size_t Count>
inline constexpr ColliderKernels kColliderKernels{Count,
                                                  find_ways<typename LaneTypes<Count>::Real>,
                                                  bounds<typename LaneTypes<Count>::Real>,
                                                  mark<typename LaneTypes<Count>::Real>,
                                                  find_shapes<typename LaneTypes<Count>::Real>,
                                                  lay_planes<typename LaneTypes<Count>::Real>,
                                                  compare_boxes<Count>,
                                                  press_ground<typename LaneTypes<Count>::Real>};

}  // namespace haptic::sim
