// Claims about sheets at 14 m/s, at every attitude and phase relative to the steps: caught, clear, on the right side;
// between hammer and anvil; two close together.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"
#include "haptic/numeric.hpp"

namespace {

using haptic::is_finite;
using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::kTravel;
using haptic::sim::scenes::kUpright;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::rotation;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::Step;
using haptic::sim::scenes::World;

constexpr int kPhases = 140;  // a millimetre apart: all of a step

class FlyingSheet : public testing::Test {
  protected:
    /// Places the sheet for a step: its centre moves from `from` by `travel`.
    static void fly(Body& body, const Mat3& attitude, const Vec3& from, const Vec3& travel) {
        body.start = placed(body.mesh.vertices, attitude, from);
        body.end = placed(body.mesh.vertices, attitude, from + travel);
    }
    World world;
};

TEST_F(FlyingSheet, TiltedBy30DegreesIsCaughtInEachOf140PhasesAndNeverChangesSide) {
    Body& cloth = world.add(sheet(1.0, 16, true));
    const Vec3 travel(0.0, -kTravel, 0.0);
    double nearest = HUGE_VAL;
    for (int phase = 0; phase < kPhases; ++phase) {
        // A different horizontal axis in each phase.
        const Vec3 axis(std::cos(0.7 * phase), 0.0, std::sin(0.7 * phase));
        const Mat3 attitude = rotation(axis, M_PI / 6.0);
        const Vec3 normal = attitude[1];
        Vec3 middle(0.004, (kRadius + 0.001 * (phase + 0.5)) / normal.y, 0.007);
        Vec3 proxy(0.0);
        int held = 0;
        for (int k = 0; k < 4; ++k, middle += travel) {
            fly(cloth, attitude, middle, travel);
            world.refit();
            const Step s = step(world, proxy, Vec3(0.0), kRadius);
            proxy = s.moved.position;
            ASSERT_TRUE(s.crossings.empty()) << "phase " << phase << " step " << k;
            ASSERT_FALSE(s.secure.overconstrained || s.popped.overconstrained) << "phase " << phase << " step " << k;
            // The proxy is near the sheet's centre, so its height above the plane tells the side.
            ASSERT_LT(glm::length(proxy - middle - travel), 0.45) << "phase " << phase << " step " << k;
            ASSERT_LE(glm::dot(normal, proxy - middle - travel), -0.999 * kRadius)
                << "phase " << phase << " step " << k;
            nearest = std::min(nearest, world.clearance(proxy) / kRadius);
            held += s.moved.contacts.count > 0 ? 1 : 0;
        }
        ASSERT_GE(held, 3) << "phase " << phase;
    }
    EXPECT_GE(nearest, 0.999) << "of the radius";
    RecordProperty("least_clearance_of_radius", std::to_string(nearest));
}

TEST_F(FlyingSheet, EdgeOnIsMetByItsRimAtEveryOffsetAndInEveryPhase) {
    Body& cloth = world.add(sheet(0.5, 12, true));
    double nearest = HUGE_VAL;
    for (int tenth = 0; tenth < 10; ++tenth) {
        const double offset = 0.1 * tenth * kRadius;
        for (int phase = tenth % 5; phase < kPhases; phase += 5) {
            Vec3 middle(-0.25 - kRadius - 0.001 * (phase + 0.5), offset, 0.011);
            Vec3 proxy(0.0);
            bool touched = false;
            for (int k = 0; k < 3; ++k, middle.x += kTravel) {
                fly(cloth, kUpright, middle, {kTravel, 0.0, 0.0});
                world.refit();
                const Step s = step(world, proxy, Vec3(0.0), kRadius);
                proxy = s.moved.position;
                touched = touched || s.secure.touched;
                ASSERT_TRUE(s.crossings.empty()) << "offset " << offset << " phase " << phase << " step " << k;
                ASSERT_TRUE(s.standing.empty()) << "offset " << offset << " phase " << phase << " step " << k;
                nearest = std::min(nearest, world.clearance(proxy) / kRadius);
            }
            ASSERT_TRUE(touched) << "offset " << offset << " phase " << phase;
        }
    }
    EXPECT_GE(nearest, 0.999) << "of the radius";
    RecordProperty("least_clearance_of_radius", std::to_string(nearest));
}

TEST_F(FlyingSheet, AsAHammerNeverDrivesTheSphereThroughTheAnvil) {
    constexpr double floor_y = -0.05;  // m
    Body& floor = world.add(sheet(2.0, 4, false));
    Body& cloth = world.add(sheet(1.0, 16, true));
    floor.start = floor.end = placed(floor.mesh.vertices, kUpright, {0, floor_y, 0});
    int overconstrained = 0;
    int stood = 0;
    for (int phase = 0; phase < kPhases; ++phase) {
        const double height = kRadius + 0.001 * (phase + 0.5);
        const double gap = height - kTravel - floor_y;  // m, left by the step between cloth and floor
        fly(cloth, kUpright, {0.01, height, 0.003}, {0.0, -kTravel, 0.0});
        world.refit();
        Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        ASSERT_TRUE(is_finite(s.moved.position)) << phase;
        ASSERT_TRUE(s.secure.touched) << phase;
        ASSERT_GT(s.moved.position.y, floor_y) << phase;
        ASSERT_EQ(s.secure.overconstrained, gap < 2.0 * kRadius * 0.999) << "phase " << phase << " gap " << gap;
        overconstrained += s.secure.overconstrained ? 1 : 0;
        ASSERT_TRUE(s.crossings.empty()) << phase;
        stood += s.standing.empty() ? 0 : 1;
        if (gap < 0.0) {
            ASSERT_EQ(s.standing, std::vector<std::uint32_t>{1}) << phase << ": the hammer, not the anvil";
            ASSERT_EQ(cloth.end, cloth.start) << phase;
            ASSERT_NEAR(s.popped.position.y, 0.0, 1e-12) << phase << ": between them, where it was";
        } else if (gap > 0.1 * kRadius) {
            ASSERT_TRUE(s.standing.empty()) << phase;
            ASSERT_LT(s.moved.position.y, floor_y + gap) << phase;
            ASSERT_GE(world.clearance(s.moved.position), 0.9 * std::min(kRadius, 0.5 * gap)) << phase;
        }
        // Then the hammer rests and the hand pulls down: the anvil holds.
        for (int k = 0; k < 3; ++k) {
            cloth.stay();
            world.refit();
            s = step(world, s.moved.position, Vec3(0.0, -0.2, 0.0), kRadius);
            ASSERT_TRUE(s.crossings.empty()) << phase;
            ASSERT_GT(s.moved.position.y, floor_y) << phase;
        }
    }
    RecordProperty("squeezed", overconstrained);
    RecordProperty("stood", stood);
    EXPECT_EQ(overconstrained, 120) << "the phases that leave less than the sphere needs";
}

TEST_F(FlyingSheet, FollowedByAnotherATenthOfAStepBehindLeavesTheSphereAheadOfBothInEachOf1000Runs) {
    Random random(41);
    Body& first = world.add(sheet(0.5, 8, true));
    Body& second = world.add(sheet(0.5, 8, true));
    int failures = 0;
    for (int k = 0; k < 1000; ++k) {
        const Vec3 axis = random.direction();
        const Mat3 attitude = rotation(axis, random.uniform(0.0, 3.0));
        const Vec3 normal = attitude[1];
        const double height = random.uniform(kRadius + 1e-4, 0.1);
        const double aside_x = random.uniform(-0.1, 0.1);
        const Vec3 side = attitude * Vec3(aside_x, 0.0, random.uniform(-0.1, 0.1));
        const Vec3 travel = normal * -kTravel + attitude * Vec3(random.uniform(-0.05, 0.05), 0, 0);
        fly(first, attitude, side + normal * height, travel);
        fly(second, attitude, side + normal * (height + 0.01), travel);
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        ASSERT_TRUE(s.crossings.empty()) << k;
        const double ahead = -glm::dot(normal, s.moved.position - first.end[0]);
        failures += s.secure.touched && !s.secure.overconstrained && ahead >= 0.999 * kRadius ? 0 : 1;
    }
    EXPECT_EQ(failures, 0) << "of 1,000: between them or behind";
    RecordProperty("failures_of_1000", failures);
}

TEST_F(FlyingSheet, MetByAnotherLeavesTheSphereBetweenThemInEachOf1000Runs) {
    Random random(42);
    constexpr double left_open = 0.01;  // m, between them at the end
    Body& upper = world.add(sheet(0.5, 8, true));
    Body& lower = world.add(sheet(0.5, 8, true));
    int failures = 0;
    for (int k = 0; k < 1000; ++k) {
        const Vec3 axis = random.direction();
        const Mat3 attitude = rotation(axis, random.uniform(0.0, 3.0));
        const Vec3 normal = attitude[1];
        const double high = random.uniform(kRadius + 1e-4, 0.1);
        const double low = random.uniform(kRadius + 1e-4, 0.1);
        const double meet = random.uniform(-low, high - left_open);  // of the lower one, at the end
        const double aside_x = random.uniform(-0.1, 0.1);
        const Vec3 side = attitude * Vec3(aside_x, 0.0, random.uniform(-0.1, 0.1));
        fly(upper, attitude, side + normal * high, normal * (meet + left_open - high));
        fly(lower, attitude, side - normal * low, normal * (meet + low));
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        const double above = glm::dot(normal, s.moved.position - lower.end[0]);
        const bool fine =
            s.crossings.empty() && s.secure.overconstrained && s.standing.empty() && above > 0.0 && above < left_open;
        failures += fine ? 0 : 1;
    }
    EXPECT_EQ(failures, 0) << "of 1,000: behind one of them, or not flagged";
    RecordProperty("failures_of_1000", failures);
}

TEST_F(FlyingSheet, ThatPartsFromAnotherTakesTheSphereAlongOnItsSide) {
    // Two sheets 10 mm apart on the same side separate: one comes down onto the sphere, one goes up.
    Random random(43);
    Body& near = world.add(sheet(0.5, 8, true));
    Body& far = world.add(sheet(0.5, 8, true));
    for (int k = 0; k < 200; ++k) {
        const Vec3 axis = random.direction();
        const Mat3 attitude = rotation(axis, random.uniform(0.0, 3.0));
        const Vec3 normal = attitude[1];
        const double height = random.uniform(kRadius + 1e-4, 0.1);
        fly(near, attitude, normal * (height + (k % 2 == 0 ? 0.0 : 0.01)), normal * -kTravel);
        fly(far, attitude, normal * (height + (k % 2 == 0 ? 0.01 : 0.0)), normal * kTravel);
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        ASSERT_TRUE(s.crossings.empty()) << k;
        ASSERT_TRUE(s.secure.touched) << k;
        ASSERT_FALSE(s.secure.overconstrained) << k;
        ASSERT_LE(glm::dot(normal, s.moved.position - near.end[0]), -0.999 * kRadius) << k;
    }
}

}  // namespace
