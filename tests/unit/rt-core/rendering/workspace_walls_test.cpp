#include "rendering/workspace_walls.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

namespace haptic::rt {
namespace {

WorkspaceWalls walls() {
    WorkspaceWalls result;
    result.on = true;
    result.semi_axes = Vec3(0.010, 0.015, 0.012);
    result.thickness = 0.003;
    result.force = 1.2;
    result.angle = 0.2;
    result.angular_thickness = 0.05;
    result.torque = 0.004;
    return result;
}

/// Random poses in and around the region.
class WorkspaceWallsTest : public testing::Test {
  protected:
    Vec3 direction() { return glm::normalize(Vec3{normal_(random_), normal_(random_), normal_(random_)}); }
    Pose pose(double reach, double angle) {
        const Vec3 position = reach * (walls().semi_axes * direction());
        return {position, glm::angleAxis(angle, direction())};
    }

    std::mt19937 random_{1};  // NOLINT(bugprone-random-generator-seed): the same poses each time
    std::normal_distribution<double> normal_;
};

TEST_F(WorkspaceWallsTest, AreExactlyZeroInsideAndWhereThereAreNone) {
    for (int k = 0; k < 1000; ++k) {
        const Pose inside = pose(0.999, 0.199);
        const Twist fast{10.0 * direction(), 10.0 * direction()};
        const WallPush push = push_of_walls(walls(), inside, fast);
        ASSERT_EQ(push.wrench.force, Vec3(0.0));
        ASSERT_EQ(push.wrench.torque, Vec3(0.0));
        ASSERT_EQ(push.stored, 0.0);
        ASSERT_FALSE(push.pushes);
        ASSERT_FALSE(push_of_walls({}, pose(5.0, 1.0), fast).pushes);
    }
}

TEST_F(WorkspaceWallsTest, PushWithTheGradientOfTheirEnergy) {
    // Central differences of the energy along a random motion, of 1 um and 1e-5 rad: errors of 1e-6 relative.
    constexpr double step = 1e-6;
    for (int k = 0; k < 1000; ++k) {
        const Pose at = pose(1.0 + 0.002 * k, 0.15 + 0.0003 * k);
        const Vec3 way = direction();
        const Vec3 turn = 10.0 * direction();
        const auto moved = [&](double s) {
            return Pose{at.position + s * way,
                        glm::normalize(glm::angleAxis(s * glm::length(turn), glm::normalize(turn)) * at.orientation)};
        };
        const WallPush push = push_of_walls(walls(), at, {});
        const double slope =
            (push_of_walls(walls(), moved(step), {}).stored - push_of_walls(walls(), moved(-step), {}).stored) /
            (2.0 * step);
        ASSERT_NEAR(slope, -glm::dot(push.wrench.force, way) - glm::dot(push.wrench.torque, turn), 2e-3);
    }
}

TEST_F(WorkspaceWallsTest, NeverExceedTheirForcesAndOnlyBrakeByDamping) {
    for (int k = 0; k < 2000; ++k) {
        const Pose at = pose(0.5 + 0.002 * k, 0.001 * k);
        const Twist velocity{0.3 * normal_(random_) * direction(), 20.0 * normal_(random_) * direction()};
        const Wrench spring = push_of_walls(walls(), at, {}).wrench;
        const Wrench all = push_of_walls(walls(), at, velocity).wrench;
        ASSERT_LE(glm::length(spring.force), walls().force * (1.0 + 1e-12));
        ASSERT_LE(glm::length(spring.torque), walls().torque * (1.0 + 1e-12));
        ASSERT_LE(glm::length(all.force), 2.0 * walls().force * (1.0 + 1e-12));
        ASSERT_LE(glm::length(all.torque), 2.0 * walls().torque * (1.0 + 1e-12));
        // What the damping adds takes energy from any motion.
        ASSERT_LE(glm::dot(all.force - spring.force, velocity.linear), 1e-15);
        ASSERT_LE(glm::dot(all.torque - spring.torque, velocity.angular), 1e-15);
    }
}

TEST_F(WorkspaceWallsTest, PushInwards) {
    const Pose right{Vec3(0.014, 0.0, 0.0), Quat(1.0, 0.0, 0.0, 0.0)};
    EXPECT_DOUBLE_EQ(push_of_walls(walls(), right, {}).wrench.force.x, -1.2);
    const Pose turned{Vec3(0.0), glm::angleAxis(-0.3, Vec3(0.0, 1.0, 0.0))};
    EXPECT_NEAR(push_of_walls(walls(), turned, {}).wrench.torque.y, 0.004, 1e-15);
    // The same orientation, written with the other sign.
    const Pose other{Vec3(0.0), -turned.orientation};
    EXPECT_NEAR(push_of_walls(walls(), other, {}).wrench.torque.y, 0.004, 1e-15);
}

TEST_F(WorkspaceWallsTest, AreFiniteForAnyPose) {
    for (const double value : {0.0, 1e300, -1e300, HUGE_VAL, std::nan("")}) {
        const WallPush push = push_of_walls(walls(), {Vec3(value, 0.0, value), Quat(value, 1.0, value, 0.0)}, {});
        ASSERT_TRUE(std::isfinite(glm::dot(push.wrench.force, Vec3(1.0)) + glm::dot(push.wrench.torque, Vec3(1.0))));
    }
}

TEST(YieldingToWalls, LeavesWhatIsNotAgainstThem) {
    const WallPush push = {.wrench = {{-0.6, 0.0, 0.0}, {0.0, 0.002, 0.0}}, .stored = 0.0, .pushes = true};
    const Wrench along = {{-0.3, 1.0, 2.0}, {0.01, 0.003, -0.02}};
    const Wrench left = yielding(along, push, walls());
    EXPECT_EQ(left.force, along.force);
    EXPECT_EQ(left.torque, along.torque);
    const Wrench against = {{5.0, 1.0, 0.0}, {0.0, -0.1, 0.0}};
    EXPECT_EQ(yielding(against, WallPush{}, walls()).force, against.force) << "inside the region";
}

TEST(YieldingToWalls, TakesThePartAgainstThemAsTheyPush) {
    const Wrench against = {{5.0, 1.0, 0.0}, {0.0, -0.1, 0.03}};
    for (const double share : {0.0, 0.25, 0.5, 1.0, 1.7}) {
        const WallPush push = {.wrench = {{-1.2 * share, 0.0, 0.0}, {0.0, 0.004 * share, 0.0}}, .pushes = true};
        const Wrench left = yielding(against, push, walls());
        const double rest = std::max(0.0, 1.0 - share);
        EXPECT_NEAR(glm::length(left.force - Vec3(5.0 * rest, 1.0, 0.0)), 0.0, 1e-12) << share;
        EXPECT_NEAR(glm::length(left.torque - Vec3(0.0, -0.1 * rest, 0.03)), 0.0, 1e-12) << share;
    }
}

}  // namespace
}  // namespace haptic::rt
