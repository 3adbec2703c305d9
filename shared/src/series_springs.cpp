#include "haptic/series_springs.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>

namespace haptic {
namespace {

constexpr std::size_t kUnknowns = 6;
using Vec6 = std::array<double, kUnknowns>;
using Mat6 = std::array<Vec6, kUnknowns>;  // symmetric; only the lower triangle is used

// Armijo condition: a step must achieve this fraction of the decrease that the gradient predicts.
constexpr double kArmijo = 1e-4;
constexpr int kMaxHalvings = 12;

double dot(const Vec6& a, const Vec6& b) HAPTIC_RT {
    double sum = 0.0;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        sum += a[i] * b[i];
    }
    return sum;
}

/// from + factor * step.
Vec6 plus_scaled(const Vec6& from, double factor, const Vec6& step) HAPTIC_RT {
    Vec6 to;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        to[i] = from[i] + factor * step[i];
    }
    return to;
}

/// The function to minimise, divided by the stiffness: E(z) = |z|^2 / 2 + sum [s - a . z]+^2 / 2, with z = (u, c phi)
/// and a = (n, r x n / c), where c is the scale that makes both springs of the grip unit springs.
// Rows from index count on are not read; the 12 kB are not cleared in each tick.
// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init)
struct Energy {
    struct Row {
        Vec6 a;
        double depth;
        std::uint32_t source;  // index in the caller's rows
    };
    std::array<Row, kMaxSpringRows> rows;
    std::size_t count = 0;

    /// The function evaluated at a point.
    struct Evaluation {
        Vec6 z;
        double value;
        Vec6 gradient;
        std::array<std::uint64_t, kMaxSpringRows / 64> active;  // bit per row: s - a . z > 0
        [[nodiscard]] bool is_active(std::size_t row) const HAPTIC_RT {
            return ((active[row / 64] >> (row % 64)) & 1u) != 0;
        }
    };
    static_assert(kMaxSpringRows % 64 == 0);

    [[nodiscard]] Evaluation evaluate(const Vec6& z) const HAPTIC_RT {
        Evaluation here{z, 0.5 * dot(z, z), z, {}};
        for (std::size_t k = 0; k < count; ++k) {
            // Remaining depth of an active row: it contributes its square / 2, and -depth * a to the gradient.
            const double remaining = rows[k].depth - dot(rows[k].a, z);
            if (remaining > 0.0) {
                here.value += 0.5 * remaining * remaining;
                here.gradient = plus_scaled(here.gradient, -remaining, rows[k].a);
                here.active[k / 64] |= std::uint64_t{1} << (k % 64);
            }
        }
        return here;
    }

    /// Newton step -H^-1 gradient, with the Hessian H = I + sum a a^T over the active rows.
    [[nodiscard]] Vec6 newton_step(const Evaluation& here) const HAPTIC_RT;
};

Vec6 Energy::newton_step(const Evaluation& here) const HAPTIC_RT {
    // H = I + sum a a^T, lower triangle.
    Mat6 h{};
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        h[i][i] = 1.0;
    }
    for (std::size_t k = 0; k < count; ++k) {
        if (here.is_active(k)) {
            const Vec6& a = rows[k].a;
            for (std::size_t i = 0; i < kUnknowns; ++i) {
                for (std::size_t j = 0; j <= i; ++j) {
                    h[i][j] += a[i] * a[j];
                }
            }
        }
    }
    // In-place factorisation L D L^T. H - I is positive semidefinite, so every pivot is at least 1; the clamp only
    // corrects rounding.
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            // L_ij = (h_ij - sum L_im D_m L_jm) / D_j with m < j.
            double sum = h[i][j];
            for (std::size_t m = 0; m < j; ++m) {
                sum -= h[i][m] * h[m][m] * h[j][m];
            }
            h[i][j] = sum / h[j][j];
        }
        // D_i = h_ii - sum L_im^2 D_m.
        for (std::size_t m = 0; m < i; ++m) {
            h[i][i] -= h[i][m] * h[i][m] * h[m][m];
        }
        h[i][i] = std::max(h[i][i], 1.0);
    }
    // Forward substitution L y = -gradient, then D L^T x = y.
    Vec6 x;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        x[i] = -here.gradient[i];
        for (std::size_t m = 0; m < i; ++m) {
            x[i] -= h[i][m] * x[m];
        }
    }
    // Division by D, and back substitution with L^T.
    for (std::size_t i = kUnknowns; i-- > 0;) {
        x[i] /= h[i][i];
        for (std::size_t m = i + 1; m < kUnknowns; ++m) {
            x[i] -= h[m][i] * x[m];
        }
    }
    return x;
}

}  // namespace

