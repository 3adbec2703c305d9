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

/// Sum of a_i b_i in four interleaved partial sums, from the last four to the first; `count` is a multiple of four.
[[nodiscard]] inline double dot_of_fours(const double* a, const double* b, std::size_t count) HAPTIC_RT {
    std::array<double, 4> sums{};
    for (std::size_t i = count; i > 0; i -= sums.size()) {
        for (std::size_t lane = 0; lane < sums.size(); ++lane) {
            sums[lane] += a[i - sums.size() + lane] * b[i - sums.size() + lane];
        }
    }
    return (sums[0] + sums[2]) + (sums[1] + sums[3]);
}

/// Sum of a_i^2 w_i, in the order of dot().
[[nodiscard]] inline double weighted_squares(const double* a, const double* w, std::size_t count) HAPTIC_RT {
    std::array<double, 8> sums{};
    std::size_t i = 0;
    for (; i + sums.size() <= count; i += sums.size()) {
        for (std::size_t lane = 0; lane < sums.size(); ++lane) {
            sums[lane] += a[i + lane] * a[i + lane] * w[i + lane];
        }
    }
    double rest = 0.0;
    for (; i < count; ++i) {
        rest += a[i] * a[i] * w[i];
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

/// `choose` of `none` and of the value of each element, in eight interleaved parts; `choose` keeps its first argument
/// where the second one is a NaN.
template <class Value, class Choose>
[[nodiscard]] double chosen_of(const double* a, std::size_t count, double none, Value value, Choose choose) HAPTIC_RT {
    std::array<double, 8> chosen{none, none, none, none, none, none, none, none};
    std::size_t i = 0;
    for (; i + chosen.size() <= count; i += chosen.size()) {
        for (std::size_t lane = 0; lane < chosen.size(); ++lane) {
            chosen[lane] = choose(chosen[lane], value(a[i + lane]));
        }
    }
    for (; i < count; ++i) {
        chosen[0] = choose(chosen[0], value(a[i]));
    }
    return choose(choose(choose(chosen[0], chosen[4]), choose(chosen[1], chosen[5])),
                  choose(choose(chosen[2], chosen[6]), choose(chosen[3], chosen[7])));
}

/// Largest a_i, minus infinity without any; a NaN counts as that.
[[nodiscard]] inline double largest(const double* a, std::size_t count) HAPTIC_RT {
    return chosen_of(
        a, count, -std::numeric_limits<double>::infinity(), [](double x) HAPTIC_RT { return x; },
        [](double x, double y) HAPTIC_RT { return std::max(x, y); });
}

/// Smallest a_i, infinity without any; a NaN counts as that.
[[nodiscard]] inline double smallest(const double* a, std::size_t count) HAPTIC_RT {
    return chosen_of(
        a, count, std::numeric_limits<double>::infinity(), [](double x) HAPTIC_RT { return x; },
        [](double x, double y) HAPTIC_RT { return std::min(x, y); });
}

/// Largest |a_i|, 0 without any; a NaN counts as 0.
[[nodiscard]] inline double largest_magnitude(const double* a, std::size_t count) HAPTIC_RT {
    return chosen_of(
        a, count, 0.0, [](double x) HAPTIC_RT { return std::abs(x); },
        [](double x, double y) HAPTIC_RT { return std::max(x, y); });
}

/// Whether one of the first eight a_i is larger than b.
[[nodiscard]] inline bool one_of_eight_exceeds(const double* a, double b) HAPTIC_RT {
    int larger = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        larger |= a[i] > b ? 1 : 0;
    }
    return larger != 0;
}

/// y += factor * x.
inline void add_scaled(double* __restrict y, double factor, const double* __restrict x, std::size_t count) HAPTIC_RT {
    for (std::size_t i = 0; i < count; ++i) {
        y[i] += factor * x[i];
    }
}

/// y -= sum of factors[k] * x[k].
inline void subtract_combination(double* __restrict y, const std::array<double, 3>& factors,
                                 const std::array<const double*, 3>& x, std::size_t count) HAPTIC_RT {
    for (std::size_t i = 0; i < count; ++i) {
        y[i] -= (factors[0] * x[0][i] + factors[1] * x[1][i]) + factors[2] * x[2][i];
    }
}

/// y_i -= x_i * factors, of vectors that are interleaved.
template <std::size_t kCount>
void subtract_scaled(std::array<double, kCount>* __restrict y, const std::array<double, kCount>& factors,
                     const double* __restrict x, std::size_t count) HAPTIC_RT {
    const std::array<double, kCount> f = factors;
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t k = 0; k < kCount; ++k) {
            y[i][k] -= f[k] * x[i];
        }
    }
}

/// rest -= part * row; sum = row + factor * rest.
inline void add_row(double* __restrict rest, double* __restrict sum, const double* __restrict row, double part,
                    double factor, std::size_t count) HAPTIC_RT {
    for (std::size_t i = 0; i < count; ++i) {
        rest[i] -= part * row[i];
        sum[i] = row[i] + factor * rest[i];
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
