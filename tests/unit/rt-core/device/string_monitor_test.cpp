#include "device/string_monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/device/device_geometry_file.hpp"
#include "random.hpp"

namespace haptic::rt {
namespace {

constexpr std::uint8_t mask(std::initializer_list<int> strings) {
    unsigned bits = 0;
    for (const int string : strings) {
        bits |= 1U << static_cast<unsigned>(string);
    }
    return static_cast<std::uint8_t>(bits);
}

/// A hand, a solver and a monitor, stepped tick by tick; one string reads wrong.
class Rig {
  public:
    explicit Rig(const device::DeviceGeometry& geometry, double residual = 1e-3)
        : geometry_(geometry), solver_(geometry), monitor_(geometry, {.residual = residual}) {}

    StringSuspicion tick(const Pose& pose, std::size_t wrong, double by) {
        StringArray lengths = string_lengths(geometry_, pose);
        for (std::size_t i = 0; i < kStrings; ++i) {
            const double count = std::fabs(geometry_.strings[i].metres_per_count);
            lengths[i] = std::floor(lengths[i] / count + 0.5) * count;
        }
        lengths[wrong] += by;
        residual_ = solver_.solve(lengths).residual;
        return monitor_.update(lengths, solver_.solve(lengths));
    }
    void begin(const Pose& pose) {
        solver_.reset(pose);
        monitor_.reset(pose);
    }
    [[nodiscard]] double residual() const { return residual_; }

  private:
    device::DeviceGeometry geometry_;
    PoseSolver solver_;
    StringMonitor monitor_;
    double residual_ = 0.0;
};

TEST(StringMonitor, SuspectsNoStringWhileTheLengthsAgree) {
    Rig rig(device::spidar_g6_x3r());
    test::Random random(1);
    for (int k = 0; k < 500; ++k) {
        const Pose pose{random.direction() * 0.01, glm::angleAxis(0.2, random.direction())};
        EXPECT_EQ(rig.tick(pose, 0, 0.0).strings, 0);
    }
}

TEST(StringMonitor, AtTheCentreSuspectsTheStringAndItsMirrorImages) {
    // An X3R at the centre is symmetric: strings on the axis (2, 3, 6, 7) have one mirror image, the others three.
    const std::array<std::uint8_t, kStrings> likes = {mask({0, 3, 5, 6}), mask({1, 2, 4, 7}), mask({2, 7}),
                                                      mask({3, 6}),       mask({1, 2, 4, 7}), mask({0, 3, 5, 6}),
                                                      mask({3, 6}),       mask({2, 7})};
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (const double by : {0.005, -0.005}) {
            Rig rig(device::spidar_g6_x3r(), 3e-4);
            rig.begin({});
            rig.tick({}, i, 0.0);
            const StringSuspicion found = rig.tick({}, i, by);
            if (by > 0.0) {
                EXPECT_EQ(found.strings, likes[i]) << i;
            }
            EXPECT_NE(found.strings >> i & 1, 0) << i;
            EXPECT_EQ(found.slack, by > 0.0 ? found.strings : 0) << i;
            EXPECT_NEAR(found.error, by, 2e-4);
        }
    }
}

TEST(StringMonitor, NeverMissesTheStringAndUsuallyKnowsTheSignOfItsError) {
    // Anywhere within 2 cm and 20 degrees, on every device that renders: a string pays out, or is wound in, within 10
    // ticks while the hand moves.
    test::Random random(2);
    for (const char* name : {"SpidarG6X3R", "SpidarG6X3L", "SpidarG6X4", "SpidarG6X5R"}) {
        const device::DeviceGeometry geometry = device::built_in_geometry(name);
        int seen = 0;
        int named = 0;
        int sensed = 0;
        int candidates = 0;
        for (int k = 0; k < 400; ++k) {
            const Vec3 start = random.direction() * random.uniform(0.0, 0.02);
            const Quat level = glm::angleAxis(random.uniform(-0.35, 0.35), random.direction());
            const Vec3 velocity = 0.3 * random.direction();
            const Vec3 axis = random.direction();
            const auto wrong = static_cast<std::size_t>(random.uniform(0.0, 7.999));
            const double by = (k % 2 == 0 ? 1.0 : -1.0) * random.uniform(0.005, 0.015);
            Rig rig(geometry);
            rig.begin({start, level});
            StringSuspicion found;
            for (int tick = 0; tick < 40; ++tick) {
                const double t = 1e-3 * tick;
                const Pose pose{start + t * velocity, glm::angleAxis(3.0 * t, axis) * level};
                found = rig.tick(pose, wrong, by * std::min(1.0, tick / 10.0));
            }
            if (found.strings == 0) {
                EXPECT_LE(rig.residual(), 1e-3);
                continue;  // too small to be visible at this pose
            }
            ++seen;
            named += found.strings >> wrong & 1;
            sensed += found.slack == (by > 0.0 ? found.strings : 0) ? 1 : 0;
            candidates += std::popcount(found.strings);
        }
        EXPECT_GT(seen, 200) << name;
        EXPECT_EQ(named, seen) << name;
        EXPECT_GT(sensed, 0.9 * seen) << name;
        EXPECT_LT(candidates, 2.2 * seen) << name << ": suspects of 8 strings";
        RecordProperty(std::string(name) + "_mean_set", std::to_string(double(candidates) / seen));
    }
}

TEST(StringMonitor, NarrowsTheSetAsTheHandMoves) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    Rig rig(geometry, 3e-4);
    rig.begin({});
    rig.tick({}, 0, 0.0);
    EXPECT_EQ(std::popcount(rig.tick({}, 0, 0.006).strings), 4);
    StringSuspicion found;
    for (int tick = 0; tick < 200; ++tick) {
        const double t = 1e-3 * tick;
        found = rig.tick({{-0.06 * t, 0.05 * t, 0.1 * t}, glm::angleAxis(1.5 * t, glm::normalize(Vec3(1, 2, 0)))}, 0,
                         0.006);
    }
    EXPECT_EQ(found.strings, mask({0})) << "was one of four";
    EXPECT_EQ(found.slack, mask({0}));
    EXPECT_NEAR(found.error, 0.006, 1e-4);
}

