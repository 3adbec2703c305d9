#include "haptic/sim/contact/half_spaces.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::sim {

namespace {

constexpr double kParallel = 1e-10;  // Gram determinant below which normals count as dependent
constexpr int kMaxExchanges = 64;

/// Up to four half-spaces, of which at most three hold the point.
struct Basis {
    std::array<std::uint32_t, 4> index{};
    std::uint32_t count = 0;
};

/// The point nearest to the target on the boundaries of `members`, if it is pushed onto each of them.
bool solve_on(std::span<const HalfSpace> all, const std::array<std::uint32_t, 3>& members, std::uint32_t count,
              const Vec3& target, Vec3& point, std::array<double, 3>& lambda) HAPTIC_RT {
    std::array<Vec3, 3> n{};
    std::array<double, 3> b{};
    for (std::uint32_t k = 0; k < count; ++k) {
        n[k] = all[members[k]].normal;
        b[k] = all[members[k]].offset - glm::dot(n[k], target);
    }
    lambda = {};
    if (count == 1) {
        lambda[0] = b[0];
    } else if (count == 2) {
        const double g = glm::dot(n[0], n[1]);
        const double det = 1.0 - g * g;
        if (det < kParallel) {
            return false;
        }
        lambda[0] = (b[0] - g * b[1]) / det;
        lambda[1] = (b[1] - g * b[0]) / det;
    } else {
        // Three planes meet in a point: displacement = sum b_k (n_i x n_j) / det; multipliers from it by the same
        // duals.
        const double det = glm::dot(n[0], glm::cross(n[1], n[2]));
        if (det * det < kParallel) {
            return false;
        }
        const std::array<Vec3, 3> dual{glm::cross(n[1], n[2]) / det, glm::cross(n[2], n[0]) / det,
                                       glm::cross(n[0], n[1]) / det};
        const Vec3 shift = dual[0] * b[0] + dual[1] * b[1] + dual[2] * b[2];
        for (std::uint32_t k = 0; k < 3; ++k) {
            lambda[k] = glm::dot(dual[k], shift);
        }
    }
    point = target;
    for (std::uint32_t k = 0; k < count; ++k) {
        if (lambda[k] < 0.0) {
            return false;
        }
        point += n[k] * lambda[k];
    }
    return true;
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
            Vec3 point{0.0};
            std::array<double, 3> lambda{};
            if (!solve_on(all, members, count, target, point, lambda)) {
                continue;
            }
            bool holds = true;
            for (std::uint32_t k = 0; k < basis.count; ++k) {
                const HalfSpace& h = all[basis.index[k]];
                holds = holds && glm::dot(h.normal, point) >= h.offset - tolerance;
            }
            if (holds) {
                out.point = point;
                out.active = members;
                out.multiplier = lambda;
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
