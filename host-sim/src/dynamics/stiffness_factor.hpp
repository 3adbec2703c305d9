// Sparse Cholesky factors of a symmetric, positive definite matrix, L D L^T, for many solutions with one matrix.
//
// Rows are ordered by approximate minimum degree (P. Amestoy, T. Davis, I. Duff, 1996) and factorised one after another
// along the elimination tree (T. Davis, "Algorithm 849: A Concise Sparse Cholesky Factorization Package", 2005).
//
// A right-hand side has four columns, solved side by side: x, y and z of the particles, or four forces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamics/constraint_batches.hpp"
#include "simd/elastic.hpp"

namespace haptic::sim {

/// An element of the lower triangle; elements that are named more than once add up.
struct MatrixElement {
    std::uint32_t row = 0;
    std::uint32_t column = 0;
    double value = 0.0;
};

class StiffnessFactor {
  public:
    /// Orders and factorises. Throws std::invalid_argument if the matrix is not positive definite.
    StiffnessFactor(std::size_t size, std::span<const MatrixElement> lower);

    /// Replaces each row of the right-hand side by that of the solution.
    void solve(const ElasticKernels& kernels, std::span<Row> sides) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return order_.size(); }
    /// Elements of L below the diagonal.
    [[nodiscard]] std::size_t fill() const noexcept { return below_.size(); }

  private:
    std::vector<std::uint32_t> order_;  // per row of the factors: row of the matrix
    std::vector<std::uint32_t> first_;  // per column: its first element of `below_`; one more at the end
    std::vector<std::uint32_t> row_;
    std::vector<double> below_;
    std::vector<double> inverse_diagonal_;  // 1 / D
    LaneArray<Row> ordered_;
};

}  // namespace haptic::sim
