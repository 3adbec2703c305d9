#include "dynamics/stiffness_factor.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <compare>
#include <limits>
#include <numeric>
#include <utility>

namespace haptic::sim {
namespace {

constexpr std::uint32_t kRoot = std::numeric_limits<std::uint32_t>::max();
// Elements of a panel per element of L in it, at most: zeros cost less than more panels, to a point.
constexpr double kMaxPadding = 1.3;

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
    : order_(size), panel_of_(size), ordered_(2 * size), end_(size), side_(size, 0.0) {
    const std::vector<std::uint32_t> position = little_fill(size, lower);
    for (std::uint32_t i = 0; i < size; ++i) {
        order_[position[i]] = i;
    }
    find_columns(size, lower, position);
    form_panels(find_patterns());
    list_columns_by_row();
    slots_.assign(slots, {std::vector<double>(fill_, 0.0), std::vector<double>(size)});
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

/// The rows of L's elements below the diagonal, per column, from the elimination tree.
StiffnessFactor::RowLists StiffnessFactor::find_patterns() const {
    RowLists below(order_.size());
    std::vector<std::uint32_t> parent(order_.size(), kRoot);
    std::vector<std::uint32_t> seen(order_.size());
    for (std::uint32_t k = 0; k < order_.size(); ++k) {
        seen[k] = k;
        for (std::uint32_t e = upper_.first[k]; e < upper_.first[k + 1]; ++e) {
            // Row k of L has an element in each column on the way from this one to k.
            for (std::uint32_t i = upper_.row[e]; seen[i] != k; i = parent[i]) {
                if (parent[i] == kRoot) {
                    parent[i] = k;
                }
                below[i].push_back(k);
                seen[i] = k;
            }
        }
    }
    return below;
}

void StiffnessFactor::form_panels(const RowLists& below) {
    for (std::uint32_t first = 0; first < below.size(); first += panels_.back().width) {
        // The next column has all rows of this one but its own, if it is the first of them.
        std::size_t width = 1;
        std::size_t elements = below[first].size();
        for (std::size_t next = first + 1; width < kPanelColumns && next < below.size(); ++next, ++width) {
            if (below[next - 1].empty() || below[next - 1].front() != next) {
                break;
            }
            const std::size_t with_next = elements + below[next].size();
            const std::size_t stored = (width + 1) * (below[next].size() + width);
            if (static_cast<double>(stored) > kMaxPadding * static_cast<double>(with_next + width * (width + 1))) {
                break;
            }
            elements = with_next;
        }
        const std::vector<std::uint32_t>& common = below[first + width - 1];
        const FactorPanel panel{.column = first,
                                .width = static_cast<std::uint32_t>(width),
                                .first_row = static_cast<std::uint32_t>(row_.size()),
                                .rows = static_cast<std::uint32_t>(width + common.size()),
                                .first = static_cast<std::uint32_t>(fill_)};
        for (std::uint32_t c = first; c < first + width; ++c) {
            panel_of_[c] = static_cast<std::uint32_t>(panels_.size());
            row_.push_back(c);
        }
        row_.insert(row_.end(), common.begin(), common.end());
        panels_.push_back(panel);
        fill_ += static_cast<std::size_t>(panel.rows) * width;
    }
}

void StiffnessFactor::list_columns_by_row() {
    const auto for_each_element = [&](auto&& call) {
        for (const FactorPanel& panel : panels_) {
            for (std::uint32_t t = 1; t < panel.rows; ++t) {
                for (std::uint32_t c = 0; c < std::min(t, panel.width); ++c) {
                    call(row_[panel.first_row + t], panel.column + c);
                }
            }
        }
    };
    first_column_.assign(order_.size() + 1, 0);
    for_each_element([&](std::uint32_t row, std::uint32_t) { ++first_column_[row + 1]; });
    std::partial_sum(first_column_.begin(), first_column_.end(), first_column_.begin());
    column_.resize(first_column_.back());
    std::vector<std::uint32_t> next(first_column_.begin(), first_column_.end() - 1);
    for_each_element([&](std::uint32_t row, std::uint32_t column) { column_[next[row]++] = column; });
}

bool StiffnessFactor::factorise(std::size_t slot, double h, double own_damping) noexcept {
    std::vector<double>& below = slots_[slot].below;
    std::vector<double>& inverse_diagonal = slots_[slot].inverse_diagonal;
    const double by_mass = 1.0 / (h * h);
    const double by_viscosity = 1.0 / h;
    const double by_stiffness = 1.0 - own_damping / h;
    for (const FactorPanel& panel : panels_) {
        std::iota(end_.begin() + panel.column, end_.begin() + panel.column + panel.width, 1U);
    }
    // Row by row of L: L_k. solves the triangle above with column k of the matrix.
    for (std::uint32_t k = 0; k < order_.size(); ++k) {
        for (std::uint32_t e = upper_.first[k]; e < upper_.first[k + 1]; ++e) {
            side_[upper_.row[e]] +=
                by_stiffness * upper_.stiffness[e] + by_viscosity * upper_.viscosity[e] + by_mass * upper_.mass[e];
        }
        double diagonal = side_[k];
        side_[k] = 0.0;
        for (std::uint32_t e = first_column_[k]; e < first_column_[k + 1]; ++e) {
            const std::uint32_t column = column_[e];
            const FactorPanel& panel = panels_[panel_of_[column]];
            const std::uint32_t c = column - panel.column;
            const std::uint32_t* const row = row_.data() + panel.first_row;
            double* const element = below.data() + panel.first + c;
            const double known = side_[column];
            side_[column] = 0.0;
            const std::size_t width = panel.width;
            for (std::size_t t = c + 1; t < end_[column]; ++t) {
                side_[row[t]] -= element[t * width] * known;
            }
            const double found = known * inverse_diagonal[column];
            diagonal -= found * known;
            element[end_[column] * width] = found;
            ++end_[column];
        }
        if (!(diagonal > 0.0)) {
            return false;
        }
        inverse_diagonal[k] = 1.0 / diagonal;
    }
    return true;
}

void StiffnessFactor::solve(const ElasticKernels& kernels, std::size_t slot, std::span<Row> sides,
                            std::span<Row> more_sides) noexcept {
    const auto apply = [&](auto* function) {
        function({.panels = panels_.size(),
                  .panel = panels_.data(),
                  .row = row_.data(),
                  .below = slots_[slot].below.data(),
                  .inverse_diagonal = slots_[slot].inverse_diagonal.data(),
                  .side = ordered_.data()});
    };
    const std::size_t size = order_.size();
    if (more_sides.empty()) {
        for (std::size_t p = 0; p < size; ++p) {
            ordered_[p] = sides[order_[p]];
        }
        apply(kernels.solve_side);
        for (std::size_t p = 0; p < size; ++p) {
            sides[order_[p]] = ordered_[p];
        }
        return;
    }
    // Six numbers of each row, one after the other, and two that stay 0.
    const auto copy = [&](const auto& each) {
        for (std::size_t p = 0; p < size; ++p) {
            double* const numbers = ordered_[2 * p].number;
            for (std::size_t c = 0; c < 3; ++c) {
                each(sides[order_[p]].number[c], numbers[c]);
                each(more_sides[order_[p]].number[c], numbers[3 + c]);
            }
            numbers[6] = numbers[7] = 0.0;
        }
    };
    copy([](double& side, double& ordered) { ordered = side; });
    apply(kernels.solve_two_sides);
    copy([](double& side, double& ordered) { side = ordered; });
}

}  // namespace haptic::sim
