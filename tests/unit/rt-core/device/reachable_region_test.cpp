#include "device/reachable_region.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wrench_closure.hpp"

namespace haptic::rt {
namespace {

/// Random directions.
class Directions {
  public:
    Vec3 next() { return glm::normalize(Vec3{normal_(random_), normal_(random_), normal_(random_)}); }
    double uniform() { return uniform_(random_); }
    std::mt19937& random() { return random_; }
    double normal() { return normal_(random_); }

  private:
    std::mt19937 random_{7};  // NOLINT(bugprone-random-generator-seed): the same poses each time
    std::normal_distribution<double> normal_;
    std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

class ReachableRegionOf : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Geometries, ReachableRegionOf,
                         testing::Values("SpidarG6X3R", "SpidarG6X3L", "SpidarG6X4", "SpidarG6X5R"),
                         [](const auto& param) { return std::string(param.param); });

TEST_P(ReachableRegionOf, IsWrenchClosedWithStringsThatAreLongEnoughEverywhere) {
    // Judged by linear programmes, which share nothing with the region's own criterion.
    const device::DeviceGeometry geometry = device::built_in_geometry(GetParam());
    const ReachableRegion region = reachable_region(geometry);
    ASSERT_FALSE(region.empty());
    Directions directions;
    for (int k = 0; k < 500; ++k) {
        const Pose pose{std::cbrt(directions.uniform()) * (region.semi_axes * directions.next()),
                        glm::angleAxis(region.angle * directions.uniform(), directions.next())};
        ASSERT_TRUE(device::wrench_closure(geometry, pose).closed()) << k;
        for (const device::StringFacts& string : geometry.strings) {
            ASSERT_GT(glm::length(string.motor - pose.position - pose.orientation * string.grip), 0.02);
        }
    }
}

TEST_P(ReachableRegionOf, IsUsefulAndWithinTheFrame) {
    const ReachableRegion region = reachable_region(device::built_in_geometry(GetParam()));
    for (int k = 0; k < 3; ++k) {
        EXPECT_GT(region.semi_axes[k], 0.012);
        EXPECT_LT(region.semi_axes[k], 0.060);
    }
    EXPECT_GT(region.angle, 0.25);
    EXPECT_LT(region.angle, 0.6);
}

TEST(WrenchMargin, IsTheSmallestReachOfAnyDirection) {
    // The oracle: the reach along 3,000 random directions, by linear programmes. None is less than the margin, and the
    // least of them is not far above it.
    const device::DeviceGeometry geometry = device::built_in_geometry("SpidarG6X3R");
    const double radius = 0.0225;
    for (const Pose& pose : {Pose{}, Pose{Vec3(0.01, -0.005, 0.004), glm::angleAxis(0.15, Vec3(0.0, 0.6, 0.8))}}) {
        const double margin = wrench_margin(geometry, pose);
        Directions directions;
        double least = HUGE_VAL;
        for (int k = 0; k < 3000; ++k) {
            device::WrenchVector wrench{};
            double squared = 0.0;
            for (double& part : wrench) {
                part = directions.normal();
                squared += part * part;
            }
            for (std::size_t axis = 0; axis < 6; ++axis) {
                wrench[axis] *= (axis < 3 ? 1.0 : radius) / std::sqrt(squared);
            }
            least = std::min(least, device::wrench_reach(geometry, pose, wrench).value());
        }
        EXPECT_GE(least, margin * (1.0 - 1e-9));
        EXPECT_LT(least, 1.5 * margin);
    }
}

TEST(WrenchMargin, IsNegativeWhereTheStringsAreNotWrenchClosed) {
    // X3F: all strings turn the grip the same way about y.
    const device::DeviceGeometry geometry = device::built_in_geometry("SpidarG6X3F");
    EXPECT_LT(wrench_margin(geometry, Pose{}), 0.0);
    EXPECT_TRUE(reachable_region(geometry).empty());
}

}  // namespace
}  // namespace haptic::rt
