// Cholesky factor W_SS = U^T D U of a growing and shrinking selection S of the rows of a symmetric positive definite
// matrix, with a diagonal D and a unit triangle U: without square roots. Appending a row takes O(n), removing one
// O(n^2); nothing is factorised again. The same holds for a right side b, which is kept as one more column of U:
// solving W_SS x = b_S again takes the back substitution alone.
// @source P. Gill, G. Golub, W. Murray, M. Saunders, "Methods for modifying matrix factorizations", 1974, method C1
#pragma once

#include <array>
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

    /// Vectors that are reduced together, element by element.
    static constexpr std::size_t kTogether = 4;
    using Elements = std::array<double, kTogether>;

    /// x <- U^-T x, size() elements.
    void solve_transposed(double* x) const HAPTIC_RT;
    /// The same for several vectors, with the same bits.
    void solve_transposed(Elements* x) const HAPTIC_RT;
    /// Their last element, after append(): those before are solved for.
    void solve_transposed_last(Elements* x) const HAPTIC_RT;
    /// x^T D^-1 x, size() elements.
    [[nodiscard]] double squared_length(const double* x) const HAPTIC_RT;
    /// x <- U^-1 D^-1 x, size() elements. After solve_transposed, x is the solution of W_SS x = b_S.
    void solve_upper(double* x) const HAPTIC_RT;
    /// Appends row q of W. `reduced` is U^-T W_Sq, size() elements; `pivot` is W_qq - squared_length(reduced),
    /// positive. `right_side` is b_q.
    void append(const double* reduced, double pivot, double right_side = 0.0) HAPTIC_RT;
    /// Removes row `position` of S; later rows move up by one.
    void remove(std::size_t position) HAPTIC_RT;
    /// Sets b_S, size() elements.
    void set_right_side(const double* b) HAPTIC_RT;
    /// x, size() elements: the solution of W_SS x = b_S.
    void solve(double* x) const HAPTIC_RT;

  private:
    [[nodiscard]] double* row(std::size_t i) HAPTIC_RT { return &rows_[i * capacity_]; }
    [[nodiscard]] const double* row(std::size_t i) const HAPTIC_RT { return &rows_[i * capacity_]; }
    void substitute_back(double* x) const HAPTIC_RT;

    std::size_t capacity_;
    std::size_t size_ = 0;
    std::vector<double> rows_;              // U right of its diagonal, row by row
    std::vector<double> diagonal_;          // D, positive
    std::vector<double> inverse_diagonal_;  // D^-1
    std::vector<double> right_side_;        // D^-1 U^-T b_S
    std::vector<double> removed_;           // scratch: what remains of the row that remove() takes away
};

}  // namespace haptic
