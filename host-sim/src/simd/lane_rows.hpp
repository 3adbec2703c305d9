// Gather and scatter: rows of particles into lanes and back. lanes.hpp says where these may be used.
#pragma once

#include "simd/lanes.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

/// One row of four numbers per lane, stored by columns.
template <class Real>
struct LaneRow {
    Real a, b, c, d;
};

template <class Real>
HAPTIC_LANES LaneVec<Real> head(const LaneRow<Real>& row) noexcept {
    return {row.a, row.b, row.c};
}
template <class Real>
HAPTIC_LANES LaneQuat<Real> quat_of(const LaneRow<Real>& row) noexcept {
    return {row.a, row.b, row.c, row.d};
}
template <class Real>
HAPTIC_LANES LaneRow<Real> row_of(const LaneQuat<Real>& q) noexcept {
    return {q.w, q.x, q.y, q.z};
}

/// Transposes the 4 x 4 matrix in each run of four lanes.
template <class Real>
HAPTIC_LANES LaneRow<Real> transposed(const LaneRow<Real>& m) noexcept {
    return [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
        // Indices within one run of four lanes; 4 and more refer to the second operand.
        constexpr auto at = [](std::size_t lane, const std::size_t (&pattern)[4]) constexpr {
            const std::size_t i = pattern[lane % 4];
            return lane / 4 * 4 + i % 4 + (i < 4 ? 0 : sizeof...(I));
        };
        // Two rounds of interleaving: pairs of a and b, pairs of c and d, then both together. In the first, numbers
        // stay within 16 bytes, which takes one instruction.
        constexpr bool floats = sizeof(NumberOf<Real>) == sizeof(float);
        constexpr std::size_t low[4] = {0, 4, floats ? 1 : 2, floats ? 5 : 6};
        constexpr std::size_t high[4] = {floats ? 2 : 1, floats ? 6 : 5, 3, 7};
        constexpr std::size_t first[4] = {0, 1, 4, 5};
        constexpr std::size_t last[4] = {2, 3, 6, 7};
        const Real ab_low = __builtin_shufflevector(m.a, m.b, at(I, low)...);
        const Real ab_high = __builtin_shufflevector(m.a, m.b, at(I, high)...);
        const Real cd_low = __builtin_shufflevector(m.c, m.d, at(I, low)...);
        const Real cd_high = __builtin_shufflevector(m.c, m.d, at(I, high)...);
        const Real low_first = __builtin_shufflevector(ab_low, cd_low, at(I, first)...);
        const Real low_last = __builtin_shufflevector(ab_low, cd_low, at(I, last)...);
        const Real high_first = __builtin_shufflevector(ab_high, cd_high, at(I, first)...);
        const Real high_last = __builtin_shufflevector(ab_high, cd_high, at(I, last)...);
        return floats ? LaneRow<Real>{low_first, low_last, high_first, high_last}
                      : LaneRow<Real>{low_first, high_first, low_last, high_last};
    }(std::make_index_sequence<kLanes<Real>>{});
}

/// Columns of the rows quad(lane), for four lanes or more. Lanes k, 4 + k, 8 + k and 12 + k share a register before the
/// transposition.
template <class Real, class QuadAt>
HAPTIC_LANES LaneRow<Real> join(const QuadAt& quad) noexcept {
    if constexpr (kLanes<Real> == 4) {
        return transposed<Real>({quad(0), quad(1), quad(2), quad(3)});
    } else {
        const auto two = [&](std::size_t k) __attribute__((always_inline)) {
            return __builtin_shufflevector(quad(k), quad(4 + k), 0, 1, 2, 3, 4, 5, 6, 7);
        };
        if constexpr (kLanes<Real> == 8) {
            return transposed<Real>({two(0), two(1), two(2), two(3)});
        } else {
            static_assert(kLanes<Real> == 16);
            const auto four = [&](std::size_t k) __attribute__((always_inline)) {
                return __builtin_shufflevector(two(k), two(8 + k), 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14,
                                               15);
            };
            return transposed<Real>({four(0), four(1), four(2), four(3)});
        }
    }
}

/// Columns of two rows of doubles, each given by its halves half(lane, 0) and half(lane, 1).
template <class Real, class HalfAt>
HAPTIC_LANES LaneRow<Real> join_halves(const HalfAt& half) noexcept {
    const Real ab0 = half(0, 0);
    const Real ab1 = half(1, 0);
    const Real cd0 = half(0, 1);
    const Real cd1 = half(1, 1);
    return {__builtin_shufflevector(ab0, ab1, 0, 2), __builtin_shufflevector(ab0, ab1, 1, 3),
            __builtin_shufflevector(cd0, cd1, 0, 2), __builtin_shufflevector(cd0, cd1, 1, 3)};
}