double gyration(double squares, std::size_t count) HAPTIC_RT {
    return count > 0 ? std::sqrt(2.0 / 3.0 * squares / static_cast<double>(count)) : 0.0;
}

Wrench SeriesSprings::solve(std::span<SpringRow> all_rows, const SeriesCoupling& coupling) HAPTIC_RT {
    Wrench wrench;
    stored_energy_ = 0.0;
    rounds_ = 0;
    // Rows that do not push keep a push of zero.
    double squares = 0.0;
    for (SpringRow& row : all_rows) {
        row.push = 0.0;
    }
    // Without a positive depth the minimum is z = 0, with no force.
    const std::span<SpringRow> given = all_rows.first(std::min(all_rows.size(), kMaxSpringRows));
    for (const SpringRow& row : given) {
        squares += row.depth > 0.0 ? row.depth * row.depth : 0.0;
    }
    if (!(squares > 0.0) || !(coupling.stiffness > 0.0)) {
        offset_ = {};
        return wrench;
    }
    // c = rho sqrt(k_t / k), m: z = (u, c phi) turns k_t rho^2 |phi|^2 / 2 into k |z|^2 / 2.
    const double angular_scale = coupling.gyration * std::sqrt(coupling.torque_stiffness / coupling.stiffness);
    // E(z) <= E(0) = squares / 2 implies |z| <= sqrt(squares): skip the rows that cannot become active within this
    // distance.
    const double max_distance = std::sqrt(squares);
    Energy energy;
    for (std::size_t k = 0; k < given.size(); ++k) {
        // Row in the scaled unknowns: a = (n, r x n / c), and |a|.
        const SpringRow& row = given[k];
        const Vec3 angular = angular_scale > 0.0 ? glm::cross(row.moment_arm, row.normal) / angular_scale : Vec3(0.0);
        const double size = std::sqrt(glm::dot(row.normal, row.normal) + glm::dot(angular, angular));
        if (row.depth + size * max_distance > 0.0) {
            energy.rows[energy.count++] = {{row.normal.x, row.normal.y, row.normal.z, angular.x, angular.y, angular.z},
                                           row.depth,
                                           static_cast<std::uint32_t>(k)};
        }
    }
    // Warm start at the previous solution, unless z = 0 is better.
    Energy::Evaluation here = energy.evaluate(offset_);
    if (!(here.value <= 0.5 * squares)) {
        here = energy.evaluate(Vec6{});
    }
    // Newton's method. If a full step keeps the set of active rows, the function was quadratic along it and the minimum
    // is exact. Otherwise halve the step until the Armijo condition holds.
    bool exact = false;
    while (!exact && rounds_ < kMaxRounds) {
        ++rounds_;
        // Newton step, and the Armijo bound on the change of E per unit of the step.
        const Vec6 step = energy.newton_step(here);
        const double required_change = kArmijo * dot(here.gradient, step);
        double factor = 1.0;
        // Full step first, then halvings.
        Energy::Evaluation there = energy.evaluate(plus_scaled(here.z, factor, step));
        exact = there.active == here.active;
        for (int i = 0; !exact && i < kMaxHalvings && !(there.value <= here.value + factor * required_change); ++i) {
            factor *= 0.5;
            there = energy.evaluate(plus_scaled(here.z, factor, step));
        }
        if (!exact && !(there.value < here.value)) {
            break;  // no decrease beyond rounding: converged
        }
        here = there;
    }
    // Forces at the minimum: push = k [s - a . z]+, F = sum push n, T = sum r x push (n + n x phi).
    offset_ = here.z;
    // phi back in radians; the energy back in joules.
    const Vec3 phi = angular_scale > 0.0 ? Vec3(offset_[3], offset_[4], offset_[5]) / angular_scale : Vec3(0.0);
    stored_energy_ = coupling.stiffness * here.value;
    for (std::size_t k = 0; k < energy.count; ++k) {
        if (here.is_active(k)) {
            SpringRow& row = given[energy.rows[k].source];
            // Force of one row, and its moment with the rotation between grip and tool.
            row.push = coupling.stiffness * (row.depth - dot(energy.rows[k].a, here.z));
            const Vec3 force = row.push * row.normal;
            wrench.force += force;
            wrench.torque += glm::cross(row.moment_arm, force + glm::cross(force, phi));
        }
    }
    return wrench;
}

}  // namespace haptic
