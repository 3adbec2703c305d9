#include "dynamics/stiffness_factor.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <compare>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace haptic::sim {
namespace {

constexpr std::uint32_t kRoot = std::numeric_limits<std::uint32_t>::max();

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

}  // namespace

StiffnessFactor::StiffnessFactor(std::size_t size, std::span<const MatrixElement> lower, std::size_t slots)
    : order_(size),
      parent_(size, kRoot),
      first_(size + 1, 0),
      ordered_(size),
      end_(size),
      seen_(size),
      pattern_(size),
      way_(size),
      side_(size, 0.0) {
    const std::vector<std::uint32_t> position = little_fill(size, lower);
    for (std::uint32_t i = 0; i < size; ++i) {
        order_[position[i]] = i;
    }
    find_columns(size, lower, position);
    find_tree();
    row_.resize(first_.back());
    slots_.assign(slots, {std::vector<double>(row_.size()), std::vector<double>(size)});
}

void StiffnessFactor::find_columns(std::size_t size, std::span<const MatrixElement> lower,
                                   const std::vector<std::uint32_t>& position) {
    // By column, then row of the factors; what adds up stays in the order given.
    struct Place {
        std::uint32_t column, row;
        std::size_t element;
        auto operator<=>(const Place&) const = default;
    };
    std::vector<Place> sorted(lower.size());
    for (std::size_t e = 0; e < lower.size(); ++e) {
        const auto [row, column] = std::minmax(position[lower[e].row], position[lower[e].column]);
        sorted[e] = {column, row, e};
    }
    std::sort(sorted.begin(), sorted.end());
    upper_.first.assign(size + 1, 0);
    for (std::size_t k = 0; k < sorted.size(); ++k) {
        const auto [column, row, element] = sorted[k];
        if (k == 0 || row != sorted[k - 1].row || column != sorted[k - 1].column) {
            upper_.row.push_back(row);
            upper_.stiffness.push_back(0.0);
            upper_.viscosity.push_back(0.0);
            upper_.mass.push_back(0.0);
            ++upper_.first[column + 1];
        }
        upper_.stiffness.back() += lower[element].stiffness;
        upper_.viscosity.back() += lower[element].viscosity;
        upper_.mass.back() += lower[element].mass;
    }
    std::partial_sum(upper_.first.begin(), upper_.first.end(), upper_.first.begin());
}

/// Finds the elimination tree, and how many elements each column of L has below the diagonal.
void StiffnessFactor::find_tree() {
    for (std::uint32_t k = 0; k < order_.size(); ++k) {
        seen_[k] = k;
        for (std::uint32_t e = upper_.first[k]; e < upper_.first[k + 1]; ++e) {
            // Row k of L has an element in each column on the way from this one to k.
            for (std::uint32_t i = upper_.row[e]; seen_[i] != k; i = parent_[i]) {
                if (parent_[i] == kRoot) {
                    parent_[i] = k;
                }
                ++first_[i + 1];
                seen_[i] = k;
            }
        }
    }
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
}

void StiffnessFactor::factorise(std::size_t slot, double h) {
    std::vector<double>& below = slots_[slot].below;
    std::vector<double>& inverse_diagonal = slots_[slot].inverse_diagonal;
    const double by_mass = 1.0 / (h * h);
    const double by_viscosity = 1.0 / h;
    std::copy(first_.begin(), first_.end() - 1, end_.begin());
    std::fill(seen_.begin(), seen_.end(), kRoot);
    // Row by row of L: L_k. solves the triangle above with column k of the matrix.
    for (std::uint32_t k = 0; k < order_.size(); ++k) {
        // The columns with an element in row k, in the order in which they are eliminated.
        seen_[k] = k;
        std::size_t top = order_.size();
        for (std::uint32_t e = upper_.first[k]; e < upper_.first[k + 1]; ++e) {
            side_[upper_.row[e]] += upper_.stiffness[e] + by_viscosity * upper_.viscosity[e] + by_mass * upper_.mass[e];
            std::size_t length = 0;
            for (std::uint32_t i = upper_.row[e]; seen_[i] != k; i = parent_[i]) {
                way_[length++] = i;
                seen_[i] = k;
            }
            while (length > 0) {
                pattern_[--top] = way_[--length];
            }
        }
        double diagonal = side_[k];
        side_[k] = 0.0;
        for (; top < order_.size(); ++top) {
            const std::uint32_t column = pattern_[top];
            const double known = side_[column];
            side_[column] = 0.0;
            for (std::uint32_t p = first_[column]; p < end_[column]; ++p) {
                side_[row_[p]] -= below[p] * known;
            }
            const double element = known * inverse_diagonal[column];
            diagonal -= element * known;
            row_[end_[column]] = k;
            below[end_[column]] = element;
            ++end_[column];
        }
        if (!(diagonal > 0.0)) {
            throw std::invalid_argument("elasticity: the stiffness matrix is not positive definite");
        }
        inverse_diagonal[k] = 1.0 / diagonal;
    }
}

void StiffnessFactor::solve(const ElasticKernels& kernels, std::size_t slot, std::span<Row> sides) noexcept {
    for (std::size_t p = 0; p < order_.size(); ++p) {
        ordered_[p] = sides[order_[p]];
    }
    kernels.solve({.rows = order_.size(),
                   .first = first_.data(),
                   .row = row_.data(),
                   .below = slots_[slot].below.data(),
                   .inverse_diagonal = slots_[slot].inverse_diagonal.data(),
                   .side = ordered_.data()});
    for (std::size_t p = 0; p < order_.size(); ++p) {
        sides[order_[p]] = ordered_[p];
    }
}

}  // namespace haptic::sim
