#include "haptic/cholesky_factor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <vector>

#include "contact_tools.hpp"

namespace haptic {
namespace {

using contact_tools::Random;

constexpr Eigen::Index kRows = 40;

/// A factor, the rows of W that it should hold, and W.
struct Selection {
    Eigen::MatrixXd w;
    CholeskyFactor factor{kRows};
    std::vector<Eigen::Index> rows{};

    void append(Eigen::Index row) {
        Eigen::VectorXd reduced(rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) {
            reduced[static_cast<Eigen::Index>(i)] = w(rows[i], row);
        }
        factor.solve_transposed(reduced.data());
        factor.append(reduced.data(), w(row, row) - reduced.squaredNorm());
        rows.push_back(row);
    }
    void remove(std::size_t position) {
        factor.remove(position);
        rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(position));
    }
    /// Largest element of W_SS x - b for the x that the factor returns, and a b of random elements.
    double error(Random& random) const {
        Eigen::VectorXd b(rows.size());
        for (double& element : b) {
            element = random.normal();
        }
        Eigen::VectorXd x = b;
        factor.solve_transposed(x.data());
        factor.solve_upper(x.data());
        double largest = 0.0;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            double sum = -b[static_cast<Eigen::Index>(i)];
            for (std::size_t j = 0; j < rows.size(); ++j) {
                sum += w(rows[i], rows[j]) * x[static_cast<Eigen::Index>(j)];
            }
            largest = std::max(largest, std::abs(sum));
        }
        return largest;
    }
};

Eigen::MatrixXd random_matrix(Random& random) {
    Eigen::MatrixXd factor(kRows, kRows);
    for (double& element : factor.reshaped()) {
        element = random.normal();
    }
    return factor * factor.transpose() + Eigen::MatrixXd::Identity(kRows, kRows);
}

TEST(CholeskyFactor, SolvesForTheRowsThatWereAppendedAndNotRemoved) {
    Random random(1);
    Selection selection{.w = random_matrix(random)};
    std::vector<Eigen::Index> others;
    for (Eigen::Index row = 0; row < kRows; ++row) {
        others.push_back(row);
    }
    for (int i = 0; i < 2000; ++i) {
        const bool append = selection.rows.empty() || (!others.empty() && random.integer(0, 1) == 0);
        const int last = static_cast<int>(append ? others.size() : selection.rows.size()) - 1;
        const auto position = static_cast<std::size_t>(random.integer(0, last));
        if (append) {
            selection.append(others[position]);
            others.erase(others.begin() + static_cast<std::ptrdiff_t>(position));
        } else {
            others.push_back(selection.rows[position]);
            selection.remove(position);
        }
        ASSERT_EQ(selection.factor.size(), selection.rows.size());
        ASSERT_LE(selection.error(random), 1e-11);
    }
}

TEST(CholeskyFactor, HoldsAsManyRowsAsItWasMadeForAndNoneAfterClear) {
    Random random(2);
    Selection selection{.w = random_matrix(random)};
    for (Eigen::Index row = kRows; row-- > 0;) {
        selection.append(row);
    }
    EXPECT_LE(selection.error(random), 1e-11);
    selection.factor.clear();
    EXPECT_EQ(selection.factor.size(), 0u);
}

}  // namespace
}  // namespace haptic
