#include "device/velocity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>
#include <stdexcept>

#include "device/encoder.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "random.hpp"
#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kTick;
using test::kTickNs;

Quat turn(const Vec3& axis, double angle_rad) {
    return glm::angleAxis(angle_rad, glm::normalize(axis));
}

VelocitySettings x3r_settings() {
    return {.window_ticks = 8, .noise = quantisation_noise(device::spidar_g6_x3r())};
}

/// The usual alternative: difference of poses and a first-order low-pass filter.
class LowPass {
  public:
    explicit LowPass(double time_constant_s) : share_(kTick / (time_constant_s + kTick)) {}
    double update(double x) {
        velocity_ += share_ * ((x - last_) / kTick - velocity_);
        last_ = x;
        return velocity_;
    }

  private:
    double share_;
    double last_ = 0.0;
    double velocity_ = 0.0;
};

/// Poses as an X3R measures them: lengths rounded to whole counts, then PoseSolver.
class Measured {
  public:
    Pose operator()(const Pose& pose) {
        StringArray lengths = string_lengths(geometry_, pose);
        for (std::size_t i = 0; i < kStrings; ++i) {
            const double count = std::fabs(geometry_.strings[i].metres_per_count);
            const double rest = geometry_.rest_length(i);
            lengths[i] = rest + std::floor((lengths[i] - rest) / count + 0.5) * count;
        }
        return solver_.solve(lengths).pose;
    }

  private:
    device::DeviceGeometry geometry_ = device::spidar_g6_x3r();
    PoseSolver solver_{geometry_};
};

struct Errors {
    double adaptive = 0.0;  // m/s, root mean square
    double low_pass = 0.0;
};

/// Errors of both estimators along x for a motion of the grip, from half a second on.
Errors errors_of(const std::function<double(double)>& position, const std::function<double(double)>& velocity) {
    Measured measured;
    AdaptiveVelocity adaptive(x3r_settings());
    LowPass low_pass(0.004);
    Errors errors;
    int count = 0;
    for (int tick = 0; tick <= 3000; ++tick) {
        const double t = kTick * tick;
        const Pose pose =
            measured({{position(t), 0.3 * position(t), -0.2 * position(t)}, turn({1, 1, 0}, 5.0 * position(t))});
        const double a = adaptive.update(pose, kTickNs).linear.x;
        const double b = low_pass.update(pose.position.x);
        if (tick >= 500) {
            errors.adaptive += std::pow(a - velocity(t), 2);
            errors.low_pass += std::pow(b - velocity(t), 2);
            ++count;
        }
    }
    return {std::sqrt(errors.adaptive / count), std::sqrt(errors.low_pass / count)};
}

TEST(RotationBetween, IsTheAxisTimesTheAngle) {
    const Quat from = turn({1, 2, 3}, 0.7);
    for (const double angle : {0.0, 1e-12, 1e-6, 0.1, 1.0, 3.0}) {
        const Vec3 axis = glm::normalize(Vec3(0.3, -1.0, 0.2));
        const Vec3 found = rotation_between(from, turn(axis, angle) * from);
        EXPECT_LT(glm::length(found - angle * axis), 1e-9) << angle;
    }
}

TEST(RotationBetween, HasAnAngleBelowPiForEitherSignOfTheQuaternion) {
    const Quat to = turn({0, 1, 0}, 0.2);
    EXPECT_LT(glm::length(rotation_between(Quat(1, 0, 0, 0), -to) - Vec3(0, 0.2, 0)), 1e-12);
    const Vec3 back = rotation_between(Quat(1, 0, 0, 0), turn({0, 1, 0}, 2.0 * std::numbers::pi - 0.2));
    EXPECT_LT(glm::length(back - Vec3(0, -0.2, 0)), 1e-12);
}

