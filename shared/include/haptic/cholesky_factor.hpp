// Cholesky factor W_SS = U^T U of a growing and shrinking selection S of the rows of a symmetric positive definite
// matrix. Appending a row takes O(n), removing one O(n^2); nothing is factorised again.
// @source G. Golub, C. Van Loan, Matrix Computations, section 6.5 (updating matrix factorizations)
#pragma once

#include <cstddef>
#include <vector>

#include "haptic/realtime.hpp"

namespace haptic {

class CholeskyFactor {
  public:
    /// Allocates for at most `capacity` rows.
    explicit CholeskyFactor(std::size_t capacity);

    [[nodiscard]] std::size_t size() const HAPTIC_RT { return size_; }
    void clear() HAPTIC_RT { size_ = 0; }

    /// x <- U^-T x, size() elements.
    void solve_transposed(double* x) const HAPTIC_RT;
    /// x <- U^-1 x, size() elements. After solve_transposed, x is the solution of W_SS x = b_S.
    void solve_upper(double* x) const HAPTIC_RT;
    /// Appends row q of W. `reduced` is U^-T W_Sq, size() elements; `pivot` is W_qq - |reduced|^2, positive.
    void append(const double* reduced, double pivot) HAPTIC_RT;
    /// Removes row `position` of S; later rows move up by one.
    void remove(std::size_t position) HAPTIC_RT;

  private:
    [[nodiscard]] double* row(std::size_t i) HAPTIC_RT { return &rows_[i * capacity_]; }
    [[nodiscard]] const double* row(std::size_t i) const HAPTIC_RT { return &rows_[i * capacity_]; }

    std::size_t capacity_;
    std::size_t size_ = 0;
    std::vector<double> rows_;              // U right of its diagonal, row by row
    std::vector<double> diagonal_;          // of U, positive
    std::vector<double> inverse_diagonal_;  // 1 / diagonal_
};

}  // namespace haptic
