#include "haptic/cholesky_factor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "contact_tools.hpp"

namespace haptic {
namespace {

using contact_tools::Random;

constexpr Eigen::Index kFactorRows = 40;

/// A factor, the rows of W that it should hold, W, and a right side.
struct Selection {
    Eigen::MatrixXd w;
    Eigen::VectorXd b = Eigen::VectorXd::Zero(kFactorRows);
    CholeskyFactor factor{kFactorRows};
    std::vector<Eigen::Index> rows{};

    void append(Eigen::Index row) {
        Eigen::VectorXd reduced(rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) {
            reduced[static_cast<Eigen::Index>(i)] = w(rows[i], row);
        }
        factor.solve_transposed(reduced.data());
        factor.append(reduced.data(), w(row, row) - factor.squared_length(reduced.data()), b[row]);
        rows.push_back(row);
    }
    void remove(std::size_t position) {
        factor.remove(position);
        rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(position));
    }
    /// Largest element of W_SS x - b_S for the x that the factor returns: with its right side, and with random
    /// elements.
    double error(Random& random) const {
        Eigen::VectorXd kept(rows.size());
        factor.solve(kept.data());
        Eigen::VectorXd other(rows.size());
        for (double& element : other) {
            element = random.normal();
        }
        Eigen::VectorXd solution = other;
        factor.solve_transposed(solution.data());
        factor.solve_upper(solution.data());
        return std::max(error_of(kept, b(rows)), error_of(solution, other));
    }
    double error_of(const Eigen::VectorXd& x, const Eigen::VectorXd& right_side) const {
        double largest = 0.0;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            double sum = -right_side[static_cast<Eigen::Index>(i)];
            for (std::size_t j = 0; j < rows.size(); ++j) {
                sum += w(rows[i], rows[j]) * x[static_cast<Eigen::Index>(j)];
            }
            largest = std::max(largest, std::abs(sum));
        }
        return largest;
    }
};

Eigen::VectorXd random_vector(Random& random) {
    Eigen::VectorXd vector(kFactorRows);
    for (double& element : vector) {
        element = random.normal();
    }
    return vector;
}

Eigen::MatrixXd random_matrix(Random& random) {
    Eigen::MatrixXd factor(kFactorRows, kFactorRows);
    for (double& element : factor.reshaped()) {
        element = random.normal();
    }
    return factor * factor.transpose() + Eigen::MatrixXd::Identity(kFactorRows, kFactorRows);
}

TEST(CholeskyFactor, SolvesForTheRowsThatWereAppendedAndNotRemoved) {
    Random random(1);
    Selection selection{.w = random_matrix(random), .b = random_vector(random)};
    std::vector<Eigen::Index> others;
    for (Eigen::Index row = 0; row < kFactorRows; ++row) {
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
    for (Eigen::Index row = kFactorRows; row-- > 0;) {
        selection.append(row);
    }
    EXPECT_LE(selection.error(random), 1e-11);
    // Another right side.
    selection.b = random_vector(random);
    const Eigen::VectorXd chosen = selection.b(selection.rows);
    selection.factor.set_right_side(chosen.data());
    EXPECT_LE(selection.error(random), 1e-11);
    selection.factor.clear();
    EXPECT_EQ(selection.factor.size(), 0u);
}

TEST(CholeskyFactor, ReducesSeveralVectorsWithTheBitsOfEach) {
    Random random(3);
    Selection selection{.w = random_matrix(random)};
    for (Eigen::Index row = 0; row + 1 < kFactorRows; ++row) {
        selection.append(row);
    }
    std::vector<CholeskyFactor::Elements> together(kFactorRows);
    std::array<Eigen::VectorXd, CholeskyFactor::kTogether> each;
    for (std::size_t k = 0; k < each.size(); ++k) {
        each[k] = random_vector(random);
        for (std::size_t i = 0; i < together.size(); ++i) {
            together[i][k] = each[k][static_cast<Eigen::Index>(i)];
        }
    }
    // The last element after its row has come.
    selection.factor.solve_transposed(together.data());
    selection.append(kFactorRows - 1);
    selection.factor.solve_transposed_last(together.data());
    for (std::size_t k = 0; k < each.size(); ++k) {
        selection.factor.solve_transposed(each[k].data());
        for (std::size_t i = 0; i < together.size(); ++i) {
            EXPECT_EQ(together[i][k], each[k][static_cast<Eigen::Index>(i)]);
        }
    }
}

}  // namespace
}  // namespace haptic
