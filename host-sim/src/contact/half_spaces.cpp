#include "contact/half_spaces.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::sim {

namespace {

constexpr double kParallel = 1e-24;  // Gram determinant below which normals count as dependent
constexpr double kNearly = 1e-4;     // and below which those of two planes are better solved for by sum and difference
constexpr int kMaxRefinements = 3;
constexpr int kMaxExchanges = 64;

/// Up to four half-spaces, of which at most three hold the point.
struct Basis {
    std::array<std::uint32_t, 4> index{};
    std::uint32_t count = 0;
};

/// How far along each normal to go, so that the sum of all goes by b[k] along normal k. False if they are dependent.
bool multipliers(const std::array<Vec3, 3>& n, const std::array<double, 3>& b, std::uint32_t count,
                 std::array<double, 3>& lambda) HAPTIC_RT {
    if (count == 1) {
        lambda[0] = b[0];
        return true;
    }
    if (count == 2) {
        const double g = glm::dot(n[0], n[1]);
        const double det = 1.0 - g * g;
        if (det >= kNearly) {
            lambda[0] = (b[0] - g * b[1]) / det;
            lambda[1] = (b[1] - g * b[0]) / det;
            return true;
        }
        // Unit normals: their sum and difference are square to one another, however near to parallel they are.
        const Vec3 sum = n[0] + n[1];
        const Vec3 difference = n[0] - n[1];
        const double ss = glm::dot(sum, sum);
        const double dd = glm::dot(difference, difference);
        if (ss * dd < 4.0 * kParallel) {
            return false;
        }
        const double along = (b[0] + b[1]) / ss;
        const double across = (b[0] - b[1]) / dd;
        lambda[0] = along + across;
        lambda[1] = along - across;
        return true;
    }
    // Three planes meet in a point: displacement = sum b_k (n_i x n_j) / det; multipliers from it by the same duals.
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

struct Held {
    Vec3 point{0.0};
    std::array<double, 3> lambda{};  // m, along the normal of each member
};

/// The point nearest to the target on the boundaries of `members`, if it is pushed onto each of them. Planes that are
/// nearly parallel lose digits, so what is left of the distance to them is solved for again.
bool solve_on(std::span<const HalfSpace> all, const std::array<std::uint32_t, 3>& members, std::uint32_t count,
              const Vec3& target, double tolerance, Held& held) HAPTIC_RT {
    std::array<Vec3, 3> n{};
    std::array<double, 3> b{};
    for (std::uint32_t k = 0; k < count; ++k) {
        n[k] = all[members[k]].normal;
        b[k] = all[members[k]].offset - glm::dot(n[k], target);
    }
    std::array<double, 3>& lambda = held.lambda;
    Vec3& point = held.point;
    if (!multipliers(n, b, count, lambda)) {
        return false;
    }
    for (int refinement = 0;; ++refinement) {
        point = target;
        for (std::uint32_t k = 0; k < count; ++k) {
            if (lambda[k] < 0.0) {
                return false;
            }
            point += n[k] * lambda[k];
        }
        double worst = 0.0;
        for (std::uint32_t k = 0; k < count; ++k) {
            b[k] = all[members[k]].offset - glm::dot(n[k], point);
            worst = std::max(worst, std::abs(b[k]));
        }
        if (worst <= tolerance || refinement == kMaxRefinements) {
            return true;
        }
        std::array<double, 3> more{};
        if (!multipliers(n, b, count, more)) {
            return true;
        }
        for (std::uint32_t k = 0; k < count; ++k) {
            lambda[k] += more[k];
        }
    }
}

/// Solves for a basis of at most four: the subset that holds the point and leaves none of the basis violated.
bool solve_basis(std::span<const HalfSpace> all, const Basis& basis, const Vec3& target, double tolerance,
                 Projection& out) HAPTIC_RT {
    for (int size = 1; size <= 3; ++size) {
        for (std::uint32_t mask = 1; mask < (1u << basis.count); ++mask) {
            if (std::popcount(mask) != size) {
                continue;
            }
            std::array<std::uint32_t, 3> members{};
            std::uint32_t count = 0;
            for (std::uint32_t k = 0; k < basis.count; ++k) {
                if ((mask >> k & 1u) != 0) {
                    members[count++] = basis.index[k];
                }
            }
            Held held;
            if (!solve_on(all, members, count, target, tolerance, held)) {
                continue;
            }
            bool holds = true;
            for (std::uint32_t k = 0; k < basis.count; ++k) {
                const HalfSpace& h = all[basis.index[k]];
                holds = holds && glm::dot(h.normal, held.point) >= h.offset - tolerance;
            }
            if (holds) {
                out.point = held.point;
                out.active = members;
                out.multiplier = held.lambda;
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
        Basis basis;
        for (std::uint32_t k = 0; k < result.active_count; ++k) {
            basis.index[basis.count++] = result.active[k];
        }
        basis.index[basis.count++] = enters;
        // A tenth of the tolerance, so that what leaves the basis is not the most violated one again.
        if (!solve_basis(half_spaces, basis, target, 0.1 * tolerance, result)) {
            break;
        }
    }
    Projection none;
    none.point = target;
    none.feasible = false;
    return none;
}

}  // namespace haptic::sim