/// Loads the four numbers at address at(lane) into each lane.
template <class Real, class At>
HAPTIC_LANES LaneRow<Real> gather(const At& at) noexcept {
    if constexpr (kLanes<Real> == 1) {
        return {at(0)[0], at(0)[1], at(0)[2], at(0)[3]};
    } else if constexpr (kLanes<Real> == 2) {
        return join_halves<Real>([&](std::size_t lane, std::size_t which)
                                     __attribute__((always_inline)) { return load<Real>(at(lane) + 2 * which); });
    } else if constexpr (kLanes<Real> == 4 && sizeof(NumberOf<Real>) == sizeof(double)) {
        // Half rows, which go to either half of a register: two of four steps of the transposition.
        using Half = typename LaneTypes<2>::Real;
        const auto halves = [&](std::size_t lane, std::size_t k) __attribute__((always_inline)) {
            return __builtin_shufflevector(load<Half>(at(lane) + k), load<Half>(at(lane + 2) + k), 0, 1, 2, 3);
        };
        const Real ab02 = halves(0, 0);
        const Real ab13 = halves(1, 0);
        const Real cd02 = halves(0, 2);
        const Real cd13 = halves(1, 2);
        return {__builtin_shufflevector(ab02, ab13, 0, 4, 2, 6), __builtin_shufflevector(ab02, ab13, 1, 5, 3, 7),
                __builtin_shufflevector(cd02, cd13, 0, 4, 2, 6), __builtin_shufflevector(cd02, cd13, 1, 5, 3, 7)};
    } else {
        using Quad = typename LaneTypes<4, NumberOf<Real>>::Real;
        return join<Real>([&](std::size_t lane) __attribute__((always_inline)) { return load<Quad>(at(lane)); });
    }
}

/// The k-th part of a register. A shuffle would permute the whole.
template <class Part, class Whole>
HAPTIC_LANES Part part_of(const Whole& whole, std::size_t k) noexcept {
    Part part;
    __builtin_memcpy(&part, reinterpret_cast<const char*>(&whole) + k * sizeof(Part), sizeof(Part));
    return part;
}

/// Stores the four numbers of each lane at address at(lane).
template <class Real, class At>
HAPTIC_LANES void scatter(const LaneRow<Real>& value, const At& at) noexcept {
    if constexpr (kLanes<Real> == 1) {
        store(value.a, at(0));
        store(value.b, at(0) + 1);
        store(value.c, at(0) + 2);
        store(value.d, at(0) + 3);
    } else if constexpr (kLanes<Real> == 2) {
        store<Real>(__builtin_shufflevector(value.a, value.b, 0, 2), at(0));
        store<Real>(__builtin_shufflevector(value.c, value.d, 0, 2), at(0) + 2);
        store<Real>(__builtin_shufflevector(value.a, value.b, 1, 3), at(1));
        store<Real>(__builtin_shufflevector(value.c, value.d, 1, 3), at(1) + 2);
    } else if constexpr (kLanes<Real> == 4 && sizeof(NumberOf<Real>) == sizeof(double)) {
        // As in gather(), half rows from either half of a register.
        using Half = typename LaneTypes<2>::Real;
        const Real ab[2] = {__builtin_shufflevector(value.a, value.b, 0, 4, 2, 6),
                            __builtin_shufflevector(value.a, value.b, 1, 5, 3, 7)};
        const Real cd[2] = {__builtin_shufflevector(value.c, value.d, 0, 4, 2, 6),
                            __builtin_shufflevector(value.c, value.d, 1, 5, 3, 7)};
        for (std::size_t lane = 0; lane < 4; ++lane) {
            store(part_of<Half>(ab[lane % 2], lane / 2), at(lane));
            store(part_of<Half>(cd[lane % 2], lane / 2), at(lane) + 2);
        }
    } else {
        using Quad = typename LaneTypes<4, NumberOf<Real>>::Real;
        const auto put = [&](const Real& rows, std::size_t k) __attribute__((always_inline)) {
            for (std::size_t p = 0; p < kLanes<Real> / 4; ++p) {
                store(part_of<Quad>(rows, p), at(4 * p + k));
            }
        };
        const LaneRow<Real> row = transposed(value);
        put(row.a, 0);
        put(row.b, 1);
        put(row.c, 2);
        put(row.d, 3);
    }
}

