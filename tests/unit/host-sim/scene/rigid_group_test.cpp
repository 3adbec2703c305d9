// A rigid body on a floor: it is held up where it touches, turns where that is not below its centre, and slides as far
// as friction lets it.
#include "scene/rigid_group.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <glm/geometric.hpp>
#include <vector>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

/// A box of 1 kg, 0.2 x 0.1 x 0.2 m, of eight particles at its corners.
struct Box {
    Box() {
        for (const double x : {-0.1, 0.1}) {
            for (const double y : {-0.05, 0.05}) {
                for (const double z : {-0.1, 0.1}) {
                    corners.emplace_back(x, y, z);
                    add_outer(group.scatter, 0.125, corners.back(), corners.back());
                }
            }
        }
        group.mass = 1.0;
    }
    RigidGroup group;
    std::vector<Vec3> corners;
};

TEST(FloorSupports, HoldUpABoxThatFallsFlat) {
    const Box box;
    Twist way{.linear = Vec3(0.0, -0.001, 0.0)};
    FloorSupports supports;
    for (std::uint32_t k = 0; k < 8; ++k) {
        if (box.corners[k].y < 0.0) {
            EXPECT_TRUE(supports.raise(k, box.corners[k], Vec3(0.0), 0.001, way));
        }
    }
    EXPECT_FALSE(supports.is_empty());
    supports.hold_up(box.group, 0.5, way);
    EXPECT_LT(glm::length(way.linear), 1e-7);
    EXPECT_LT(glm::length(way.angular), 1e-6);
    // None of them leads it back down, or up.
    supports.stop(RigidMotion(), Vec3(0.0));
    Twist rising{.linear = Vec3(0.0, 0.1, 0.0)};
    supports.hold_up(box.group, 0.5, rising);
    EXPECT_EQ(rising.linear, Vec3(0.0, 0.1, 0.0));
}

TEST(FloorSupports, LetABoxToppleAboutTheEdgeThatTouches) {
    const Box box;
    Twist way{.linear = Vec3(0.0, -0.001, 0.0)};
    FloorSupports supports;
    EXPECT_TRUE(supports.raise(0, box.corners[0], Vec3(0.0), 0.001, way));
    EXPECT_TRUE(supports.raise(1, box.corners[1], Vec3(0.0), 0.001, way));
    supports.hold_up(box.group, 1.0, way);
    // The corners at low x stay, and the centre sinks toward high x.
    EXPECT_NEAR(way.at(box.corners[0]).y, 0.0, 1e-6);
    EXPECT_NEAR(way.at(box.corners[1]).y, 0.0, 1e-6);
    EXPECT_LT(way.linear.y, 0.0);
    EXPECT_LT(way.angular.z, 0.0);
    EXPECT_LT(way.at(box.corners[4]).y, way.linear.y);
}

TEST(FloorSupports, SlideByWhatFrictionDoesNotHold) {
    const Box box;
    const auto left_of = [&](double friction, const Vec3& direction) {
        // At the height of the centre, so that friction does not turn it.
        Twist speed{.linear = 0.3 * direction - Vec3(0.0, 0.1, 0.0)};
        FloorSupports supports;
        EXPECT_TRUE(supports.raise(0, Vec3(0.0), Vec3(0.0), 0.1, speed));
        supports.hold_up(box.group, friction, speed);
        EXPECT_NEAR(speed.linear.y, 0.0, 1e-12);
        EXPECT_LT(glm::length(glm::cross(speed.linear, direction)), 1e-12);
        return glm::length(speed.linear);
    };
    for (const Vec3& direction : {Vec3(1.0, 0.0, 0.0), Vec3(0.0, 0.0, -1.0), Vec3(0.6, 0.0, 0.8)}) {
        EXPECT_NEAR(left_of(0.0, direction), 0.3, 1e-12);
        EXPECT_NEAR(left_of(1.0, direction), 0.2, 1e-12);
        EXPECT_NEAR(left_of(5.0, direction), 0.0, 1e-12);
    }
}

TEST(FloorSupports, TurnWhatSlidesOnThem) {
    const Box box;
    Twist speed{.linear = Vec3(0.3, -0.1, 0.0)};
    FloorSupports supports;
    EXPECT_TRUE(supports.raise(0, Vec3(0.0, -0.05, 0.0), Vec3(0.0), 0.1, speed));
    supports.hold_up(box.group, 0.1, speed);
    EXPECT_NEAR(speed.linear.x, 0.29, 1e-6);
    EXPECT_LT(speed.angular.z, 0.0) << "forward";
}

TEST(FloorSupports, HoldWhereTheirPointsHaveGone) {
    const Box box;
    Twist way{.linear = Vec3(0.0, -0.001, 0.0)};
    FloorSupports supports;
    EXPECT_TRUE(supports.raise(0, Vec3(0.1, 0.0, 0.0), Vec3(0.0), 0.001, way));
    supports.hold_up(box.group, 0.0, way);
    // A quarter turn about y leads the point to -z, and its centre to x = 1.
    const RigidMotion motion(Vec3(0.0), Vec3(0.0, 2.0, 0.0), Vec3(1.0, 0.0, 0.0));
    supports.stop(motion, Vec3(1.0, 0.0, 0.0));
    Twist speed{.linear = Vec3(0.0, -0.1, 0.0)};
    supports.hold_up(box.group, 0.0, speed);
    EXPECT_NEAR(speed.at(Vec3(0.0, 0.0, -0.1)).y, 0.0, 1e-9);
    EXPECT_LT(speed.linear.y, 0.0);
}

TEST(FloorSupports, HoldARowOfParticlesBesideItsLine) {
    RigidGroup row{.mass = 1.0};
    for (const double x : {-0.1, 0.1}) {
        add_outer(row.scatter, 0.5, Vec3(x, 0.0, 0.0), Vec3(x, 0.0, 0.0));
    }
    Twist way{.linear = Vec3(0.0, -0.001, 0.0)};
    FloorSupports supports;
    std::uint32_t name = 0;
    for (const double x : {-0.1, 0.1}) {
        for (const double z : {-0.01, 0.01}) {
            EXPECT_TRUE(supports.raise(name++, Vec3(x, -0.01, z), Vec3(0.0), 0.001, way));
        }
    }
    supports.hold_up(row, 0.5, way);
    EXPECT_LT(glm::length(way.linear), 1e-6);
    EXPECT_LT(glm::length(way.angular), 1e-4);
}

TEST(FloorSupports, AreNoMoreThanThereIsRoomFor) {
    const Twist still;
    FloorSupports supports;
    std::uint32_t count = 0;
    while (count < 1000 && supports.raise(count, Vec3(0.0), Vec3(0.0), 0.0, still)) {
        ++count;
    }
    EXPECT_EQ(count, 16U);
    // The same one may be raised again, but not for ever.
    int again = 0;
    while (again < 1000 && supports.raise(0, Vec3(0.0), Vec3(0.0), 0.001, still)) {
        ++again;
    }
    EXPECT_GT(again, 8);
    EXPECT_LT(again, 100);
}

}  // namespace
}  // namespace haptic::sim