TEST(StringMonitor, ForgetsTheEvidenceOnceTheLengthsAgreeAgain) {
    Rig rig(device::spidar_g6_x3r());
    rig.begin({});
    rig.tick({}, 4, 0.0);
    EXPECT_NE(rig.tick({}, 4, 0.01).strings, 0);
    rig.tick({}, 4, 0.0);
    EXPECT_EQ(rig.tick({}, 4, 0.0).strings, 0);
}

TEST(StringMonitor, SuspectsNoStringWithoutAPose) {
    StringMonitor monitor(device::spidar_g6_x3r(), {});
    PoseEstimate estimate;
    estimate.residual = 0.01;
    StringArray lengths{};
    lengths.fill(std::numeric_limits<double>::quiet_NaN());
    estimate.status = PoseStatus::NonFinite;
    EXPECT_EQ(monitor.update(lengths, estimate).strings, 0);
    estimate.status = PoseStatus::Ok;
    EXPECT_EQ(monitor.update(lengths, estimate).slack, 0);
}

TEST(StringMonitor, RejectsInvalidSettings) {
    EXPECT_THROW(StringMonitor(device::spidar_g6_x3r(), {.residual = 0.0}), std::invalid_argument);
    EXPECT_THROW(StringMonitor(device::spidar_g6_x3r(), {.memory_ticks = -1.0}), std::invalid_argument);
}

TEST(PoseSolverWithout, ExplainsSevenLengthsAndReportsTheErrorOfTheEighth) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    const PoseSolver solver(geometry);
    test::Random random(5);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Pose pose{random.direction() * 0.01, glm::angleAxis(0.2, random.direction())};
        StringArray lengths = string_lengths(geometry, pose);
        lengths[i] += 0.1;
        PoseEstimate estimate;
        for (int update = 0; update < 3; ++update) {
            estimate = solver.solve_without(i, lengths, estimate.pose);
        }
        EXPECT_EQ(estimate.status, PoseStatus::Ok);
        EXPECT_LT(glm::length(estimate.pose.position - pose.position), 1e-9);
        EXPECT_LT(estimate.residual, 1e-12);
        EXPECT_NEAR(estimate.residuals[i], 0.1, 1e-9);
    }
}

}  // namespace
}  // namespace haptic::rt