/// Stores the four numbers of each lane one after another, from `to`.
template <class Real>
HAPTIC_LANES void store_rows(const LaneRow<Real>& value, NumberOf<Real>* to) noexcept {
    if constexpr (kLanes<Real> == 8) {
        // Each register of the result holds the rows of two lanes.
        const Real ab_low = __builtin_shufflevector(value.a, value.b, 0, 8, 1, 9, 2, 10, 3, 11);
        const Real ab_high = __builtin_shufflevector(value.a, value.b, 4, 12, 5, 13, 6, 14, 7, 15);
        const Real cd_low = __builtin_shufflevector(value.c, value.d, 0, 8, 1, 9, 2, 10, 3, 11);
        const Real cd_high = __builtin_shufflevector(value.c, value.d, 4, 12, 5, 13, 6, 14, 7, 15);
        store(__builtin_shufflevector(ab_low, cd_low, 0, 1, 8, 9, 2, 3, 10, 11), to);
        store(__builtin_shufflevector(ab_low, cd_low, 4, 5, 12, 13, 6, 7, 14, 15), to + 8);
        store(__builtin_shufflevector(ab_high, cd_high, 0, 1, 8, 9, 2, 3, 10, 11), to + 16);
        store(__builtin_shufflevector(ab_high, cd_high, 4, 5, 12, 13, 6, 7, 14, 15), to + 24);
    } else {
        scatter<Real>(value, [to](std::size_t lane) __attribute__((always_inline)) { return to + 4 * lane; });
    }
}

/// One ParticleF32 per lane.
template <class Real>
struct LaneParticle {
    LaneRow<Real> displacement, orientation;
};

/// Loads the ParticleF32 at address at(lane) into each lane.
template <class Real, class At>
HAPTIC_LANES LaneParticle<Real> gather_particles(const At& at) noexcept {
    if constexpr (kLanes<Real> == 16) {
        using Eight = typename LaneTypes<8, float>::Real;
        const auto two = [&](std::size_t k) __attribute__((always_inline)) {
            return __builtin_shufflevector(load<Eight>(at(k)), load<Eight>(at(4 + k)), 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10,
                                           11, 12, 13, 14, 15);
        };
        LaneRow<Real> displacement{};
        LaneRow<Real> orientation{};
        // Each pair of registers holds four particles: the first four numbers of each are its displacement.
        const auto part = [&](std::size_t k, Real& displacement_part,
                              Real& orientation_part) __attribute__((always_inline)) {
            const Real low = two(k);
            const Real high = two(8 + k);
            displacement_part =
                __builtin_shufflevector(low, high, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27);
            orientation_part =
                __builtin_shufflevector(low, high, 4, 5, 6, 7, 12, 13, 14, 15, 20, 21, 22, 23, 28, 29, 30, 31);
        };
        part(0, displacement.a, orientation.a);
        part(1, displacement.b, orientation.b);
        part(2, displacement.c, orientation.c);
        part(3, displacement.d, orientation.d);
        return {transposed(displacement), transposed(orientation)};
    } else {
        return {gather<Real>(at),
                gather<Real>([&](std::size_t lane) __attribute__((always_inline)) { return at(lane) + 4; })};
    }
}

/// Register that holds a row of doubles, or a part of one: the machine's width where it has this many lanes of float.
template <std::size_t Lanes>
using DoublePiece = typename LaneTypes<((Lanes + 1) / 2 < 4 ? (Lanes + 1) / 2 : 4)>::Real;
template <std::size_t Lanes>
inline constexpr std::size_t kDoublePieces = 4 / kLanes<DoublePiece<Lanes>>;

/// One Row in registers.
template <std::size_t Lanes>
struct DoubleRow {
    DoublePiece<Lanes> piece[kDoublePieces<Lanes>];
};

template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> load_row(const Row& from) noexcept {
    DoubleRow<Lanes> row{};
    for (std::size_t p = 0; p < kDoublePieces<Lanes>; ++p) {
        row.piece[p] = load<DoublePiece<Lanes>>(from.number + p * kLanes<DoublePiece<Lanes>>);
    }
    return row;
}
template <std::size_t Lanes>
HAPTIC_LANES void store_row(const DoubleRow<Lanes>& row, Row& to) noexcept {
    for (std::size_t p = 0; p < kDoublePieces<Lanes>; ++p) {
        store(row.piece[p], to.number + p * kLanes<DoublePiece<Lanes>>);
    }
}
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> operator-(DoubleRow<Lanes> a, const DoubleRow<Lanes>& b) noexcept {
    for (std::size_t p = 0; p < kDoublePieces<Lanes>; ++p) {
        a.piece[p] -= b.piece[p];
    }
    return a;
}
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> operator+(DoubleRow<Lanes> a, const DoubleRow<Lanes>& b) noexcept {
    for (std::size_t p = 0; p < kDoublePieces<Lanes>; ++p) {
        a.piece[p] += b.piece[p];
    }
    return a;
}
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> operator*(double s, DoubleRow<Lanes> a) noexcept {
    for (std::size_t p = 0; p < kDoublePieces<Lanes>; ++p) {
        a.piece[p] *= s;
    }
    return a;
}
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> operator*(DoubleRow<Lanes> a, const DoubleRow<Lanes>& b) noexcept {
    for (std::size_t p = 0; p < kDoublePieces<Lanes>; ++p) {
        a.piece[p] *= b.piece[p];
    }
    return a;
}

