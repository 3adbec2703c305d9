#include "rendering/local_proxy.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "random.hpp"

namespace haptic::rt {
namespace {

using Planes = std::vector<HalfSpace>;

constexpr double kRounding = 1e-12;  // m, of coordinates around 0.1 m

class RandomPlanes : public test::Random {
  public:
    using test::Random::Random;
    Planes planes(std::size_t count) {
        Planes planes(count);
        for (HalfSpace& plane : planes) {
            plane = {direction(), uniform(-0.03, 0.03)};
        }
        return planes;
    }
};

double largest_violation(const Planes& planes, const Vec3& x) {
    double largest = -std::numeric_limits<double>::infinity();
    for (const HalfSpace& plane : planes) {
        largest = std::max(largest, plane.offset - glm::dot(plane.normal, x));
    }
    return largest;
}

/// Oracle: Dykstra's alternating projections, which converge to the same point as the enumeration.
/// @source Boyle and Dykstra 1986.
Vec3 dykstra(const Vec3& target, const Planes& planes, int sweeps) {
    Vec3 x = target;
    std::vector<Vec3> corrections(planes.size(), Vec3(0.0));
    for (int sweep = 0; sweep < sweeps; ++sweep) {
        const Vec3 before = x;
        for (std::size_t k = 0; k < planes.size(); ++k) {
            const Vec3 y = x + corrections[k];
            const double depth = std::max(0.0, planes[k].offset - glm::dot(planes[k].normal, y));
            x = y + planes[k].normal * depth;
            corrections[k] = y - x;
        }
        if (sweep > 10 && glm::length(x - before) < 1e-17) {
            break;
        }
    }
    return x;
}

/// True if x is the projection: feasible, and no feasible point of a dense cloud around it is nearer to the target. For
/// a convex set a local check suffices.
void expect_nearest(const Vec3& target, const Planes& planes, const Vec3& x, RandomPlanes& random) {
    ASSERT_LE(largest_violation(planes, x), kRounding);
    const double distance = glm::length(target - x);
    for (int k = 0; k < 300; ++k) {
        const Vec3 other = x + random.direction() * std::pow(10.0, random.uniform(-7.0, -2.0));
        if (largest_violation(planes, other) <= 0.0) {
            ASSERT_GE(glm::length(target - other), distance - kRounding);
        }
    }
}

TEST(LocalProxy, WithoutPlanesItIsTheDevice) {
    const LocalProxy proxy = project({0.1, 0.2, 0.3}, {});
    EXPECT_EQ(proxy.position, Vec3(0.1, 0.2, 0.3));
    EXPECT_EQ(proxy.active, 0);
    EXPECT_TRUE(proxy.feasible);
}

TEST(LocalProxy, FreeOfAllPlanesItIsTheDevice) {
    const Planes planes = {{{0.0, 1.0, 0.0}, -0.01}, {{1.0, 0.0, 0.0}, -0.01}};
    const LocalProxy proxy = project({0.0, 0.0, 0.0}, planes);
    EXPECT_EQ(proxy.position, Vec3(0.0, 0.0, 0.0));
    EXPECT_EQ(proxy.active, 0);
}

TEST(LocalProxy, OnePlaneHoldsItAtItsSurface) {
    const Planes planes = {{{0.0, 1.0, 0.0}, 0.01}};
    const LocalProxy proxy = project({0.02, -0.03, 0.05}, planes);
    EXPECT_LT(glm::length(proxy.position - Vec3(0.02, 0.01, 0.05)), kRounding);
    EXPECT_EQ(proxy.active, 1);
    EXPECT_TRUE(proxy.feasible);
}

TEST(LocalProxy, AnEdgeAndACornerHoldItWithTwoAndThreePlanes) {
    const Planes planes = {{{1.0, 0.0, 0.0}, 0.01}, {{0.0, 1.0, 0.0}, 0.02}, {{0.0, 0.0, 1.0}, 0.03}};
    const LocalProxy edge = project({0.0, 0.0, 0.05}, planes);
    EXPECT_LT(glm::length(edge.position - Vec3(0.01, 0.02, 0.05)), kRounding);
    EXPECT_EQ(edge.active, 3);
    const LocalProxy corner = project({0.0, 0.0, 0.0}, planes);
    EXPECT_LT(glm::length(corner.position - Vec3(0.01, 0.02, 0.03)), kRounding);
    EXPECT_EQ(corner.active, 7);
}

TEST(LocalProxy, APlaneImpliedByTheOthersIsNotActive) {
    // The device violates the shallow plane, but the projection onto the steep one does not.
    const Planes planes = {{{0.0, 1.0, 0.0}, 0.02}, {glm::normalize(Vec3(0.1, 1.0, 0.0)), 0.005}};
    const LocalProxy proxy = project({0.0, 0.0, 0.0}, planes);
    EXPECT_LT(glm::length(proxy.position - Vec3(0.0, 0.02, 0.0)), kRounding);
    EXPECT_EQ(proxy.active, 1);
}

TEST(LocalProxy, AgreesWithDykstraOnRandomPlanes) {
    RandomPlanes random(31);
    int compared = 0;
    for (int k = 0; k < 3000; ++k) {
        const Planes planes = random.planes(static_cast<std::size_t>(k % 3) + 1);
        const Vec3 target = random.normal() * 0.02;
        const LocalProxy proxy = project(target, planes);
        if (!proxy.feasible) {
            continue;
        }
        // Alternating projections converge slowly for nearly parallel planes: compare only where they have converged.
        const Vec3 other = dykstra(target, planes, 3000);
        if (largest_violation(planes, other) < 1e-14) {
            ++compared;
            EXPECT_LT(glm::length(proxy.position - other), 1e-9);
        }
    }
    EXPECT_GT(compared, 2500);
}

TEST(LocalProxy, NoNearerPointIsFeasible) {
    RandomPlanes random(32);
    for (int k = 0; k < 3000; ++k) {
        const Planes planes = random.planes(static_cast<std::size_t>(k % 3) + 1);
        const Vec3 target = random.normal() * 0.02;
        const LocalProxy proxy = project(target, planes);
        if (proxy.feasible) {
            expect_nearest(target, planes, proxy.position, random);
        }
    }
}

TEST(LocalProxy, SatisfiesTheOptimalityConditions) {
    // x is feasible, and x - target = sum of weight_k normal_k over the active planes with nonnegative weights. The
    // weights come from orthogonalised normals, independently of the kernel.
    RandomPlanes random(33);
    int held_by[4] = {};
    for (int k = 0; k < 20000; ++k) {
        const Planes planes = random.planes(3);
        const Vec3 target = random.normal() * 0.02;
        const LocalProxy proxy = project(target, planes);
        if (!proxy.feasible) {
            continue;
        }
        ASSERT_LE(largest_violation(planes, proxy.position), kRounding);
        std::vector<Vec3> normals;
        std::vector<double> multipliers;
        for (std::size_t i = 0; i < planes.size(); ++i) {
            if ((proxy.active >> i & 1) != 0) {
                EXPECT_NEAR(glm::dot(planes[i].normal, proxy.position), planes[i].offset, 10 * kRounding);
                normals.push_back(planes[i].normal);
                multipliers.push_back(proxy.multiplier[i]);
            } else {
                EXPECT_EQ(proxy.multiplier[i], 0.0);
            }
        }
        ++held_by[normals.size()];
        // The component of a normal orthogonal to the others gives its weight.
        const Vec3 move = proxy.position - target;
        Vec3 rest = move;
        for (std::size_t i = 0; i < normals.size(); ++i) {
            std::vector<Vec3> basis;
            Vec3 own = normals[i];
            for (std::size_t j = 0; j < normals.size(); ++j) {
                if (j != i) {
                    Vec3 other = normals[j];
                    for (const Vec3& b : basis) {
                        other -= glm::dot(other, b) * b;
                    }
                    basis.push_back(glm::normalize(other));
                    own -= glm::dot(own, basis.back()) * basis.back();
                }
            }
            const double weight = glm::dot(own, move) / glm::dot(own, own);
            EXPECT_GE(weight, -1e-9);
            // Both lose digits with the square of the angle that is left between dependent normals.
            EXPECT_NEAR(multipliers[i], weight, 1e-9 * (1.0 + 1.0 / glm::dot(own, own)));
            rest -= weight * normals[i];
        }
        // Weights of nearly dependent normals are large against the displacement, and so is their rounding.
        EXPECT_LT(glm::length(rest), 1e-7 * (glm::length(move) + 1e-3));
    }
    for (const int count : held_by) {
        EXPECT_GT(count, 200) << "each number of active planes must occur";
    }
}

TEST(LocalProxy, OrderOfThePlanesDoesNotMatter) {
    RandomPlanes random(34);
    for (int k = 0; k < 2000; ++k) {
        Planes planes = random.planes(3);
        if (k % 4 == 0) {
            planes[1] = planes[0];  // coincident
        } else if (k % 4 == 1) {
            planes[1] = {-planes[0].normal, -planes[0].offset + random.uniform(-0.01, 0.01)};  // a slit
        } else if (k % 4 == 2) {
            planes[1] = {planes[0].normal, planes[0].offset + 0.001};  // parallel
        }
        const Vec3 target = random.normal() * 0.02;
        const LocalProxy first = project(target, planes);
        for (const auto& order : {std::array{0, 2, 1}, std::array{1, 0, 2}, std::array{1, 2, 0}, std::array{2, 0, 1},
                                  std::array{2, 1, 0}}) {
            Planes shuffled(3);
            unsigned active = 0;
            for (std::size_t i = 0; i < 3; ++i) {
                shuffled[i] = planes[static_cast<std::size_t>(order[i])];
            }
            const LocalProxy proxy = project(target, shuffled);
            for (std::size_t i = 0; i < 3; ++i) {
                active |= (proxy.active >> i & 1U) << static_cast<unsigned>(order[i]);
            }
            EXPECT_EQ(proxy.feasible, first.feasible);
            EXPECT_LT(glm::length(proxy.position - first.position), 1e-11);
            EXPECT_EQ(active, first.active);
        }
    }
}

TEST(LocalProxy, CoincidentPlanesActAsOne) {
    const HalfSpace floor{{0.0, 1.0, 0.0}, 0.01};
    const Planes planes = {floor, floor, floor};
    const LocalProxy proxy = project({0.0, -0.5, 0.0}, planes);
    EXPECT_LT(glm::length(proxy.position - Vec3(0.0, 0.01, 0.0)), kRounding);
    EXPECT_EQ(proxy.active, 7);
    EXPECT_TRUE(proxy.feasible);
}

TEST(LocalProxy, OfParallelPlanesTheHigherHolds) {
    const Planes planes = {{{0.0, 1.0, 0.0}, 0.01}, {{0.0, 1.0, 0.0}, 0.02}};
    const LocalProxy proxy = project({0.0, 0.0, 0.0}, planes);
    EXPECT_EQ(proxy.position, Vec3(0.0, 0.02, 0.0));
    EXPECT_EQ(proxy.active, 2);
}

TEST(LocalProxy, NearlyCoincidentPlanesOfOneSurfaceDoNotMakeItJump) {
    // Two triangles of one flat face: normals that differ by rounding, or slightly more.
    for (const double tilt : {1e-16, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3}) {
        const Planes planes = {{{0.0, 1.0, 0.0}, 0.01},
                               {glm::normalize(Vec3(tilt, 1.0, 0.0)), 0.01},
                               {glm::normalize(Vec3(0.0, 1.0, tilt)), 0.01 - 1e-15}};
        const LocalProxy proxy = project({0.003, -0.02, 0.001}, planes);
        EXPECT_TRUE(proxy.feasible);
        EXPECT_LT(glm::length(proxy.position - Vec3(0.003, 0.01, 0.001)), 0.1 * tilt + kRounding) << tilt;
    }
}

TEST(LocalProxy, InAFeasibleSlitItStaysBetweenThePlanes) {
    const Planes planes = {{{0.0, 1.0, 0.0}, 0.00}, {{0.0, -1.0, 0.0}, -0.01}};  // 0 <= y <= 0.01
    EXPECT_EQ(project({0.0, -0.02, 0.0}, planes).position, Vec3(0.0, 0.0, 0.0));
    EXPECT_LT(glm::length(project({0.0, 0.05, 0.0}, planes).position - Vec3(0.0, 0.01, 0.0)), kRounding);
    EXPECT_EQ(project({0.0, 0.005, 0.0}, planes).position, Vec3(0.0, 0.005, 0.0));
    EXPECT_TRUE(project({0.0, -0.02, 0.0}, planes).feasible);
}

TEST(LocalProxy, InASlitOfZeroWidthItStaysOnTheCommonPlane) {
    const Planes planes = {{{0.0, 1.0, 0.0}, 0.01}, {{0.0, -1.0, 0.0}, -0.01}};
    for (const double y : {-0.02, 0.01, 0.03}) {
        const LocalProxy proxy = project({0.004, y, 0.0}, planes);
        EXPECT_TRUE(proxy.feasible);
        EXPECT_LT(glm::length(proxy.position - Vec3(0.004, 0.01, 0.0)), kRounding);
    }
}

TEST(LocalProxy, InAnInfeasibleSlitItIsHalfWay) {
    const Planes planes = {{{0.0, 1.0, 0.0}, 0.01}, {{0.0, -1.0, 0.0}, 0.00}};  // y >= 0.01 and y <= 0
    for (const double y : {-0.03, 0.0, 0.004, 0.05}) {
        const LocalProxy proxy = project({0.02, y, -0.01}, planes);
        EXPECT_FALSE(proxy.feasible);
        EXPECT_LT(glm::length(proxy.position - Vec3(0.02, 0.005, -0.01)), kRounding);
        EXPECT_EQ(proxy.active, 3);
    }
}

TEST(LocalProxy, InAnInfeasibleSlitAThirdPlaneIsKeptToTheSameViolation) {
    const Planes planes = {{{0.0, 1.0, 0.0}, 0.01}, {{0.0, -1.0, 0.0}, 0.00}, {{1.0, 0.0, 0.0}, 0.03}};
    const LocalProxy proxy = project({0.0, 0.0, 0.0}, planes);
    EXPECT_FALSE(proxy.feasible);
    // The slit is violated by at least 5 mm, so the third plane need not be kept better than that either.
    EXPECT_LT(glm::length(proxy.position - Vec3(0.025, 0.005, 0.0)), kRounding);
}

TEST(LocalProxy, FacingPlanesThatHardlyOpenCountAsASlit) {
    // They meet at 1 cm / tilt: up to kilometres away.
    for (const double tilt : {1e-3, 1e-5, 1e-7, 1e-9, 1e-12, 1e-15}) {
        const Planes planes = {{glm::normalize(Vec3(tilt, 1.0, 0.0)), 0.01}, {{0.0, -1.0, 0.0}, 0.00}};
        const LocalProxy proxy = project({0.0, 0.0, 0.0}, planes);
        EXPECT_FALSE(proxy.feasible);
        EXPECT_LT(glm::length(proxy.position - Vec3(0.0, 0.005, 0.0)), 0.02 * tilt + kRounding);
    }
    // A groove that opens by 5 degrees is left exactly at its edge.
    const Planes groove = {{glm::normalize(Vec3(0.0874887, 1.0, 0.0)), 0.01}, {{0.0, -1.0, 0.0}, 0.00}};
    const LocalProxy proxy = project({0.0, 0.0, 0.0}, groove);
    EXPECT_TRUE(proxy.feasible);
    EXPECT_LT(largest_violation(groove, proxy.position), kRounding);
}

TEST(LocalProxy, AnInfeasiblePrismIsViolatedEquallyOnAllSides) {
    // Three planes at 120 degrees that face inward and overlap by 1 cm.
    const double half_root = std::sqrt(3.0) / 2.0;
    const Planes planes = {{{1.0, 0.0, 0.0}, 0.01}, {{-0.5, half_root, 0.0}, 0.01}, {{-0.5, -half_root, 0.0}, 0.01}};
    for (const Vec3& target : {Vec3(0.0, 0.0, 0.02), Vec3(0.03, -0.01, 0.02), Vec3(-0.002, 0.001, 0.02)}) {
        const LocalProxy proxy = project(target, planes);
        EXPECT_FALSE(proxy.feasible);
        EXPECT_LT(glm::length(proxy.position - Vec3(0.0, 0.0, 0.02)), 1e-11);
        EXPECT_EQ(proxy.active, 7);
    }
}

TEST(LocalProxy, NearlyCoplanarNormalsGiveAPointNearby) {
    // The same prism with its planes tilted so that they meet: at that corner if it is near enough, else as a prism.
    const double half_root = std::sqrt(3.0) / 2.0;
    for (const double tilt : {0.3, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-14}) {
        const Planes planes = {{glm::normalize(Vec3(1.0, 0.0, tilt)), 0.01},
                               {glm::normalize(Vec3(-0.5, half_root, tilt)), 0.01},
                               {glm::normalize(Vec3(-0.5, -half_root, tilt)), 0.01}};
        const LocalProxy proxy = project({0.001, 0.002, 0.0}, planes);
        EXPECT_LE(glm::length(proxy.position), 1.5) << tilt;
        EXPECT_EQ(proxy.feasible, tilt > 9e-3) << tilt;
        if (proxy.feasible) {
            EXPECT_LT(largest_violation(planes, proxy.position), kRounding);
        } else {
            EXPECT_LT(largest_violation(planes, proxy.position), 0.01 * 1.001 + 1e-9) << tilt;
        }
    }
}

TEST(LocalProxy, LeastViolationIsTheMinimum) {
    // Infeasible triples: a positive combination of the normals vanishes. Oracle: by duality the smallest largest
    // violation is the weighted mean of the offsets.
    RandomPlanes random(35);
    for (int k = 0; k < 2000; ++k) {
        const Vec3 a = random.direction();
        const Vec3 across = glm::normalize(glm::cross(a, random.direction()));
        const double angle = random.uniform(0.3, 2.8);
        const double back = random.uniform(angle - 3.1, -0.3);
        if (angle - back < 3.2 || angle - back > 6.0) {
            continue;  // not positively dependent
        }
        const Vec3 b = a * std::cos(angle) + across * std::sin(angle);
        const Vec3 c = a * std::cos(back) + across * std::sin(back);
        // Weights by the sine rule of the triangle that the weighted normals close.
        double weights[3] = {std::sin(angle - back), std::sin(back), -std::sin(angle)};
        const double sum = weights[0] + weights[1] + weights[2];
        for (double& weight : weights) {
            weight /= sum;
        }
        ASSERT_LT(glm::length(weights[0] * a + weights[1] * b + weights[2] * c), 1e-12);
        const Planes planes = {
            {a, random.uniform(0.0, 0.02)}, {b, random.uniform(0.0, 0.02)}, {c, random.uniform(0.0, 0.02)}};
        const double least =
            weights[0] * planes[0].offset + weights[1] * planes[1].offset + weights[2] * planes[2].offset;
        const Vec3 target = random.normal() * 0.02;
        const LocalProxy proxy = project(target, planes);
        EXPECT_FALSE(proxy.feasible);
        EXPECT_NEAR(largest_violation(planes, proxy.position), least, 1e-10);
    }
}

TEST(LocalProxy, OnlyTheFirstThreePlanesCount) {
    const Planes planes = {
        {{1.0, 0.0, 0.0}, -1.0}, {{0.0, 1.0, 0.0}, -1.0}, {{0.0, 0.0, 1.0}, -1.0}, {{0.0, 1.0, 0.0}, 1.0}};
    EXPECT_EQ(project({0.0, 0.0, 0.0}, planes).position, Vec3(0.0, 0.0, 0.0));
}

TEST(LocalProxy, IsFiniteForAnyFinitePlanes) {
    RandomPlanes random(36);
    const double sizes[] = {0.0, 1e-300, 1e-12, 1e-3, 1.0, 1e6, 1e150, 1e308};
    for (int k = 0; k < 20000; ++k) {
        Planes planes = random.planes(3);
        for (HalfSpace& plane : planes) {
            plane.offset = random.uniform(-1.0, 1.0) * sizes[static_cast<std::size_t>(random.uniform(0.0, 8.0))];
        }
        const Vec3 target = random.normal() * sizes[static_cast<std::size_t>(random.uniform(0.0, 6.0))];
        const Vec3 x = project(target, planes).position;
        ASSERT_TRUE(std::isfinite(x.x) && std::isfinite(x.y) && std::isfinite(x.z));
    }
}

TEST(LocalProxy, IgnoresInvalidPlanesAndTargets) {
    const Vec3 target(0.01, 0.02, 0.03);
    const HalfSpace floor{{0.0, 1.0, 0.0}, 0.05};
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
        for (const HalfSpace& plane : {HalfSpace{{0.0, 1.0, 0.0}, bad}, HalfSpace{{bad, 0.0, 0.0}, 0.0}}) {
            const LocalProxy proxy = project(target, Planes{floor, plane});
            EXPECT_EQ(proxy.position, target);
            EXPECT_FALSE(proxy.feasible);
            EXPECT_EQ(proxy.active, 0);
        }
        EXPECT_EQ(project({bad, 0.0, 0.0}, Planes{floor}).position, Vec3(0.0, 0.0, 0.0));
        EXPECT_FALSE(project({bad, 0.0, 0.0}, Planes{floor}).feasible);
    }
}

}  // namespace
}  // namespace haptic::rt
