// Inverse of a symmetric positive definite matrix, for registers of different width.
//
// The sweep operator takes pivot J = (p, p + 1, ...) into A: with D = A_JJ,
//     A_ij <- A_ij - A_iJ D^-1 A_Jj,   A_iJ <- A_iJ D^-1,   A_JJ <- -D^-1    (i, j not in J).
// Once every row was a pivot, A is minus its inverse. Nearly all of the n^3 operations are the first assignment, which
// runs along the rows of the lower triangle. The terms of each element are added in the same order for every width, so
// the bits are the same.
// @source K. Lange, "Numerical Analysis for Statisticians", 2010, section 7.4 (sweep operator); blocked here
#pragma once

#include <cstddef>

namespace haptic::sim {

/// Rows of one pivot.
inline constexpr std::size_t kPivotRows = 6;
/// The stride of the matrix is a multiple of this number of elements, that of the widest register.
inline constexpr std::size_t kInverseStride = 8;

/// Elements of a row of an n x n matrix in memory.
[[nodiscard]] constexpr std::size_t inverse_stride(std::size_t n) noexcept {
    return (n + kInverseStride - 1) / kInverseStride * kInverseStride;
}

struct InverseTask {
    double* matrix;    // in and out: lower triangle, row by row; the elements to its right are overwritten
    std::size_t rows;  // n; each row has inverse_stride(n) elements
    double min_pivot;  // positive lower bound of the eigenvalues: a smaller pivot is rounding
    double* pivot;     // scratch: kPivotRows * inverse_stride(n) elements, 0 in those beyond n
};

using InverseFunction = void (*)(const InverseTask&) noexcept;

}  // namespace haptic::sim
