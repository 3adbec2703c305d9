#include "contact/half_spaces.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::sim {

namespace {

constexpr double kParallel = 1e-24;       // Gram determinant below which normals are linearly dependent
constexpr double kNearlyParallel = 1e-4;  // Gram determinant below which two planes are solved by sum and difference
constexpr int kMaxRefinements = 3;
constexpr int kMaxExchanges = 64;

/// Up to four half-spaces; at most three are active.
struct Basis {
    std::array<std::uint32_t, 4> index{};
    std::uint32_t count = 0;
};

/// Solves the normal equations dot(n[k], sum_i lambda[i] n[i]) = b[k] of one to three planes. False if the normals are
/// linearly dependent.
bool multipliers(const std::array<Vec3, 3>& n, const std::array<double, 3>& b, std::uint32_t count,
                 std::array<double, 3>& lambda) HAPTIC_RT {
    // One plane: unit normal, so the multiplier is the distance.
    if (count == 1) {
        lambda[0] = b[0];
        return true;
    }
    // Two planes: Cramer's rule with the Gram matrix [[1, g], [g, 1]].
    if (count == 2) {
        const double g = glm::dot(n[0], n[1]);
        const double det = 1.0 - g * g;
        if (det >= kNearlyParallel) {
            lambda[0] = (b[0] - g * b[1]) / det;
            lambda[1] = (b[1] - g * b[0]) / det;
            return true;
        }
        // Nearly parallel: the Gram determinant cancels. The sum and difference of unit normals are orthogonal at any
        // angle, so solve along these two directions instead.
        const Vec3 sum = n[0] + n[1];
        const Vec3 difference = n[0] - n[1];
        const double ss = glm::dot(sum, sum);
        const double dd = glm::dot(difference, difference);
        if (ss * dd < 4.0 * kParallel) {
            return false;
        }
        // Components of the displacement along sum and difference, converted back.
        const double along = (b[0] + b[1]) / ss;
        const double across = (b[0] - b[1]) / dd;
        lambda[0] = along + across;
        lambda[1] = along - across;
        return true;
    }
    // Three planes meet in a point: displacement = sum b_k (n_i x n_j) / det. The same dual vectors give the
    // multipliers.
    const double det = glm::dot(n[0], glm::cross(n[1], n[2]));
    if (det * det < kParallel) {
        return false;
    }
    const std::array<Vec3, 3> dual{glm::cross(n[1], n[2]) / det, glm::cross(n[2], n[0]) / det,
                                   glm::cross(n[0], n[1]) / det};
    const Vec3 shift = dual[0] * b[0] + dual[1] * b[1] + dual[2] * b[2];
    for (std::size_t k = 0; k < 3; ++k) {
        lambda[k] = glm::dot(dual[k], shift);
    }
    return true;
}

/// Solution on the boundaries of one set of planes.
struct ActiveSolution {
    Vec3 point{0.0};
    std::array<double, 3> lambda{};  // m, along the normal of each member
};

/// Nearest point to the target on all boundaries of `members`. False if a multiplier is negative (the plane would pull)
/// or the normals are dependent. Nearly parallel planes lose digits, which iterative refinement recovers.
bool solve_on(std::span<const HalfSpace> all, const std::array<std::uint32_t, 3>& members, std::uint32_t count,
              const Vec3& target, double tolerance, ActiveSolution& solution) HAPTIC_RT {
    std::array<Vec3, 3> n{};
    std::array<double, 3> b{};
    // Right-hand side: signed distance from the target to each plane.
    for (std::uint32_t k = 0; k < count; ++k) {
        n[k] = all[members[k]].normal;
        b[k] = all[members[k]].offset - glm::dot(n[k], target);
    }
    std::array<double, 3>& lambda = solution.lambda;
    Vec3& point = solution.point;
    // Direct solution, refined below.
    if (!multipliers(n, b, count, lambda)) {
        return false;
    }
    for (int refinement = 0;; ++refinement) {
        // KKT conditions: x = target + sum lambda_k n_k with lambda_k >= 0.
        point = target;
        for (std::uint32_t k = 0; k < count; ++k) {
            if (lambda[k] < 0.0) {
                return false;
            }
            point += n[k] * lambda[k];
        }
        // Residual of each plane equation, which becomes the next right-hand side.
        double worst = 0.0;
        for (std::uint32_t k = 0; k < count; ++k) {
            b[k] = all[members[k]].offset - glm::dot(n[k], point);
            worst = std::max(worst, std::abs(b[k]));
        }
        if (worst <= tolerance || refinement == kMaxRefinements) {
            return true;
        }
        // Refinement step: solve for the residual and add the correction.
        std::array<double, 3> correction{};
        if (!multipliers(n, b, count, correction)) {
            return true;
        }
        for (std::uint32_t k = 0; k < count; ++k) {
            lambda[k] += correction[k];
        }
    }
}

/// Finds the active subset of a basis of at most four half-spaces: the smallest whose solution satisfies the whole
/// basis.
bool solve_basis(std::span<const HalfSpace> all, const Basis& basis, const Vec3& target, double tolerance,
                 Projection& out) HAPTIC_RT {
    // Active-set candidates by increasing size, at most 14 for a basis of four.
    for (int size = 1; size <= 3; ++size) {
        for (std::uint32_t mask = 1; mask < (1u << basis.count); ++mask) {
            if (std::popcount(mask) != size) {
                continue;
            }
            // Members of this subset.
            std::array<std::uint32_t, 3> members{};
            std::uint32_t count = 0;
            for (std::uint32_t k = 0; k < basis.count; ++k) {
                if ((mask >> k & 1u) != 0) {
                    members[count++] = basis.index[k];
                }
            }
            ActiveSolution solution;
            if (!solve_on(all, members, count, target, tolerance, solution)) {
                continue;
            }
            // Primal feasibility: the solution must satisfy the rest of the basis.
            bool holds = true;
            for (std::uint32_t k = 0; k < basis.count; ++k) {
                const HalfSpace& h = all[basis.index[k]];
                holds = holds && glm::dot(h.normal, solution.point) >= h.offset - tolerance;
            }
            if (holds) {
                out.point = solution.point;
                out.active = members;
                out.multiplier = solution.lambda;
                out.active_count = static_cast<std::uint8_t>(count);
                return true;
            }
        }
    }
    return false;
}

}  // namespace

Projection project_onto(std::span<const HalfSpace> half_spaces, const Vec3& target, double tolerance) HAPTIC_RT {
    Projection result;
    result.point = target;
    for (int exchange = 0; exchange < kMaxExchanges; ++exchange) {
        // Most violated half-space at the present optimum.
        double worst = tolerance;
        std::uint32_t enters = 0;
        for (std::uint32_t k = 0; k < half_spaces.size(); ++k) {
            const double violation = half_spaces[k].offset - glm::dot(half_spaces[k].normal, result.point);
            if (violation > worst) {
                worst = violation;
                enters = k;
            }
        }
        if (worst <= tolerance) {
            return result;
        }
        // New basis: the present active set and the entering half-space.
        Basis basis;
        for (std::uint32_t k = 0; k < result.active_count; ++k) {
            basis.index[basis.count++] = result.active[k];
        }
        basis.index[basis.count++] = enters;
        // A tenth of the tolerance, so that the half-space that leaves the basis does not enter again at once.
        if (!solve_basis(half_spaces, basis, target, 0.1 * tolerance, result)) {
            break;
        }
    }
    // Infeasible, or no convergence within kMaxExchanges.
    Projection none;
    none.point = target;
    none.feasible = false;
    return none;
}

}  // namespace haptic::sim
