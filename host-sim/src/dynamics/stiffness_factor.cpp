#include "dynamics/stiffness_factor.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace haptic::sim {
namespace {

constexpr std::uint32_t kRoot = std::numeric_limits<std::uint32_t>::max();

/// The upper triangle by columns: entries with their rows, the diagonal included.
struct UpperColumns {
    std::vector<std::uint32_t> first;  // per column, and one more
    std::vector<std::uint32_t> row;
    std::vector<double> value;
};

/// Position of each row of the matrix in an order with little fill.
std::vector<std::uint32_t> little_fill(std::size_t size, std::span<const MatrixElement> lower) {
    Eigen::SparseMatrix<double> pattern(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(size));
    std::vector<Eigen::Triplet<double>> elements;
    elements.reserve(lower.size());
    for (const MatrixElement& e : lower) {
        elements.emplace_back(static_cast<int>(e.row), static_cast<int>(e.column), 1.0);
    }
    pattern.setFromTriplets(elements.begin(), elements.end());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
    Eigen::AMDOrdering<int>()(pattern.selfadjointView<Eigen::Lower>(), order);
    std::vector<std::uint32_t> position(size);
    for (std::size_t p = 0; p < size; ++p) {
        position[static_cast<std::size_t>(order.indices()[static_cast<Eigen::Index>(p)])] =
            static_cast<std::uint32_t>(p);
    }
    return position;
}

UpperColumns columns_of(std::size_t size, std::span<const MatrixElement> lower,
                        const std::vector<std::uint32_t>& position) {
    UpperColumns upper;
    // Counted by column, then filled in.
    upper.first.assign(size + 1, 0);
    for (const MatrixElement& e : lower) {
        ++upper.first[std::max(position[e.row], position[e.column]) + 1];
    }
    std::partial_sum(upper.first.begin(), upper.first.end(), upper.first.begin());
    std::vector<std::uint32_t> next(upper.first.begin(), upper.first.end() - 1);
    upper.row.resize(lower.size());
    upper.value.resize(lower.size());
    for (const MatrixElement& e : lower) {
        const std::uint32_t a = position[e.row];
        const std::uint32_t b = position[e.column];
        const std::uint32_t k = next[std::max(a, b)]++;
        upper.row[k] = std::min(a, b);
        upper.value[k] = e.value;
    }
    return upper;
}

/// Parents in the elimination tree, and the number of elements of each column of L below the diagonal.
struct EliminationTree {
    std::vector<std::uint32_t> parent;
    std::vector<std::uint32_t> count;
};

EliminationTree eliminate(const UpperColumns& upper) {
    const std::size_t size = upper.first.size() - 1;
    EliminationTree tree{std::vector<std::uint32_t>(size, kRoot), std::vector<std::uint32_t>(size, 0)};
    std::vector<std::uint32_t> seen(size);
    for (std::uint32_t k = 0; k < size; ++k) {
        seen[k] = k;
        for (std::uint32_t e = upper.first[k]; e < upper.first[k + 1]; ++e) {
            // Row k of L has an element in each column on the way from this one to k.
            for (std::uint32_t i = upper.row[e]; seen[i] != k; i = tree.parent[i]) {
                if (tree.parent[i] == kRoot) {
                    tree.parent[i] = k;
                }
                ++tree.count[i];
                seen[i] = k;
            }
        }
    }
    return tree;
}

}  // namespace

StiffnessFactor::StiffnessFactor(std::size_t size, std::span<const MatrixElement> lower)
    : order_(size), first_(size + 1, 0), inverse_diagonal_(size), ordered_(size) {
    const std::vector<std::uint32_t> position = little_fill(size, lower);
    for (std::uint32_t i = 0; i < size; ++i) {
        order_[position[i]] = i;
    }
    const UpperColumns upper = columns_of(size, lower, position);
    const EliminationTree tree = eliminate(upper);
    std::partial_sum(tree.count.begin(), tree.count.end(), first_.begin() + 1);
    row_.resize(first_.back());
    below_.resize(first_.back());
    // Row by row of L: L_k. solves the triangle above with column k of the matrix.
    std::vector<std::uint32_t> end(first_.begin(), first_.end() - 1);  // of each column so far
    std::vector<std::uint32_t> seen(size);
    std::vector<std::uint32_t> pattern(size);
    std::vector<std::uint32_t> way(size);
    std::vector<double> side(size, 0.0);
    for (std::uint32_t k = 0; k < size; ++k) {
        // The columns with an element in row k, in the order in which they are eliminated.
        seen[k] = k;
        std::size_t top = size;
        for (std::uint32_t e = upper.first[k]; e < upper.first[k + 1]; ++e) {
            side[upper.row[e]] += upper.value[e];
            std::size_t length = 0;
            for (std::uint32_t i = upper.row[e]; seen[i] != k; i = tree.parent[i]) {
                way[length++] = i;
                seen[i] = k;
            }
            while (length > 0) {
                pattern[--top] = way[--length];
            }
        }
        double diagonal = side[k];
        side[k] = 0.0;
        for (; top < size; ++top) {
            const std::uint32_t column = pattern[top];
            const double known = side[column];
            side[column] = 0.0;
            for (std::uint32_t p = first_[column]; p < end[column]; ++p) {
                side[row_[p]] -= below_[p] * known;
            }
            const double element = known * inverse_diagonal_[column];
            diagonal -= element * known;
            row_[end[column]] = k;
            below_[end[column]] = element;
            ++end[column];
        }
        if (!(diagonal > 0.0)) {
            throw std::invalid_argument("elasticity: the stiffness matrix is not positive definite");
        }
        inverse_diagonal_[k] = 1.0 / diagonal;
    }
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
