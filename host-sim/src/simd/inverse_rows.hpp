// Sweeps of inverse.hpp with registers of `Width` numbers. Only one source file may instantiate each width (see
// lanes.hpp).
#pragma once

#include "simd/inverse.hpp"
#include "simd/lanes.hpp"

namespace haptic::sim {

template <std::size_t Width>
class InverseRows {
  public:
    HAPTIC_LANES static void run(const InverseTask& task) noexcept {
        for (std::size_t first = 0; first < task.rows; first += kPivotRows) {
            const std::size_t left = task.rows - first;
            sweep(task, first, left < kPivotRows ? left : kPivotRows);
        }
        // The sweeps leave minus the inverse.
        const std::size_t stride = inverse_stride(task.rows);
        for (std::size_t i = 0; i < task.rows; ++i) {
            for (std::size_t j = 0; j <= i; ++j) {
                task.matrix[i * stride + j] = -task.matrix[i * stride + j];
            }
        }
    }

  private:
    using Real = typename LaneTypes<Width>::Real;

    /// Sweeps the `size` rows from `first` on.
    HAPTIC_LANES static void sweep(const InverseTask& task, std::size_t first, std::size_t size) noexcept {
        const std::size_t stride = inverse_stride(task.rows);
        double* const a = task.matrix;
        // A_iJ for every i: the rows of the pivot up to its diagonal block, the columns below. A short pivot is filled
        // up with columns of 0.
        for (std::size_t c = 0; c < kPivotRows; ++c) {
            double* const column = task.pivot + c * stride;
            for (std::size_t i = 0; i < task.rows; ++i) {
                const std::size_t row = first + c;
                column[i] = c >= size ? 0.0 : i <= row ? a[row * stride + i] : a[i * stride + row];
            }
        }
        // D^-1.
        double inverse[kPivotRows][kPivotRows] = {};
        for (std::size_t r = 0; r < size; ++r) {
            for (std::size_t c = 0; c < size; ++c) {
                inverse[r][c] = task.pivot[c * stride + first + r];
            }
        }
        invert(inverse, size, task.min_pivot);
        // All other rows, and A_iJ D^-1 into the pivot's place.
        for (std::size_t i = 0; i < task.rows; ++i) {
            if (i >= first && i < first + size) {
                continue;
            }
            double factor[kPivotRows];
            for (std::size_t c = 0; c < kPivotRows; ++c) {
                double sum = 0.0;
                for (std::size_t k = 0; k < kPivotRows; ++k) {
                    sum += task.pivot[k * stride + i] * inverse[k][c];
                }
                factor[c] = sum;
            }
            subtract(a + i * stride, factor, task.pivot, stride, i + 1);
            for (std::size_t c = 0; c < size; ++c) {
                a[i < first ? (first + c) * stride + i : i * stride + first + c] = factor[c];
            }
        }
        for (std::size_t r = 0; r < size; ++r) {
            for (std::size_t c = 0; c <= r; ++c) {
                a[(first + r) * stride + first + c] = -inverse[r][c];
            }
        }
    }

    /// row -= sum of factor[k] times the pivot's column k; `count` elements, filled up to whole registers.
    HAPTIC_LANES static void subtract(double* row, const double (&factor)[kPivotRows], const double* pivot,
                                      std::size_t stride, std::size_t count) noexcept {
        static_assert(kPivotRows == 6 && kInverseStride % Width == 0);
        Real f[kPivotRows];
        for (std::size_t k = 0; k < kPivotRows; ++k) {
            f[k] = broadcast<Real>(factor[k]);
        }
        const auto term = [&](std::size_t k, std::size_t at) { return f[k] * load<Real>(pivot + k * stride + at); };
        for (std::size_t at = 0; at < count; at += Width) {
            const Real sum = ((term(0, at) + term(1, at)) + (term(2, at) + term(3, at))) + (term(4, at) + term(5, at));
            store(load<Real>(row + at) - sum, row + at);
        }
    }

    /// Inverse of a small matrix, by sweeps of one row.
    HAPTIC_LANES static void invert(double (&m)[kPivotRows][kPivotRows], std::size_t size, double min_pivot) noexcept {
        for (std::size_t k = 0; k < size; ++k) {
            const double d = 1.0 / (m[k][k] > min_pivot ? m[k][k] : min_pivot);
            for (std::size_t r = 0; r < size; ++r) {
                for (std::size_t c = 0; r != k && c < size; ++c) {
                    m[r][c] -= c == k ? 0.0 : m[r][k] * d * m[k][c];
                }
            }
            for (std::size_t r = 0; r < size; ++r) {
                m[r][k] *= r == k ? 1.0 : d;
                m[k][r] *= r == k ? 1.0 : d;
            }
            m[k][k] = -d;
        }
        for (std::size_t r = 0; r < size; ++r) {
            for (std::size_t c = 0; c < size; ++c) {
                m[r][c] = -m[r][c];
            }
        }
    }
};

}  // namespace haptic::sim