/// The k-th number of a row.
template <std::size_t Lanes>
HAPTIC_LANES double number_of(const DoubleRow<Lanes>& row, std::size_t k) noexcept {
    constexpr std::size_t lanes = kLanes<DoublePiece<Lanes>>;
    if constexpr (lanes == 1) {
        return row.piece[k];
    } else {
        return row.piece[k / lanes][k % lanes];
    }
}

/// A row of three numbers and 0, without a way through memory.
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> row_of_three(double x, double y, double z) noexcept {
    constexpr std::size_t lanes = kLanes<DoublePiece<Lanes>>;
    if constexpr (lanes == 1) {
        return {{x, y, z, 0.0}};
    } else if constexpr (lanes == 2) {
        return {{DoublePiece<Lanes>{x, y}, DoublePiece<Lanes>{z, 0.0}}};
    } else {
        return {{DoublePiece<Lanes>{x, y, z, 0.0}}};
    }
}

/// One FloatRow: a register, except with one lane.
template <std::size_t Lanes>
using QuadOf = std::conditional_t<Lanes == 1, FloatRow, typename LaneTypes<4, float>::Real>;

template <std::size_t Lanes>
HAPTIC_LANES QuadOf<Lanes> load_quad(const FloatRow& from) noexcept {
    if constexpr (Lanes == 1) {
        return from;
    } else {
        return load<QuadOf<Lanes>>(from.number);
    }
}
template <std::size_t Lanes>
HAPTIC_LANES void store_quad(const QuadOf<Lanes>& row, FloatRow& to) noexcept {
    if constexpr (Lanes == 1) {
        to = row;
    } else {
        store(row, to.number);
    }
}

template <std::size_t Lanes>
HAPTIC_LANES QuadOf<Lanes> rounded(const DoubleRow<Lanes>& row) noexcept {
    if constexpr (Lanes == 1) {
        return {{static_cast<float>(row.piece[0]), static_cast<float>(row.piece[1]), static_cast<float>(row.piece[2]),
                 static_cast<float>(row.piece[3])}};
    } else if constexpr (Lanes == 4) {
        return QuadOf<Lanes>{static_cast<float>(row.piece[0][0]), static_cast<float>(row.piece[0][1]),
                             static_cast<float>(row.piece[1][0]), static_cast<float>(row.piece[1][1])};
    } else {
        return __builtin_convertvector(row.piece[0], QuadOf<Lanes>);
    }
}

template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> widened(const QuadOf<Lanes>& row) noexcept {
    if constexpr (Lanes == 1) {
        return {{row.number[0], row.number[1], row.number[2], row.number[3]}};
    } else if constexpr (Lanes == 4) {
        return {{DoublePiece<Lanes>{row[0], row[1]}, DoublePiece<Lanes>{row[2], row[3]}}};
    } else {
        return {{DoublePiece<Lanes>{row[0], row[1], row[2], row[3]}}};  // __builtin_convertvector is slow with g++ 12
    }
}

/// Doubles in a register of the same size: half as many lanes, at least one.
template <class Real>
using Wide = typename LaneTypes<(kLanes<Real> + 1) / 2>::Real;

/// Columns of the rows row(lane), one for each lane of a Wide<Real>.
template <class Real, class RowAt>
HAPTIC_LANES LaneRow<Wide<Real>> columns(const RowAt& row) noexcept {
    if constexpr (kLanes<Real> == 1) {
        const DoubleRow<1> only = row(0);
        return {only.piece[0], only.piece[1], only.piece[2], only.piece[3]};
    } else if constexpr (kLanes<Real> == 4) {
        return join_halves<Wide<Real>>([&](std::size_t lane, std::size_t which)
                                           __attribute__((always_inline)) { return row(lane).piece[which]; });
    } else {
        return join<Wide<Real>>([&](std::size_t lane) __attribute__((always_inline)) { return row(lane).piece[0]; });
    }
}

}  // namespace haptic::sim
