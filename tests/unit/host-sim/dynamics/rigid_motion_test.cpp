// Rigid motions keep distances, and close no gap on the straight paths that lead there.
#include "dynamics/rigid_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

namespace haptic::sim {
namespace {

Vec3 random_vector(std::mt19937& random, double scale) {
    std::normal_distribution<double> number(0.0, scale);
    return {number(random), number(random), number(random)};
}

TEST(RigidMotion, NoneLeavesPointsWhereTheyAre) {
    std::mt19937 random(1);
    const RigidMotion none;
    for (int k = 0; k < 100; ++k) {
        const Vec3 p = random_vector(random, 1.0);
        EXPECT_EQ(none(p), p);
    }
    const Quat q = glm::normalize(Quat(0.3, 0.1, -0.7, 0.2));
    EXPECT_EQ(none(q), q);
    const Vec3 way(0.1, 0.2, 0.3);
    EXPECT_EQ(RigidMotion::by(way)(Vec3(0.5)), Vec3(0.5) + way);
}

TEST(RigidMotion, TurnsAboutItsCentreAndThenGoes) {
    // The Cayley map of 2 tan(45 degrees / 2) about z turns by 45 degrees.
    const RigidMotion motion(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 0.0, 2.0 * (std::sqrt(2.0) - 1.0)), Vec3(0.0, 0.0, 0.5));
    EXPECT_LT(glm::length(motion(Vec3(1.0, 0.0, 0.0)) - Vec3(1.0, 0.0, 0.5)), 1e-15);
    EXPECT_LT(glm::length(motion(Vec3(2.0, 0.0, 0.0)) - Vec3(1.0 + std::sqrt(0.5), std::sqrt(0.5), 0.5)), 1e-15);
    EXPECT_LT(
        glm::length(motion(Quat(1.0, 0.0, 0.0, 0.0)) * Vec3(1.0, 0.0, 0.0) - Vec3(std::sqrt(0.5), std::sqrt(0.5), 0.0)),
        1e-15);
    EXPECT_EQ(motion.way(), Vec3(0.0, 0.0, 0.5));
}

TEST(RigidMotion, ClosesNoGapOnStraightPaths) {
    std::mt19937 random(2);
    for (int k = 0; k < 1000; ++k) {
        const Vec3 rotation = 0.25 * glm::normalize(random_vector(random, 1.0));
        const RigidMotion motion(random_vector(random, 1.0), rotation, random_vector(random, 1.0));
        const Vec3 p = random_vector(random, 0.1);
        const Vec3 q = p + random_vector(random, 1e-5);
        const Vec3 apart = q - p;
        const Vec3 apart_then = motion(q) - motion(p);
        EXPECT_NEAR(glm::length(apart_then), glm::length(apart), 1e-14);
        // The least is that of half the way, where it is cos(turn / 2) across the axis.
        const double across = glm::length(glm::cross(rotation, apart)) / 0.25;
        const double half_turn = std::atan(0.125);
        const double along_squared = glm::dot(apart, apart) - across * across;
        const double least = std::sqrt(along_squared + across * across * std::cos(half_turn) * std::cos(half_turn));
        EXPECT_NEAR(glm::length(0.5 * (apart + apart_then)), least, 1e-14);
    }
}

}  // namespace
}  // namespace haptic::sim
