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
            EXPECT_TRUE(supports.raise(k, box.corners[k], 0.001, way));
        }
    }
    EXPECT_FALSE(supports.is_empty());
    supports.hold_up(box.group, 0.5, way);
    EXPECT_LT(glm::length(way.linear), 1e-7);
    EXPECT_LT(glm::length(way.angular), 1e-6);
    // None of them leads it back down, or up.
    supports.stop();
    Twist rising{.linear = Vec3(0.0, 0.1, 0.0)};
    supports.hold_up(box.group, 0.5, rising);
    EXPECT_EQ(rising.linear, Vec3(0.0, 0.1, 0.0));
}

TEST(FloorSupports, LetABoxTopplesAboutTheEdgeThatTouches) {
    const Box box;
    Twist way{.linear = Vec3(0.0, -0.001, 0.0)};
    FloorSupports supports;
    EXPECT_TRUE(supports.raise(0, box.corners[0], 0.001, way));
    EXPECT_TRUE(supports.raise(1, box.corners[1], 0.001, way));
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
    const auto left_of = [&](double friction) {
        // At the height of the floor, so that friction does not turn it.
        Twist speed{.linear = Vec3(0.3, -0.1, 0.0)};
        FloorSupports supports;
        EXPECT_TRUE(supports.raise(0, Vec3(0.0), 0.1, speed));
        supports.hold_up(box.group, friction, speed);
        EXPECT_NEAR(speed.linear.y, 0.0, 1e-12);
        return speed.linear.x;
    };
    EXPECT_NEAR(left_of(0.0), 0.3, 1e-12);
    EXPECT_NEAR(left_of(1.0), 0.2, 1e-12);
    EXPECT_NEAR(left_of(5.0), 0.0, 1e-12);
}

TEST(FloorSupports, AreNoMoreThanThereIsRoomFor) {
    const Box box;
    const Twist still;
    FloorSupports supports;
    std::uint32_t count = 0;
    while (count < 1000 && supports.raise(count, Vec3(0.0), 0.0, still)) {
        ++count;
    }
    EXPECT_EQ(count, 16U);
    // The same one may be raised again, but not for ever.
    int again = 0;
    while (again < 1000 && supports.raise(0, Vec3(0.0), 0.001, still)) {
        ++again;
    }
    EXPECT_GT(again, 8);
    EXPECT_LT(again, 100);
}

}  // namespace
}  // namespace haptic::sim
