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
        first_.push_back(static_cast<std::uint32_t>(below_.size()));
        inverse_diagonal_.push_back(1.0 / factors.vectorD()[column]);
    }
    ordered_.resize(size);
}

void StiffnessFactor::solve(const ElasticKernels& kernels, std::span<Row> sides) noexcept {
    for (std::size_t p = 0; p < order_.size(); ++p) {
        ordered_[p] = sides[order_[p]];
    }
    kernels.solve({.rows = order_.size(),
                   .first = first_.data(),
                   .row = row_.data(),
                   .below = below_.data(),
                   .inverse_diagonal = inverse_diagonal_.data(),
                   .side = ordered_.data()});
    for (std::size_t p = 0; p < order_.size(); ++p) {
        sides[order_[p]] = ordered_[p];
    }
}

}  // namespace haptic::sim
