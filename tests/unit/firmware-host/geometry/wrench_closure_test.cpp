#include "haptic/device/wrench_closure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::device {
namespace {

using testing::Contains;
using testing::IsEmpty;
using testing::Not;

constexpr WrenchVector axis(std::size_t k, double size) {
    WrenchVector wrench{};
    wrench[k] = size;
    return wrench;
}

/// Wrench of tensions by definition.
WrenchVector wrench_of(const DeviceGeometry& geometry, const Pose& pose, const std::array<double, kStrings>& tensions) {
    Vec3 force(0.0);
    Vec3 torque(0.0);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec3 arm = glm::mat3_cast(pose.orientation) * geometry.strings[i].grip;
        const Vec3 pull = tensions[i] * glm::normalize(geometry.strings[i].motor - pose.position - arm);
        force += pull;
        torque += glm::cross(arm, pull);
    }
    return {force.x, force.y, force.z, torque.x, torque.y, torque.z};
}

TEST(WrenchClosure, HoldsForTheFramesThatRenderSixDegreesOfFreedom) {
    for (const char* name : {"SpidarG6X3R", "SpidarG6X3L", "SpidarG6X4", "SpidarG6X5R", "SpidarG6X5L"}) {
        const WrenchClosure closure = wrench_closure(built_in_geometry(name), {});
        EXPECT_TRUE(closure.determined) << name;
        EXPECT_GT(closure.tension_factor, 0.9) << name;
        EXPECT_THAT(closure.missing, IsEmpty()) << name;
    }
}

TEST(WrenchClosure, FailsInYawForX3f) {
    const DeviceGeometry geometry = built_in_geometry("SpidarG6X3F");
    const WrenchClosure closure = wrench_closure(geometry, {});
    EXPECT_TRUE(closure.determined);
    EXPECT_FALSE(closure.closed());
    // Published: 1 N in each string makes 0.0737 N*m about y, in the list's frame, which is a mirror image of ours. So
    // every string rotates the grip in the same direction, and none in the other.
    std::array<double, kStrings> one{};
    one.fill(1.0);
    EXPECT_NEAR(wrench_of(geometry, {}, one)[4], -0.0737, 5e-5);
    EXPECT_THAT(closure.missing, Contains("+Ty"));
    EXPECT_THAT(closure.missing, Not(Contains("-Ty")));
    EXPECT_THAT(closure.missing, Contains("+Fx")) << "not without yaw beside it";
}

TEST(WrenchClosure, FailsForT1WithEitherWidth) {
    DeviceGeometry geometry = built_in_geometry("SpidarG6T1");
    for (const double width : {0.229, 0.074155}) {
        geometry.strings[0].motor.x = -width / 2.0;
        geometry.strings[3].motor.x = +width / 2.0;
        const WrenchClosure closure = wrench_closure(geometry, {});
        EXPECT_TRUE(closure.determined);
        EXPECT_FALSE(closure.closed());
        EXPECT_THAT(closure.missing, Contains("+Fz"));
    }
}

TEST(WrenchClosure, IsLostWhereTheGripIsTurnedTooFar) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    EXPECT_TRUE(wrench_closure(geometry, {{0.01, 0.01, -0.01}, glm::angleAxis(0.3, Vec3(0, 1, 0))}).closed());
    EXPECT_FALSE(wrench_closure(geometry, {{}, glm::angleAxis(2.0, Vec3(0, 1, 0))}).closed());
}

TEST(WrenchClosure, NeedsStringsThatDetermineThePose) {
    DeviceGeometry geometry = spidar_g6_x3r();
    for (StringFacts& string : geometry.strings) {
        string.grip = {0.0, 0.0225, 0.0};
    }
    const WrenchClosure closure = wrench_closure(geometry, {});
    EXPECT_FALSE(closure.determined);
    EXPECT_FALSE(closure.closed());
    EXPECT_FALSE(wrench_reach(geometry, {}, axis(0, 1.0)).has_value());
}

