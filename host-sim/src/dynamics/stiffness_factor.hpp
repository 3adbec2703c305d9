// Sparse Cholesky factors of a symmetric, positive definite matrix, L D L^T, for many solutions with one matrix.
//
// Rows are ordered by approximate minimum degree (P. Amestoy, T. Davis, I. Duff, 1996) and factorised one after another
// along the elimination tree (T. Davis, "Algorithm 849: A Concise Sparse Cholesky Factorization Package", 2005).
// Consecutive columns with nearly the same pattern form panels, in which one solution reads each row once for all of
// them (C. Ashcraft, R. Grimes, "The influence of relaxed supernode partitions on the multifrontal method", 1989).
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

/// An element of the lower triangle of mass / h^2 + viscosity / h + stiffness; elements named more than once add up.
struct MatrixElement {
    std::uint32_t row = 0;
    std::uint32_t column = 0;
    double stiffness = 0.0;  // N/m
    double viscosity = 0.0;  // N s/m
    double mass = 0.0;       // kg
};

class StiffnessFactor {
  public:
    /// Orders the unknowns and allocates for `slots` factorisations.
    StiffnessFactor(std::size_t size, std::span<const MatrixElement> lower, std::size_t slots);

    /// Factorises for a sub-step of length h, s, into this slot; `own_damping`, s, times the stiffness is taken off the
    /// viscosity. No allocation. False if the matrix is not positive definite: no solve() then.
    [[nodiscard]] bool factorise(std::size_t slot, double h, double own_damping = 0.0) noexcept;

    /// Replaces each row of the right-hand side by that of the solution, with the factors in this slot. Of two sides
    /// the first three numbers of each row, to the same bits: a second one takes little more time than one alone. No
    /// allocation.
    void solve(const ElasticKernels& kernels, std::size_t slot, std::span<Row> sides,
               std::span<Row> more_sides = {}) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return order_.size(); }
    /// Elements of L that a solution reads.
    [[nodiscard]] std::size_t fill() const noexcept { return fill_; }

  private:
    /// The upper triangle by columns, each element once.
    struct UpperColumns {
        std::vector<std::uint32_t> first;  // per column, and one more
        std::vector<std::uint32_t> row;
        std::vector<double> stiffness;
        std::vector<double> viscosity;
        std::vector<double> mass;
    };
    struct Factors {
        std::vector<double> below;
        std::vector<double> inverse_diagonal;  // 1 / D
    };

    using RowLists = std::vector<std::vector<std::uint32_t>>;

    void find_columns(std::size_t size, std::span<const MatrixElement> lower,
                      const std::vector<std::uint32_t>& position);
    [[nodiscard]] RowLists find_patterns() const;
    void form_panels(const RowLists& below);
    void list_columns_by_row();

    std::vector<std::uint32_t> order_;  // per row of the factors: row of the matrix
    UpperColumns upper_;                // in the order of the factors
    std::vector<FactorPanel> panels_;
    std::vector<std::uint32_t> panel_of_;      // per column
    std::vector<std::uint32_t> row_;           // of panels
    std::vector<std::uint32_t> first_column_;  // per row, and one more: its range of column_
    std::vector<std::uint32_t> column_;        // with an element in the row, in ascending order
    std::size_t fill_ = 0;
    std::vector<Factors> slots_;
    LaneArray<Row> ordered_;  // of both right-hand sides
    // Scratch of factorise(), per row.
    std::vector<std::uint32_t> end_;  // of each column so far: a row of its panel
    std::vector<double> side_;
};

}  // namespace haptic::sim
