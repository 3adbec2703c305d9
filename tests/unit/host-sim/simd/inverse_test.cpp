#include "simd/inverse.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

using Matrix = Eigen::MatrixXd;

/// Symmetric, with eigenvalues from 1 to 10^decades in a random basis.
Matrix random_matrix(Eigen::Index n, double decades, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const Matrix columns = Matrix::NullaryExpr(n, n, [&](Eigen::Index, Eigen::Index) { return normal(random); });
    const Matrix basis = columns.householderQr().householderQ();
    Eigen::VectorXd eigenvalues(n);
    for (Eigen::Index k = 0; k < n; ++k) {
        eigenvalues[k] = std::pow(10.0, decades * static_cast<double>(k) / static_cast<double>(n));
    }
    return basis * eigenvalues.asDiagonal() * basis.transpose();
}

Matrix inverse_by(const Kernels& kernels, const Matrix& matrix) {
    const auto n = static_cast<std::size_t>(matrix.rows());
    const std::size_t stride = inverse_stride(n);
    std::vector<double> memory(n * stride, 0.0);
    std::vector<double> pivot(kPivotRows * stride, 0.0);
    const auto element = [&](Eigen::Index i, Eigen::Index j) -> double& {
        return memory[static_cast<std::size_t>(i) * stride + static_cast<std::size_t>(j)];
    };
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
        for (Eigen::Index j = 0; j <= i; ++j) {
            element(i, j) = matrix(i, j);
        }
    }
    kernels.inverse({.matrix = memory.data(), .rows = n, .min_pivot = 0.5, .pivot = pivot.data()});
    Matrix out(matrix.rows(), matrix.cols());
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
        for (Eigen::Index j = 0; j <= i; ++j) {
            out(i, j) = out(j, i) = element(i, j);
        }
    }
    return out;
}

TEST(Inverse, EqualsThatOfAnOrthogonalDecomposition) {
    for (const double decades : {0.0, 3.0, 8.0}) {
        for (const Eigen::Index n : {1, 3, 5, 6, 7, 12, 39, 111, 192}) {
            const Matrix a = random_matrix(n, decades, static_cast<unsigned>(n));
            const Matrix expected = a.fullPivHouseholderQr().inverse();
            // The error grows with the condition number.
            const double bound = 1e-14 * static_cast<double>(n) * std::pow(10.0, decades);
            EXPECT_LT((inverse_by(widest_kernels(), a) - expected).cwiseAbs().maxCoeff(), bound) << n;
        }
    }
}

TEST(Inverse, HasTheSameBitsForEveryWidth) {
    for (const Eigen::Index n : {2, 6, 9, 111, 189}) {
        const Matrix a = random_matrix(n, 4.0, static_cast<unsigned>(n));
        const Matrix expected = inverse_by(kOneLaneKernels, a);
        for (const Kernels* kernels : usable_kernels()) {
            EXPECT_TRUE(inverse_by(*kernels, a) == expected) << n;
        }
    }
}

TEST(Inverse, StaysFiniteWhereRoundingLeavesNoPivot) {
    // Of rank 1 to rounding; 0.5 is the bound of the eigenvalues that inverse_by() states.
    const Matrix a = Matrix::Constant(12, 12, 1e18);
    EXPECT_TRUE(inverse_by(widest_kernels(), a).allFinite());
}

}  // namespace
}  // namespace haptic::sim
