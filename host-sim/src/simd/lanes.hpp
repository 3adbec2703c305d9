// Lane arithmetic: one number, or several side by side in a vector register.
//
// Constraints of one colour share no particle, so several are projected at once, one per lane. Code is written once,
// over a type Real, which is a number or the compiler's vector type. A vector operation rounds each lane as the scalar
// operation does, and none is contracted (-ffp-contract=off), so every lane has the bits of the scalar computation.
// Branches become select(): both sides are computed, then one is chosen.
//
// A function compiled for different instruction sets must not have the same name in both, or the linker may keep the
// copy with instructions that the machine lacks. Everything here is therefore either always inlined or a template over
// a width that only one source file uses, and nothing calls the standard library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

// Always inlined, even with little optimisation: a call would pass each vector through memory.
#define HAPTIC_LANES [[gnu::always_inline]] inline

namespace haptic::sim {

template <class Number>
using BitsOfNumber = std::conditional_t<sizeof(Number) == sizeof(std::int32_t), std::int32_t, std::int64_t>;

template <std::size_t Count, class Number = double>
struct LaneTypes {
    using Real [[gnu::vector_size(Count * sizeof(Number))]] = Number;
    using Bits [[gnu::vector_size(Count * sizeof(Number))]] = BitsOfNumber<Number>;
};
template <class Number>
struct LaneTypes<1, Number> {
    using Real = Number;
    using Bits = BitsOfNumber<Number>;
};

template <class Real>
struct LaneOf {
    using Number = std::remove_cvref_t<decltype(std::declval<Real&>()[0])>;
};
template <>
struct LaneOf<double> {
    using Number = double;
};
template <>
struct LaneOf<float> {
    using Number = float;
};

/// Type of one lane of a Real: double or float.
template <class Real>
using NumberOf = typename LaneOf<Real>::Number;
template <class Real>
inline constexpr std::size_t kBytesOfLane = sizeof(NumberOf<Real>);
template <class Real>
inline constexpr std::size_t kLanes = sizeof(Real) / kBytesOfLane<Real>;
template <class Real>
using BitsOf = typename LaneTypes<kLanes<Real>, NumberOf<Real>>::Bits;

/// Sets every lane to `value`.
template <class Real>
HAPTIC_LANES Real broadcast(NumberOf<Real> value) noexcept {
    return value - Real{};
}

/// Load from and store to consecutive numbers in memory, without alignment.
template <class Real>
HAPTIC_LANES Real load(const NumberOf<Real>* from) noexcept {
    Real result;
    __builtin_memcpy(&result, from, sizeof(Real));
    return result;
}

template <class Real>
HAPTIC_LANES void store(Real value, NumberOf<Real>* to) noexcept {
    __builtin_memcpy(to, &value, sizeof(Real));
}

/// Condition for select(): true in lanes whose number is not 0.
template <class Real>
HAPTIC_LANES auto load_mask(const BitsOfNumber<NumberOf<Real>>* from) noexcept {
    BitsOf<Real> bits;
    __builtin_memcpy(&bits, from, sizeof(bits));
    return bits != BitsOf<Real>{};
}

template <class Mask, class Real>
HAPTIC_LANES Real select(Mask condition, Real yes, Real no) noexcept {
    return condition ? yes : no;
}

template <class Real>
HAPTIC_LANES Real absolute(Real x) noexcept {
    constexpr auto magnitude_bits = std::numeric_limits<BitsOfNumber<NumberOf<Real>>>::max();
    const BitsOf<Real> bits = __builtin_bit_cast(BitsOf<Real>, x) & magnitude_bits;
    return __builtin_bit_cast(Real, bits);
}

template <class Real>
HAPTIC_LANES Real copy_sign(Real magnitude, Real sign) noexcept {
    constexpr auto magnitude_bits = std::numeric_limits<BitsOfNumber<NumberOf<Real>>>::max();
    constexpr auto sign_bit = std::numeric_limits<BitsOfNumber<NumberOf<Real>>>::min();
    const BitsOf<Real> bits = (__builtin_bit_cast(BitsOf<Real>, magnitude) & magnitude_bits) |
                              (__builtin_bit_cast(BitsOf<Real>, sign) & sign_bit);
    return __builtin_bit_cast(Real, bits);
}

template <class Real>
HAPTIC_LANES Real square_root(Real x) noexcept {
    if constexpr (std::is_same_v<Real, double>) {
        return __builtin_sqrt(x);
    } else if constexpr (std::is_same_v<Real, float>) {
        return __builtin_sqrtf(x);
    } else {
#if __has_builtin(__builtin_elementwise_sqrt)
        return __builtin_elementwise_sqrt(x);
#else
        return [&]<std::size_t... I>(std::index_sequence<I...>) {
            return Real{square_root<NumberOf<Real>>(x[I])...};  // one instruction, given -fno-math-errno
        }(std::make_index_sequence<kLanes<Real>>{});
#endif
    }
}

template <class Real>
struct LaneVec {
    Real x, y, z;
};

template <class Real>
HAPTIC_LANES LaneVec<Real> operator+(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class Real>
HAPTIC_LANES LaneVec<Real> operator-(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class Real>
HAPTIC_LANES LaneVec<Real> operator*(Real s, const LaneVec<Real>& a) noexcept {
    return {s * a.x, s * a.y, s * a.z};
}
template <class Real>
HAPTIC_LANES LaneVec<Real> operator/(const LaneVec<Real>& a, Real s) noexcept {
    return {a.x / s, a.y / s, a.z / s};
}
template <class Real>
HAPTIC_LANES Real dot(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class Real>
HAPTIC_LANES LaneVec<Real> cross(const LaneVec<Real>& a, const LaneVec<Real>& b) noexcept {
    return {a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y};
}
template <class Mask, class Real>
HAPTIC_LANES LaneVec<Real> select(Mask condition, const LaneVec<Real>& yes, const LaneVec<Real>& no) noexcept {
    return {select(condition, yes.x, no.x), select(condition, yes.y, no.y), select(condition, yes.z, no.z)};
}

/// 3 x 3 matrix by columns, as in glm.
template <class Real>
struct LaneMat {
    LaneVec<Real> x, y, z;
};

template <class Real>
HAPTIC_LANES LaneMat<Real> operator+(const LaneMat<Real>& a, const LaneMat<Real>& b) noexcept {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class Real>
HAPTIC_LANES LaneMat<Real> operator*(Real s, const LaneMat<Real>& a) noexcept {
    return {s * a.x, s * a.y, s * a.z};
}
template <class Real>
HAPTIC_LANES LaneVec<Real> operator*(const LaneMat<Real>& m, const LaneVec<Real>& v) noexcept {
    return v.x * m.x + v.y * m.y + v.z * m.z;
}
template <class Mask, class Real>
HAPTIC_LANES LaneMat<Real> select(Mask condition, const LaneMat<Real>& yes, const LaneMat<Real>& no) noexcept {
    return {select(condition, yes.x, no.x), select(condition, yes.y, no.y), select(condition, yes.z, no.z)};
}

/// Symmetric 3 x 3 matrix by its lower triangle.
template <class Real>
struct LaneSymmetric {
    Real xx, yy, zz, yx, zx, zy;
};

template <class Real>
HAPTIC_LANES LaneSymmetric<Real> operator+(const LaneSymmetric<Real>& a, const LaneSymmetric<Real>& b) noexcept {
    return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.yx + b.yx, a.zx + b.zx, a.zy + b.zy};
}

template <class Mask, class Real>
HAPTIC_LANES LaneSymmetric<Real> select(Mask condition, const LaneSymmetric<Real>& yes,
                                        const LaneSymmetric<Real>& no) noexcept {
    return {select(condition, yes.xx, no.xx), select(condition, yes.yy, no.yy), select(condition, yes.zz, no.zz),
            select(condition, yes.yx, no.yx), select(condition, yes.zx, no.zx), select(condition, yes.zy, no.zy)};
}

template <class Real>
struct LaneQuat {
    Real w, x, y, z;
};

template <class Real>
HAPTIC_LANES LaneQuat<Real> operator*(const LaneQuat<Real>& a, const LaneQuat<Real>& b) noexcept {
    return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z, a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x};
}
template <class Mask, class Real>
HAPTIC_LANES LaneQuat<Real> select(Mask condition, const LaneQuat<Real>& yes, const LaneQuat<Real>& no) noexcept {
    return {select(condition, yes.w, no.w), select(condition, yes.x, no.x), select(condition, yes.y, no.y),
            select(condition, yes.z, no.z)};
}

}  // namespace haptic::sim
