#include "rendering/independent_proxies.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>
#include <span>

#include "haptic/contact_problem.hpp"
#include "random.hpp"

namespace haptic::rt {
namespace {

using test::Random;

/// Planes and depths of kMaxProxies proxies, each with up to three planes.
struct Problem {
    std::array<ProxyPlanes, kMaxPlanes> planes;
    std::array<ProxyValues, kMaxPlanes> depth{};
    std::array<std::size_t, kMaxProxies> count{};
    std::size_t most = 0;
};

/// Directions of planes: any, almost the same, or the same and opposite ones.
Vec3 next_normal(Random& random, const Vec3& first, int kind) {
    const Vec3 other = random.direction();
    if (kind % 3 == 0) {
        return other;
    }
    return kind % 3 == 1 ? glm::normalize(first + 1e-3 * other) : (random.uniform(0.0, 1.0) < 0.5 ? 1.0 : -1.0) * first;
}

Problem random_problem(Random& random, std::size_t most) {
    Problem problem;
    problem.most = most;
    for (std::size_t i = 0; i < kMaxProxies; ++i) {
        problem.count[i] = i % (most + 1);
        const Vec3 first = random.direction();
        for (std::size_t k = 0; k < most; ++k) {
            const bool exists = k < problem.count[i];
            const Vec3 n = k == 0 ? first : next_normal(random, first, static_cast<int>(i));
            problem.planes[k].normal.set(i, exists ? n : Vec3(0.0));
            problem.depth[k][i] = exists ? random.uniform(-0.002, 0.004) : ProxyPlanes::kNone;
        }
    }
    return problem;
}

TEST(IndependentProxies, EqualTheGeneralSolverForEachProxy) {
    Random random(1);
    constexpr double kCompliance = 64.0;
    for (int trial = 0; trial < 300; ++trial) {
        const Problem problem = random_problem(random, 1 + static_cast<std::size_t>(trial) % kMaxPlanes);
        IndependentProxies proxies;
        proxies.load(problem.planes, problem.most, kMaxProxies, kCompliance);
        std::array<ProxyValues, kMaxPlanes> force{};
        proxies.solve(problem.depth, force);
        for (std::size_t i = 0; i < kMaxProxies; ++i) {
            ComplianceMatrix compliance;
            compliance.resize(problem.count[i]);
            std::array<double, kMaxPlanes> depth{};
            for (std::size_t r = 0; r < problem.count[i]; ++r) {
                depth[r] = problem.depth[r][i];
                compliance.set(r, r, kCompliance);
                for (std::size_t s = 0; s < r; ++s) {
                    const double cosine = glm::dot(problem.planes[r].normal.at(i), problem.planes[s].normal.at(i));
                    compliance.set(r, s, (1.0 - kSurfaceShare) * kCompliance * cosine);
                }
            }
            static ContactSolver solver;
            solver.restart();
            (void)solver.solve(compliance, std::span<const double>(depth).first(problem.count[i]));
            for (std::size_t k = 0; k < kMaxPlanes; ++k) {
                // The surface's share of a thousandth amplifies rounding at most as often.
                const double expected = k < problem.count[i] ? solver.force()[k] : 0.0;
                ASSERT_NEAR(force[k][i] * kCompliance, expected * kCompliance, 1e-11) << trial << ' ' << i << ' ' << k;
            }
        }
    }
}

TEST(IndependentProxies, PushFromNoPlaneThatIsNotReached) {
    Random random(2);
    for (int trial = 0; trial < 100; ++trial) {
        Problem problem = random_problem(random, kMaxPlanes);
        for (ProxyValues& depth : problem.depth) {
            for (double& b : depth) {
                b = std::min(b, 0.0);
            }
        }
        IndependentProxies proxies;
        proxies.load(problem.planes, problem.most, kMaxProxies, 64.0);
        std::array<ProxyValues, kMaxPlanes> force{};
        proxies.solve(problem.depth, force);
        for (const ProxyValues& forces : force) {
            EXPECT_EQ(*std::max_element(forces.begin(), forces.end()), 0.0);
        }
    }
}

TEST(IndependentProxies, ContinueFromOneSetOfPlanesToTheNext) {
    // Depths along lines: a force changes by no more than its compliance times the change of the depths.
    Random random(3);
    const Problem from = random_problem(random, kMaxPlanes);
    const Problem to = random_problem(random, kMaxPlanes);
    IndependentProxies proxies;
    proxies.load(from.planes, kMaxPlanes, kMaxProxies, 1.0);
    std::array<ProxyValues, kMaxPlanes> last{};
    constexpr int kSteps = 20'000;
    for (int step = 0; step <= kSteps; ++step) {
        std::array<ProxyValues, kMaxPlanes> depth{};
        for (std::size_t k = 0; k < kMaxPlanes; ++k) {
            for (std::size_t i = 0; i < kMaxProxies; ++i) {
                const double change = k < from.count[i] ? to.depth[k][i] - from.depth[k][i] : 0.0;
                const bool moves = std::fabs(change) < 1.0;
                depth[k][i] = from.depth[k][i] + (moves ? change * step / kSteps : 0.0);
            }
        }
        std::array<ProxyValues, kMaxPlanes> force{};
        proxies.solve(depth, force);
        for (std::size_t k = 0; k < kMaxPlanes && step > 0; ++k) {
            for (std::size_t i = 0; i < kMaxProxies; ++i) {
                // 0.006 m in all; the smallest eigenvalue of A is a thousandth.
                ASSERT_LE(std::fabs(force[k][i] - last[k][i]), 2.0 * 0.006 / kSteps / kSurfaceShare)
                    << step << ' ' << i;
            }
        }
        last = force;
    }
}

TEST(IndependentProxies, LeaveTheOthersAloneWhereADepthIsNotFinite) {
    Random random(4);
    Problem problem = random_problem(random, kMaxPlanes);
    IndependentProxies proxies;
    proxies.load(problem.planes, kMaxPlanes, kMaxProxies, 64.0);
    std::array<ProxyValues, kMaxPlanes> force{};
    proxies.solve(problem.depth, force);
    problem.depth[0][7] = std::numeric_limits<double>::quiet_NaN();
    problem.depth[1][7] = std::numeric_limits<double>::infinity();
    std::array<ProxyValues, kMaxPlanes> beside{};
    proxies.solve(problem.depth, beside);
    for (std::size_t k = 0; k < kMaxPlanes; ++k) {
        for (std::size_t i = 0; i < kMaxProxies; ++i) {
            if (i != 7) {
                EXPECT_EQ(force[k][i], beside[k][i]);
            }
        }
    }
}

}  // namespace
}  // namespace haptic::rt
