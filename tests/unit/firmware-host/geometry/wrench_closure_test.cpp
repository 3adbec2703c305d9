#include "geometry/wrench_closure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include <haptic/device/variant_file.hpp>

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

/// What tensions do, by their definition.
WrenchVector wrench_of(const Variant& variant, const Pose& pose, const std::array<double, kStrings>& tensions) {
    Vec3 force(0.0);
    Vec3 torque(0.0);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec3 arm = glm::mat3_cast(pose.orientation) * variant.strings[i].grip;
        const Vec3 pull = tensions[i] * glm::normalize(variant.strings[i].motor - pose.position - arm);
        force += pull;
        torque += glm::cross(arm, pull);
    }
    return {force.x, force.y, force.z, torque.x, torque.y, torque.z};
}

TEST(WrenchClosure, HoldsForTheFramesThatRenderSixDegreesOfFreedom) {
    for (const char* name : {"SpidarG6X3R", "SpidarG6X3L", "SpidarG6X4", "SpidarG6X5R", "SpidarG6X5L"}) {
        const WrenchClosure closure = wrench_closure(builtin_variant(name), {});
        EXPECT_TRUE(closure.determined) << name;
        EXPECT_GT(closure.evenness, 0.9) << name;
        EXPECT_THAT(closure.missing, IsEmpty()) << name;
    }
}

TEST(WrenchClosure, FailsInYawForX3f) {
    const Variant variant = builtin_variant("SpidarG6X3F");
    const WrenchClosure closure = wrench_closure(variant, {});
    EXPECT_TRUE(closure.determined);
    EXPECT_FALSE(closure.closed());
    // Published: 1 N in each string makes 0.0737 N*m about y, in the list's frame, which is a mirror image of ours. So
    // every string turns the grip one way, and nothing turns it back.
    std::array<double, kStrings> one{};
    one.fill(1.0);
    EXPECT_NEAR(wrench_of(variant, {}, one)[4], -0.0737, 5e-5);
    EXPECT_THAT(closure.missing, Contains("+Ty"));
    EXPECT_THAT(closure.missing, Not(Contains("-Ty")));
    EXPECT_THAT(closure.missing, Contains("+Fx")) << "not without yaw beside it";
}

TEST(WrenchClosure, FailsForT1WithEitherWidth) {
    Variant variant = builtin_variant("SpidarG6T1");
    for (const double width : {0.229, 0.074155}) {
        variant.strings[0].motor.x = -width / 2.0;
        variant.strings[3].motor.x = +width / 2.0;
        const WrenchClosure closure = wrench_closure(variant, {});
        EXPECT_TRUE(closure.determined);
        EXPECT_FALSE(closure.closed());
        EXPECT_THAT(closure.missing, Contains("+Fz"));
    }
}

TEST(WrenchClosure, IsLostWhereTheGripIsTurnedTooFar) {
    const Variant variant = spidar_g6_x3r();
    EXPECT_TRUE(wrench_closure(variant, {{0.01, 0.01, -0.01}, glm::angleAxis(0.3, Vec3(0, 1, 0))}).closed());
    EXPECT_FALSE(wrench_closure(variant, {{}, glm::angleAxis(2.0, Vec3(0, 1, 0))}).closed());
}

TEST(WrenchClosure, NeedsStringsThatDetermineThePose) {
    Variant variant = spidar_g6_x3r();
    for (StringFacts& string : variant.strings) {
        string.grip = {0.0, 0.0225, 0.0};
    }
    const WrenchClosure closure = wrench_closure(variant, {});
    EXPECT_FALSE(closure.determined);
    EXPECT_FALSE(closure.closed());
    EXPECT_FALSE(wrench_reach(variant, {}, axis(0, 1.0)).has_value());
}

TEST(WrenchClosure, EvennessIsThatOfTheBestTensionsFoundBySampling) {
    // Tensions that cancel are two-dimensional: sampled by angle around a full turn of any two of them.
    for (const std::string& name : builtin_variant_names()) {
        const Variant variant = builtin_variant(name);
        const double evenness = wrench_closure(variant, {}).evenness;
        // Projecting random tensions on the kernel: t - A (A^T A)^-1 A^T t, by conjugate directions (Gram-Schmidt).
        std::array<std::array<double, kStrings>, 6> rows{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            std::array<double, kStrings> one{};
            one[i] = 1.0;
            const WrenchVector column = wrench_of(variant, {}, one);
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
            double least = 1e9;
            double largest = 0.0;
            for (std::size_t i = 0; i < kStrings; ++i) {
                const double tension = std::cos(angle) * kernel[0][i] + std::sin(angle) * kernel[1][i];
                least = std::min(least, tension);
                largest = std::max(largest, tension);
            }
            best = std::max(best, least / largest);
        }
        EXPECT_NEAR(evenness, best, 1e-3) << name;
    }
}

TEST(WrenchReach, IsNoMoreThanTheBoundThatDualityGives) {
    // For any linear functional c with c . axis = 1, the largest c . A^T t over the box bounds the reach; here c is the
    // axis itself.
    const Variant variant = spidar_g6_x3r();
    for (std::size_t k = 0; k < 6; ++k) {
        for (const double sign : {1.0, -1.0}) {
            const std::optional<double> reach = wrench_reach(variant, {}, axis(k, sign));
            ASSERT_TRUE(reach.has_value());
            double bound = 0.0;
            for (std::size_t i = 0; i < kStrings; ++i) {
                std::array<double, kStrings> one{};
                one[i] = 1.0;
                const double pull = sign * wrench_of(variant, {}, one)[k];
                bound += pull * (pull > 0.0 ? variant.maximum_tension : variant.minimum_tension);
            }
            EXPECT_LE(*reach, bound * (1.0 + 1e-9));
            EXPECT_GT(*reach, 0.5 * bound);
        }
    }
}

TEST(WrenchReach, GrowsWithTheTensionsAndScalesWithTheDirection) {
    Variant variant = builtin_variant("SpidarG6X5R");
    const double once = *wrench_reach(variant, {}, axis(2, 1.0));
    EXPECT_NEAR(*wrench_reach(variant, {}, axis(2, 4.0)), once / 4.0, 1e-9);
    variant.maximum_tension *= 2.0;
    variant.minimum_tension *= 2.0;
    EXPECT_NEAR(*wrench_reach(variant, {}, axis(2, 1.0)), 2.0 * once, 1e-9);
    // Published for 6 N: 7.4, 7.1 and 14.6 N, 0.11, 0.11 and 0.21 N*m, with a few per cent of other components let be.
    EXPECT_NEAR(once, 14.6, 0.6);
}

TEST(WrenchReach, SaysNothingWhereNoMultipleCanBeMade) {
    const Variant variant = builtin_variant("SpidarG6X3F");
    EXPECT_FALSE(wrench_reach(variant, {}, axis(0, 1.0)).has_value());
    EXPECT_TRUE(wrench_reach(variant, {}, axis(4, -1.0)).has_value());
    EXPECT_FALSE(wrench_reach(variant, {}, axis(4, 1.0)).has_value());
    EXPECT_FALSE(wrench_reach(spidar_g6_x3r(), {}, WrenchVector{}).has_value());
    EXPECT_FALSE(wrench_reach(spidar_g6_x3r(), {}, axis(0, NAN)).has_value());
}

}  // namespace
}  // namespace haptic::device