TEST(WrenchClosure, TensionFactorEqualsTheBestOneFoundBySampling) {
    // The tensions that cancel form a plane: sample it by angle around two of its vectors.
    for (const std::string& name : built_in_geometry_names()) {
        const DeviceGeometry geometry = built_in_geometry(name);
        const double tension_factor = wrench_closure(geometry, {}).tension_factor;
        // Project random tensions onto the null space, t - A (A^T A)^-1 A^T t, by Gram-Schmidt.
        std::array<std::array<double, kStrings>, 6> rows{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            std::array<double, kStrings> one{};
            one[i] = 1.0;
            const WrenchVector column = wrench_of(geometry, {}, one);
            for (std::size_t k = 0; k < 6; ++k) {
                rows[k][i] = column[k];
            }
        }
        const auto dot = [](const auto& a, const auto& b) {
            double sum = 0.0;
            for (std::size_t i = 0; i < kStrings; ++i) {
                sum += a[i] * b[i];
            }
            return sum;
        };
        const auto remove = [&](std::array<double, kStrings>& from, const std::array<double, kStrings>& what) {
            const double share = dot(from, what) / dot(what, what);
            for (std::size_t i = 0; i < kStrings; ++i) {
                from[i] -= share * what[i];
            }
        };
        for (std::size_t k = 0; k < 6; ++k) {
            for (int twice = 0; twice < 2; ++twice) {
                for (std::size_t j = 0; j < k; ++j) {
                    remove(rows[k], rows[j]);
                }
            }
        }
        std::array<std::array<double, kStrings>, 2> kernel{{{1, 2, 3, 4, 5, 6, 7, 9}, {3, 1, -4, 1, 5, -9, 2, 6}}};
        for (std::size_t k = 0; k < 2; ++k) {
            for (int twice = 0; twice < 2; ++twice) {
                for (const auto& row : rows) {
                    remove(kernel[k], row);
                }
            }
        }
        double best = 0.0;
        for (int step = 0; step < 100000; ++step) {
            const double angle = 2.0 * 3.14159265358979 * step / 100000;
            double smallest = 1e9;
            double largest = 0.0;
            for (std::size_t i = 0; i < kStrings; ++i) {
                const double tension = std::cos(angle) * kernel[0][i] + std::sin(angle) * kernel[1][i];
                smallest = std::min(smallest, tension);
                largest = std::max(largest, tension);
            }
            best = std::max(best, smallest / largest);
        }
        EXPECT_NEAR(tension_factor, best, 1e-3) << name;
    }
}

TEST(WrenchReach, IsNoMoreThanTheBoundThatDualityGives) {
    // For any linear functional c with c . axis = 1, the largest c . A^T t over the box bounds the reach; here c is the
    // axis itself.
    const DeviceGeometry geometry = spidar_g6_x3r();
    for (std::size_t k = 0; k < 6; ++k) {
        for (const double sign : {1.0, -1.0}) {
            const std::optional<double> reach = wrench_reach(geometry, {}, axis(k, sign));
            ASSERT_TRUE(reach.has_value());
            double bound = 0.0;
            for (std::size_t i = 0; i < kStrings; ++i) {
                std::array<double, kStrings> one{};
                one[i] = 1.0;
                const double pull = sign * wrench_of(geometry, {}, one)[k];
                bound += pull * (pull > 0.0 ? geometry.maximum_tension : geometry.minimum_tension);
            }
            EXPECT_LE(*reach, bound * (1.0 + 1e-9));
            EXPECT_GT(*reach, 0.5 * bound);
        }
    }
}

TEST(WrenchReach, GrowsWithTheTensionsAndScalesWithTheDirection) {
    DeviceGeometry geometry = built_in_geometry("SpidarG6X5R");
    const double once = *wrench_reach(geometry, {}, axis(2, 1.0));
    EXPECT_NEAR(*wrench_reach(geometry, {}, axis(2, 4.0)), once / 4.0, 1e-9);
    geometry.maximum_tension *= 2.0;
    geometry.minimum_tension *= 2.0;
    EXPECT_NEAR(*wrench_reach(geometry, {}, axis(2, 1.0)), 2.0 * once, 1e-9);
    // Published for 6 N: 7.4, 7.1 and 14.6 N, 0.11, 0.11 and 0.21 N*m, with a few per cent of other components allowed.
    EXPECT_NEAR(once, 14.6, 0.6);
}

TEST(WrenchReach, SaysNothingWhereNoMultipleCanBeMade) {
    const DeviceGeometry geometry = built_in_geometry("SpidarG6X3F");
    EXPECT_FALSE(wrench_reach(geometry, {}, axis(0, 1.0)).has_value());
    EXPECT_TRUE(wrench_reach(geometry, {}, axis(4, -1.0)).has_value());
    EXPECT_FALSE(wrench_reach(geometry, {}, axis(4, 1.0)).has_value());
    EXPECT_FALSE(wrench_reach(spidar_g6_x3r(), {}, WrenchVector{}).has_value());
    EXPECT_FALSE(wrench_reach(spidar_g6_x3r(), {}, axis(0, NAN)).has_value());
}

}  // namespace
}  // namespace haptic::device