TEST(AdaptiveVelocity, IsExactForASteadyTwist) {
    AdaptiveVelocity filter(x3r_settings());
    const Vec3 v(0.1, -0.2, 0.05);
    const Vec3 w(0.0, 2.0, 0.0);
    filter.reset({});
    for (int tick = 1; tick <= 100; ++tick) {
        const double t = kTick * tick;
        filter.update({t * v, turn(w, t * glm::length(w))}, kTickNs);
        EXPECT_LT(glm::length(filter.twist().linear - v), 1e-10);
        EXPECT_LT(glm::length(filter.twist().angular - w), 1e-10);
    }
}

TEST(AdaptiveVelocity, AcceptsTicksOfAnyLength) {
    AdaptiveVelocity filter(x3r_settings());
    test::Random random(3);
    filter.reset({});
    std::int64_t now_ns = 0;
    for (int tick = 1; tick <= 100; ++tick) {
        const auto elapsed_ns = static_cast<std::int64_t>(random.uniform(2e5, 3e6));
        now_ns += elapsed_ns;
        filter.update({Vec3(0.3 * seconds(now_ns), 0, 0), Quat(1, 0, 0, 0)}, elapsed_ns);
        EXPECT_NEAR(filter.twist().linear.x, 0.3, 1e-9);
    }
}

TEST(AdaptiveVelocity, FollowsASuddenStopWithinTwoTicks) {
    // 0.5 m/s, then a stop. A low-pass filter of 4 ms still reports 0.13 m/s after 6 ms.
    AdaptiveVelocity filter(x3r_settings());
    filter.reset({});
    for (int tick = 1; tick <= 50; ++tick) {
        filter.update({Vec3(0.0005 * tick, 0, 0), Quat(1, 0, 0, 0)}, kTickNs);
    }
    EXPECT_NEAR(filter.twist().linear.x, 0.5, 1e-10);
    EXPECT_EQ(filter.update({Vec3(0.025, 0, 0), Quat(1, 0, 0, 0)}, kTickNs).linear.x, 0.0);
}

TEST(AdaptiveVelocity, AtRestIsZeroWhenTheCountersStandStill) {
    AdaptiveVelocity filter(x3r_settings());
    for (int tick = 0; tick < 100; ++tick) {
        filter.update({Vec3(0.01, 0.02, 0.03), turn({1, 2, 3}, 0.4)}, kTickNs);
    }
    EXPECT_EQ(filter.twist().linear, Vec3(0.0));
    EXPECT_LT(glm::length(filter.twist().angular), 1e-12);
}

TEST(AdaptiveVelocity, HasLessNoiseAndLessLagThanTheLowPassFilter) {
    // Slow: quantisation dominates. Fast: lag dominates. In between both matter.
    const auto sine = [](double amplitude, double hz) {
        const double omega = 2.0 * std::numbers::pi * hz;
        return errors_of([=](double t) { return amplitude * std::sin(omega * t); },
                         [=](double t) { return amplitude * omega * std::cos(omega * t); });
    };
    const Errors slow = errors_of([](double t) { return 0.003 * t; }, [](double) { return 0.003; });
    const Errors tremor = sine(0.0005, 8.0);
    const Errors reach = sine(0.02, 1.0);
    const Errors fast = sine(0.02, 4.0);
    RecordProperty("slow_mm_s", std::to_string(1e3 * slow.adaptive) + " was " + std::to_string(1e3 * slow.low_pass));
    RecordProperty("tremor_mm_s",
                   std::to_string(1e3 * tremor.adaptive) + " was " + std::to_string(1e3 * tremor.low_pass));
    RecordProperty("reach_mm_s", std::to_string(1e3 * reach.adaptive) + " was " + std::to_string(1e3 * reach.low_pass));
    RecordProperty("fast_mm_s", std::to_string(1e3 * fast.adaptive) + " was " + std::to_string(1e3 * fast.low_pass));
    EXPECT_LT(slow.adaptive, 0.8 * slow.low_pass);
    EXPECT_LT(tremor.adaptive, 0.9 * tremor.low_pass);
    EXPECT_LT(reach.adaptive, 0.9 * reach.low_pass);
    EXPECT_LT(fast.adaptive, 0.35 * fast.low_pass);
}

