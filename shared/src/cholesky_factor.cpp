#include "haptic/cholesky_factor.hpp"

#include <algorithm>

#include "vector_kernels.hpp"

namespace haptic {

CholeskyFactor::CholeskyFactor(std::size_t capacity)
    : capacity_(capacity),
      rows_(capacity * capacity, 0.0),
      diagonal_(capacity, 1.0),
      inverse_diagonal_(capacity, 1.0),
      right_side_(capacity, 0.0),
      removed_(capacity, 0.0) {}

void CholeskyFactor::solve_transposed(double* x) const HAPTIC_RT {
    // Forward substitution by columns of U^T: subtract x_i times row i of U from the unknowns that follow.
    for (std::size_t i = 0; i < size_; ++i) {
        add_scaled(x + i + 1, -x[i], row(i) + i + 1, size_ - i - 1);
    }
}

void CholeskyFactor::solve_transposed(Elements* x) const HAPTIC_RT {
    for (std::size_t i = 0; i < size_; ++i) {
        subtract_scaled(x + i + 1, x[i], row(i) + i + 1, size_ - i - 1);
    }
}

void CholeskyFactor::solve_transposed_last(Elements* x) const HAPTIC_RT {
    const std::size_t last = size_ - 1;
    Elements element = x[last];
    for (std::size_t i = 0; i < last; ++i) {
        for (std::size_t vector = 0; vector < kTogether; ++vector) {
            element[vector] -= x[i][vector] * row(i)[last];
        }
    }
    x[last] = element;
}

double CholeskyFactor::squared_length(const double* x) const HAPTIC_RT {
    return weighted_squares(x, inverse_diagonal_.data(), size_);
}

void CholeskyFactor::solve_upper(double* x) const HAPTIC_RT {
    for (std::size_t i = 0; i < size_; ++i) {
        x[i] *= inverse_diagonal_[i];
    }
    substitute_back(x);
}

/// x <- U^-1 x.
void CholeskyFactor::substitute_back(double* x) const HAPTIC_RT {
    // Several rows of U at a time: what the unknowns behind them contribute does not wait for one another.
    constexpr std::size_t block = 4;
    for (std::size_t end = size_; end > 0; end -= std::min(block, end)) {
        const std::size_t begin = end - std::min(block, end);
        for (std::size_t i = begin; i < end; ++i) {
            x[i] -= dot_of_fours(row(i) + end, x + end, size_ - end);
        }
        for (std::size_t i = end; i-- > begin;) {
            for (std::size_t k = i + 1; k < end; ++k) {
                x[i] -= row(i)[k] * x[k];
            }
        }
    }
}

void CholeskyFactor::append(const double* reduced, double pivot, double right_side) HAPTIC_RT {
    // The new row of W becomes the last column of U.
    for (std::size_t i = 0; i < size_; ++i) {
        row(i)[size_] = reduced[i] * inverse_diagonal_[i];
    }
    diagonal_[size_] = pivot;
    inverse_diagonal_[size_] = 1.0 / pivot;
    right_side_[size_] = (right_side - dot(reduced, right_side_.data(), size_)) * inverse_diagonal_[size_];
    ++size_;
}

void CholeskyFactor::remove(std::size_t position) HAPTIC_RT {
    // Rows above: remove the column.
    for (std::size_t i = 0; i < position; ++i) {
        double* above = row(i);
        std::copy(above + position + 1, above + size_, above + position);
    }
    // The rows below lose nothing but what row u of U has taken from them: their part of W is U^T D U + weight u^T u.
    // One row after another takes its share of u; each moves one row up and one column to the left.
    std::copy(row(position) + position, row(position) + size_,
              removed_.begin() + static_cast<std::ptrdiff_t>(position));
    double weight = diagonal_[position];
    double right_side = right_side_[position];
    for (std::size_t i = position + 1; i < size_; ++i) {
        const double first = removed_[i];
        const double diagonal = diagonal_[i] + weight * first * first;
        const double inverse = 1.0 / diagonal;
        const double factor = first * weight * inverse;
        weight *= diagonal_[i] * inverse;
        diagonal_[i - 1] = diagonal;
        inverse_diagonal_[i - 1] = inverse;
        // The remaining columns, and the right side.
        add_row(removed_.data() + i + 1, row(i - 1) + i, row(i) + i + 1, first, factor, size_ - i - 1);
        right_side -= first * right_side_[i];
        right_side_[i - 1] = right_side_[i] + factor * right_side;
    }
    --size_;
}

void CholeskyFactor::set_right_side(const double* b) HAPTIC_RT {
    std::copy_n(b, size_, right_side_.data());
    solve_transposed(right_side_.data());
    for (std::size_t i = 0; i < size_; ++i) {
        right_side_[i] *= inverse_diagonal_[i];
    }
}

void CholeskyFactor::solve(double* x) const HAPTIC_RT {
    std::copy_n(right_side_.data(), size_, x);
    substitute_back(x);
}

}  // namespace haptic
