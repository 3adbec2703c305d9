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

/// Largest a_i, minus infinity without any; a NaN counts as that.
[[nodiscard]] inline double largest(const double* a, std::size_t count) HAPTIC_RT {
    constexpr double none = -std::numeric_limits<double>::infinity();
    std::array<double, 8> largest{none, none, none, none, none, none, none, none};
    std::size_t i = 0;
    for (; i + largest.size() <= count; i += largest.size()) {
        for (std::size_t lane = 0; lane < largest.size(); ++lane) {
            largest[lane] = std::max(largest[lane], a[i + lane]);
        }
    }
    for (; i < count; ++i) {
        largest[0] = std::max(largest[0], a[i]);
    }
    return std::max(std::max(std::max(largest[0], largest[4]), std::max(largest[1], largest[5])),
                    std::max(std::max(largest[2], largest[6]), std::max(largest[3], largest[7])));
}

/// Smallest a_i, infinity without any; a NaN counts as that.
[[nodiscard]] inline double smallest(const double* a, std::size_t count) HAPTIC_RT {
    constexpr double none = std::numeric_limits<double>::infinity();
    std::array<double, 8> smallest{none, none, none, none, none, none, none, none};
    std::size_t i = 0;
    for (; i + smallest.size() <= count; i += smallest.size()) {
        for (std::size_t lane = 0; lane < smallest.size(); ++lane) {
            smallest[lane] = std::min(smallest[lane], a[i + lane]);
        }
    }
    for (; i < count; ++i) {
        smallest[0] = std::min(smallest[0], a[i]);
    }
    return std::min(std::min(std::min(smallest[0], smallest[4]), std::min(smallest[1], smallest[5])),
                    std::min(std::min(smallest[2], smallest[6]), std::min(smallest[3], smallest[7])));
}

/// Largest |a_i|, 0 without any; a NaN counts as 0.
[[nodiscard]] inline double largest_magnitude(const double* a, std::size_t count) HAPTIC_RT {
    std::array<double, 8> largest{};
    std::size_t i = 0;
    for (; i + largest.size() <= count; i += largest.size()) {
        for (std::size_t lane = 0; lane < largest.size(); ++lane) {
            largest[lane] = std::max(largest[lane], std::abs(a[i + lane]));
        }
    }
    for (; i < count; ++i) {
        largest[0] = std::max(largest[0], std::abs(a[i]));
    }
    return std::max(std::max(std::max(largest[0], largest[4]), std::max(largest[1], largest[5])),
                    std::max(std::max(largest[2], largest[6]), std::max(largest[3], largest[7])));
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
