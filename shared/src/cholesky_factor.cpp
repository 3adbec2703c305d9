#include "haptic/cholesky_factor.hpp"

#include <algorithm>
#include <cmath>

#include "vector_kernels.hpp"

namespace haptic {

CholeskyFactor::CholeskyFactor(std::size_t capacity)
    : capacity_(capacity),
      rows_(capacity * capacity, 0.0),
      diagonal_(capacity, 1.0),
      inverse_diagonal_(capacity, 1.0) {}

void CholeskyFactor::solve_transposed(double* x) const HAPTIC_RT {
    // Forward substitution by columns of U^T: subtract x_i times row i of U from the unknowns that follow.
    for (std::size_t i = 0; i < size_; ++i) {
        x[i] *= inverse_diagonal_[i];
        add_scaled(x + i + 1, -x[i], row(i) + i + 1, size_ - i - 1);
    }
}

void CholeskyFactor::solve_upper(double* x) const HAPTIC_RT {
    // Back substitution by rows of U.
    for (std::size_t i = size_; i-- > 0;) {
        x[i] = (x[i] - dot(row(i) + i + 1, x + i + 1, size_ - i - 1)) * inverse_diagonal_[i];
    }
}

void CholeskyFactor::append(const double* reduced, double pivot) HAPTIC_RT {
    // The new row of W becomes the last column of U.
    for (std::size_t i = 0; i < size_; ++i) {
        row(i)[size_] = reduced[i];
    }
    diagonal_[size_] = std::sqrt(pivot);
    inverse_diagonal_[size_] = 1.0 / diagonal_[size_];
    ++size_;
}

void CholeskyFactor::remove(std::size_t position) HAPTIC_RT {
    // Rows above: remove the column.
    for (std::size_t i = 0; i < position; ++i) {
        double* above = row(i);
        std::copy(above + position + 1, above + size_, above + position);
    }
    // From `position` on, each column without its old diagonal element reaches one row too low. Givens rotations of
    // rows i and i + 1 make U triangular again: row i turns into the final row i, one column to the left; row i + 1
    // carries the rest on.
    for (std::size_t i = position; i + 1 < size_; ++i) {
        double* upper = row(i);
        double* lower = row(i + 1);
        // Rotation that eliminates the diagonal element of the lower row.
        const double length = std::sqrt(upper[i + 1] * upper[i + 1] + diagonal_[i + 1] * diagonal_[i + 1]);
        const double cosine = upper[i + 1] / length;
        const double sine = diagonal_[i + 1] / length;
        diagonal_[i] = length;
        inverse_diagonal_[i] = 1.0 / length;
        // The remaining columns of both rows.
        for (std::size_t k = i + 2; k < size_; ++k) {
            const double a = upper[k];
            const double b = lower[k];
            upper[k - 1] = cosine * a + sine * b;
            lower[k] = cosine * b - sine * a;
        }
    }
    --size_;
}

}  // namespace haptic
