#include "dynamics/stiffness_factor.hpp"

#include <Eigen/SparseCholesky>
#include <stdexcept>

namespace haptic::sim {

StiffnessFactor::StiffnessFactor(std::size_t size, std::span<const MatrixElement> lower) {
    using Sparse = Eigen::SparseMatrix<double>;
    std::vector<Eigen::Triplet<double>> elements;
    elements.reserve(lower.size());
    for (const MatrixElement& e : lower) {
        elements.emplace_back(static_cast<int>(e.row), static_cast<int>(e.column), e.value);
    }
    Sparse matrix(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(size));
    matrix.setFromTriplets(elements.begin(), elements.end());
    const Eigen::SimplicialLDLT<Sparse, Eigen::Lower> factors(matrix);
    if (factors.info() != Eigen::Success || !(factors.vectorD().size() == 0 || factors.vectorD().minCoeff() > 0.0)) {
        throw std::invalid_argument("elasticity: the stiffness matrix is not positive definite");
    }
    // Row p of the factors is row order_[p] of the matrix.
    order_.resize(size);
    for (std::size_t i = 0; i < size; ++i) {
        order_[static_cast<std::size_t>(factors.permutationP().indices()[static_cast<Eigen::Index>(i)])] =
            static_cast<std::uint32_t>(i);
    }
    const Sparse& l = factors.matrixL().nestedExpression();
    first_.push_back(0);
    for (Eigen::Index column = 0; column < l.outerSize(); ++column) {
        for (Sparse::InnerIterator element(l, column); element; ++element) {
            if (element.row() > column) {
                row_.push_back(static_cast<std::uint32_t>(element.row()));
                below_.push_back(element.value());
            }
        }
        first_.push_back(below_.size());
        inverse_diagonal_.push_back(1.0 / factors.vectorD()[column]);
    }
    ordered_.resize(size);
}

void StiffnessFactor::solve(std::span<Row> sides) noexcept {
    const std::size_t n = order_.size();
    for (std::size_t p = 0; p < n; ++p) {
        ordered_[p] = sides[order_[p]];
    }
    // L y = b, column by column.
    for (std::size_t column = 0; column < n; ++column) {
        const Row known = ordered_[column];
        for (std::size_t k = first_[column]; k < first_[column + 1]; ++k) {
            Row& to = ordered_[row_[k]];
            for (std::size_t lane = 0; lane < 4; ++lane) {
                to.number[lane] -= below_[k] * known.number[lane];
            }
        }
    }
    // L^T x = y / D, from the last column to the first.
    for (std::size_t column = n; column-- > 0;) {
        Row sum = ordered_[column];
        for (double& number : sum.number) {
            number *= inverse_diagonal_[column];
        }
        for (std::size_t k = first_[column]; k < first_[column + 1]; ++k) {
            const Row& from = ordered_[row_[k]];
            for (std::size_t lane = 0; lane < 4; ++lane) {
                sum.number[lane] -= below_[k] * from.number[lane];
            }
        }
        ordered_[column] = sum;
    }
    for (std::size_t p = 0; p < n; ++p) {
        sides[order_[p]] = ordered_[p];
    }
}

}  // namespace haptic::sim