TEST(AdaptiveVelocity, WithAWindowOfOneTickIsTheDifferenceQuotient) {
    AdaptiveVelocity filter({.window_ticks = 1, .noise = {}});
    filter.reset({Vec3(1, 0, 0), Quat(1, 0, 0, 0)});
    filter.update({Vec3(1.001, 0, 0), Quat(1, 0, 0, 0)}, kTickNs);
    EXPECT_NEAR(filter.update({Vec3(1.003, 0, 0), Quat(1, 0, 0, 0)}, 2 * kTickNs).linear.x, 1.0, 1e-9);
}

TEST(AdaptiveVelocity, KeepsItsVelocityWhenNoTimeHasPassed) {
    AdaptiveVelocity filter(x3r_settings());
    filter.update({Vec3(0.001, 0, 0), Quat(1, 0, 0, 0)}, kTickNs);
    const Vec3 before = filter.twist().linear;
    EXPECT_EQ(filter.update({Vec3(5, 0, 0), Quat(1, 0, 0, 0)}, 0).linear, before);
}

TEST(AdaptiveVelocity, ForgetsTheHistoryAtAReset) {
    AdaptiveVelocity filter(x3r_settings());
    for (int tick = 0; tick < 50; ++tick) {
        filter.update({Vec3(0.001 * tick, 0, 0), turn({0, 0, 1}, 0.01 * tick)}, kTickNs);
    }
    filter.reset({});
    EXPECT_EQ(filter.twist().linear, Vec3(0.0));
    EXPECT_NEAR(filter.update({Vec3(0.0, 0.001, 0), Quat(1, 0, 0, 0)}, kTickNs).linear.y, 1.0, 1e-12);
    EXPECT_EQ(filter.twist().linear.x, 0.0);
    EXPECT_EQ(filter.twist().angular, Vec3(0.0));
}

TEST(AdaptiveVelocity, RejectsInvalidSettings) {
    EXPECT_THROW(AdaptiveVelocity({.window_ticks = 0, .noise = {}}), std::invalid_argument);
    EXPECT_THROW(AdaptiveVelocity({.window_ticks = 65, .noise = {}}), std::invalid_argument);
    EXPECT_THROW(AdaptiveVelocity({.window_ticks = 16, .noise = {.position = Vec3(-1.0), .rotation = Vec3(0.0)}}),
                 std::invalid_argument);
}

TEST(QuantisationNoise, BoundsTheErrorOfRoundedCounters) {
    for (const char* name : {"SpidarG6X3R", "SpidarG6X4", "SpidarG6X5R"}) {
        const device::DeviceGeometry geometry = device::built_in_geometry(name);
        const PoseNoise noise = quantisation_noise(geometry);
        test::Random random(4);
        Vec3 furthest(0.0);
        Vec3 widest(0.0);
        for (int k = 0; k < 3000; ++k) {
            StringArray lengths = string_lengths(geometry, {});
            for (std::size_t i = 0; i < kStrings; ++i) {
                lengths[i] += random.uniform(-0.5, 0.5) * geometry.strings[i].metres_per_count;
            }
            PoseSolver solver(geometry);
            const Pose pose = solver.solve(lengths).pose;
            furthest = glm::max(furthest, glm::abs(pose.position));
            widest = glm::max(widest, glm::abs(rotation_between(Quat(1, 0, 0, 0), pose.orientation)));
        }
        for (int k = 0; k < 3; ++k) {
            EXPECT_LT(furthest[k], noise.position[k] * 1.001) << name;
            EXPECT_GT(furthest[k], 0.5 * noise.position[k]) << name;
            EXPECT_LT(widest[k], noise.rotation[k] * 1.001) << name;
            EXPECT_GT(widest[k], 0.5 * noise.rotation[k]) << name;
        }
    }
}

}  // namespace
}  // namespace haptic::rt
