// Dense vector operations of the contact solver. The order of the additions is part of the source, so that each
// compiler and vector width returns the same bits; the independent sums let compilers vectorise the loops.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "haptic/realtime.hpp"

namespace haptic {

/// Sum of a_i b_i, in eight interleaved partial sums.
[[nodiscard]] inline double dot(const double* a, const double* b, std::size_t count) HAPTIC_RT {
    std::array<double, 8> sums{};
    std::size_t i = 0;
    for (; i + sums.size() <= count; i += sums.size()) {
        for (std::size_t lane = 0; lane < sums.size(); ++lane) {
            sums[lane] += a[i + lane] * b[i + lane];
        }
    }
    double rest = 0.0;
    for (; i < count; ++i) {
        rest += a[i] * b[i];
    }
    return (((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))) + rest;
}

/// Sum of a_i, in the order of dot().
[[nodiscard]] inline double sum(const double* a, std::size_t count) HAPTIC_RT {
    std::array<double, 8> sums{};
    std::size_t i = 0;
    for (; i + sums.size() <= count; i += sums.size()) {
        for (std::size_t lane = 0; lane < sums.size(); ++lane) {
            sums[lane] += a[i + lane];
        }
    }
    double rest = 0.0;
    for (; i < count; ++i) {
        rest += a[i];
    }
    return (((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))) + rest;
}

/// Largest a_i, minus infinity without any; a NaN counts as that.
[[nodiscard]] inline double largest(const double* a, std::size_t count) HAPTIC_RT {
    constexpr double none = -std::numeric_limits<double>::infinity();
    std::array<double, 4> largest{none, none, none, none};
    std::size_t i = 0;
    for (; i + largest.size() <= count; i += largest.size()) {
        for (std::size_t lane = 0; lane < largest.size(); ++lane) {
            largest[lane] = std::max(largest[lane], a[i + lane]);
        }
    }
    for (; i < count; ++i) {
        largest[0] = std::max(largest[0], a[i]);
    }
    return std::max(std::max(largest[0], largest[1]), std::max(largest[2], largest[3]));
}

/// Largest |a_i|, 0 without any; a NaN counts as 0.
[[nodiscard]] inline double largest_magnitude(const double* a, std::size_t count) HAPTIC_RT {
    std::array<double, 4> largest{};
    std::size_t i = 0;
    for (; i + largest.size() <= count; i += largest.size()) {
        for (std::size_t lane = 0; lane < largest.size(); ++lane) {
            largest[lane] = std::max(largest[lane], std::abs(a[i + lane]));
        }
    }
    for (; i < count; ++i) {
        largest[0] = std::max(largest[0], std::abs(a[i]));
    }
    return std::max(std::max(largest[0], largest[1]), std::max(largest[2], largest[3]));
}

/// y += factor * x.
inline void add_scaled(double* __restrict y, double factor, const double* __restrict x, std::size_t count) HAPTIC_RT {
    for (std::size_t i = 0; i < count; ++i) {
        y[i] += factor * x[i];
    }
}

/// y -= sum of factors[k] * x[k], k < 3 or 4.
template <std::size_t kCount>
void subtract_combination(double* __restrict y, const std::array<double, kCount>& factors,
                          const std::array<const double*, kCount>& x, std::size_t count) HAPTIC_RT {
    static_assert(kCount == 3 || kCount == 4);
    for (std::size_t i = 0; i < count; ++i) {
        if constexpr (kCount == 4) {
            y[i] -= (factors[0] * x[0][i] + factors[1] * x[1][i]) + (factors[2] * x[2][i] + factors[3] * x[3][i]);
        } else {
            y[i] -= (factors[0] * x[0][i] + factors[1] * x[1][i]) + factors[2] * x[2][i];
        }
    }
}

/// y -= factors[k] * x[k], one k after the other: the bits of four calls of add_scaled() with the negative factors.
inline void subtract_in_turn(double* __restrict y, const std::array<double, 4>& factors,
                             const std::array<const double*, 4>& x, std::size_t count) HAPTIC_RT {
    for (std::size_t i = 0; i < count; ++i) {
        y[i] = (((y[i] - factors[0] * x[0][i]) - factors[1] * x[1][i]) - factors[2] * x[2][i]) - factors[3] * x[3][i];
    }
}

/// difference = a - b.
inline void subtract(double* __restrict difference, const double* __restrict a, const double* __restrict b,
                     std::size_t count) HAPTIC_RT {
    for (std::size_t i = 0; i < count; ++i) {
        difference[i] = a[i] - b[i];
    }
}

}  // namespace haptic
