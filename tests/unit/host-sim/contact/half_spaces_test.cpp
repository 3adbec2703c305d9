#include "contact/half_spaces.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/oracle.hpp"

namespace {

using haptic::HalfSpace;
using haptic::Vec3;
using haptic::sim::project_onto;
using haptic::sim::Projection;
using haptic::sim::oracle::Random;

double violation(const std::vector<HalfSpace>& h, const Vec3& x) {
    double worst = 0.0;
    for (const HalfSpace& s : h) {
        worst = std::max(worst, s.offset - glm::dot(s.normal, x));
    }
    return worst;
}

/// Dykstra's alternating projections, which converge to the nearest point of an intersection of convex sets.
Vec3 dykstra(const std::vector<HalfSpace>& h, const Vec3& target) {
    std::vector<Vec3> correction(h.size(), Vec3(0.0));
    Vec3 x = target;
    for (int n = 0; n < 20000; ++n) {
        for (std::size_t k = 0; k < h.size(); ++k) {
            const Vec3 y = x + correction[k];
            const double short_by = h[k].offset - glm::dot(h[k].normal, y);
            x = short_by > 0.0 ? y + h[k].normal * short_by : y;
            correction[k] = y - x;
        }
    }
    return x;
}

TEST(HalfSpaces, KeepATargetThatIsInsideAll) {
    const std::vector<HalfSpace> h{{{0, 1, 0}, -1.0}, {{1, 0, 0}, -1.0}};
    const Projection p = project_onto(h, {0.5, 0.5, 7.0}, 1e-12);
    EXPECT_TRUE(p.feasible);
    EXPECT_EQ(p.point, Vec3(0.5, 0.5, 7.0));
    EXPECT_EQ(p.active_count, 0);
}

TEST(HalfSpaces, ThatAreNearlyParallelHoldAPointFarBehindThem) {
    // A valley and a pit of three slopes about the y axis: by symmetry the nearest point is on the axis. Slightly bent
    // cloth looks like this to the proxy above it, with the goal many radii behind.
    constexpr double offset = 0.03;      // m
    constexpr double tolerance = 3e-11;  // m, as for a sphere of that radius
    double slope = 0.3;
    for (int k = 0; k < 27; ++k, slope *= 0.37) {  // down to 1e-12
        for (const int sides : {2, 3}) {
            std::vector<HalfSpace> h;
            for (int side = 0; side < sides; ++side) {
                const double a = 2.0 * M_PI * side / sides;
                h.push_back({glm::normalize(Vec3(slope * std::cos(a), 1.0, slope * std::sin(a))), offset});
            }
            for (const double depth : {0.001, 0.1, 3.0}) {
                const Projection p = project_onto(h, {0.0, -depth, 0.0}, tolerance);
                ASSERT_TRUE(p.feasible) << sides << " sides, slope " << slope << ", depth " << depth;
                ASSERT_LE(violation(h, p.point), tolerance) << sides << " sides, slope " << slope;
                ASSERT_NEAR(p.point.y, offset * std::sqrt(1.0 + slope * slope), 1e-10)
                    << sides << " sides, slope " << slope << ", depth " << depth;
            }
        }
    }
}

TEST(HalfSpaces, FindTheNearestPointAsAlternatingProjectionsDo) {
    Random random(6);
    int corners = 0;
    for (int k = 0; k < 150; ++k) {
        std::vector<HalfSpace> h;
        const Vec3 inside = random.in_cube(1.0);
        const int count = 1 + static_cast<int>(random.below(10));
        for (int j = 0; j < count; ++j) {
            const Vec3 n = random.direction();
            h.push_back({n, glm::dot(n, inside) - random.uniform(0.05, 0.5)});
        }
        const Vec3 target = random.in_cube(4.0);
        const Projection p = project_onto(h, target, 1e-10);
        ASSERT_TRUE(p.feasible) << k;
        ASSERT_LE(violation(h, p.point), 1e-9) << k;
        // Sharp wedges slow down the oracle, not the solver: both must agree in distance.
        ASSERT_NEAR(glm::length(p.point - target), glm::length(dykstra(h, target) - target), 1e-5) << k;
        corners += p.active_count == 3 ? 1 : 0;
    }
    EXPECT_GT(corners, 10);
}

TEST(HalfSpaces, DoNotDependOnTheirOrder) {
    Random random(7);
    for (int k = 0; k < 500; ++k) {
        std::vector<HalfSpace> h;
        h.reserve(12);
        for (int j = 0; j < 12; ++j) {
            h.push_back({random.direction(), random.uniform(-1.0, -0.1)});
        }
        const Vec3 target = random.in_cube(3.0);
        const Projection one = project_onto(h, target, 1e-11);
        for (std::size_t j = h.size() - 1; j > 0; --j) {
            std::swap(h[j], h[random.below(static_cast<std::uint32_t>(j + 1))]);
        }
        const Projection other = project_onto(h, target, 1e-11);
        ASSERT_TRUE(one.feasible && other.feasible);
        ASSERT_NEAR(glm::length(one.point - other.point), 0.0, 1e-8) << k;
    }
}

TEST(HalfSpaces, SayWhenThereIsNoPoint) {
    const std::vector<HalfSpace> slab{{{0, 1, 0}, 0.5}, {{0, -1, 0}, -0.4}};
    EXPECT_FALSE(project_onto(slab, {0, 0, 0}, 1e-12).feasible);
    // Three walls of a prism without interior.
    const double s = std::sqrt(0.75);
    const std::vector<HalfSpace> prism{{{1, 0, 0}, 0.1}, {{-0.5, s, 0}, 0.1}, {{-0.5, -s, 0}, 0.1}};
    EXPECT_FALSE(project_onto(prism, {3, 1, 0}, 1e-12).feasible);
    std::vector<HalfSpace> open = prism;
    for (HalfSpace& h : open) {
        h.offset = -0.1;
    }
    EXPECT_TRUE(project_onto(open, {3, 1, 0}, 1e-12).feasible);
}

TEST(HalfSpaces, TakeTheSamePlaneTwice) {
    const std::vector<HalfSpace> twice{{{0, 1, 0}, 1.0}, {{0, 1, 0}, 1.0}, {{0, 1, 0}, 1.0 + 1e-14}};
    const Projection p = project_onto(twice, {2, 0, 3}, 1e-12);
    ASSERT_TRUE(p.feasible);
    EXPECT_NEAR(glm::length(p.point - Vec3(2, 1, 3)), 0.0, 1e-12);
    EXPECT_EQ(p.active_count, 1);
}

}  // namespace
