// `rt-core calibrate` as a person uses it, on an emulated device whose geometry differs from its nominal one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/frames.h"
#include "haptic/types.hpp"
#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Calibrate : public testing::Test {
  protected:
    void SetUp() override {
        std::mt19937 random(11);
        std::normal_distribution<double> normal;
        truth = nominal;
        for (device::StringFacts& string : truth.strings) {
            for (int k = 0; k < 3; ++k) {
                string.motor[k] += 1e-3 * normal(random);
                string.grip[k] += 1e-3 * normal(random);
            }
            string.metres_per_count *= 1.0 + 0.005 * normal(random);
        }
        std::ofstream(folder / "truth.toml") << device::to_toml(truth, "as it was built");
    }

    /// Hand that holds still for 2 s, then moves.
    std::string hand() {
        CsvWriter writer(folder / "hand.csv", {"time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"});
        for (int i = 0; i <= 900; ++i) {
            const double t = i * 0.01;
            const double s = std::max(0.0, t - 2.0);
            const double ease = std::min(1.0, s);
            const Vec3 turn = 0.35 * ease * Vec3(std::sin(5.1 * s), std::sin(3.7 * s + 1.0), std::sin(4.3 * s + 2.0));
            const double angle = glm::length(turn);
            const Quat q = angle > 0.0 ? glm::angleAxis(angle, turn / angle) : Quat(1.0, 0.0, 0.0, 0.0);
            writer.row(std::vector<double>{t, 0.018 * ease * std::sin(3.1 * s), 0.018 * ease * std::sin(4.7 * s + 0.5),
                                           0.018 * ease * std::sin(2.3 * s + 2.5), q.w, q.x, q.y, q.z});
        }
        writer.close();
        return folder / "hand.csv";
    }

    /// RMS distance between the motors and knots of two geometries, m.
    static double distance(const device::DeviceGeometry& a, const device::DeviceGeometry& b) {
        double sum = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            const Vec3 motor = a.strings[i].motor - b.strings[i].motor;
            const Vec3 knot = a.strings[i].grip - b.strings[i].grip;
            sum += glm::dot(motor, motor) + glm::dot(knot, knot);
        }
        return std::sqrt(sum / (2.0 * kStrings));
    }

    ScratchFolder folder;
    device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X3R");
    device::DeviceGeometry truth;
};

TEST_F(Calibrate, FindsTheGeometryAndBacksUpTheOldFile) {
    const std::string recording = folder / "wiggle.csv";
    const Finished run_once = run({RT_CORE, "run", "--session", unique_session(), "--set",
                                   "device.geometry=" + (folder / "truth.toml").string(), "--hand", hand(),
                                   "--duration", "8", "--record", recording});
    ASSERT_EQ(run_once.status, 0) << run_once.output;

    const std::string out = folder / "mine.toml";
    std::ofstream(out) << "precious";
    const Finished fitted = run({RT_CORE, "calibrate", "--fit", recording, "--geometry", "SpidarG6X3R", "--out", out,
                                 "--weigh", "3=0.200@31", "--yes"});
    ASSERT_EQ(fitted.status, 0) << fitted.output;
    EXPECT_THAT(fitted.output,
                AllOf(HasSubstr("converged"), HasSubstr("string 7 scale"), HasSubstr("mine.toml.bak-1")));
    std::string kept;
    std::getline(std::ifstream(folder / "mine.toml.bak-1"), kept);
    EXPECT_EQ(kept, "precious");

    const device::DeviceGeometry found = device::load_device_geometry(out);
    EXPECT_LT(distance(found, truth), 0.8 * distance(nominal, truth)) << "m";
    EXPECT_NEAR(found.strings[3].newtons_per_code, 0.2 * 9.80665 / 31.0, 1e-12);
    EXPECT_EQ(found.strings[2].newtons_per_code, nominal.strings[2].newtons_per_code);
    EXPECT_EQ(found.maximum_tension, nominal.maximum_tension);
}

TEST_F(Calibrate, GuidesAHandThroughHoldingAndMoving) {
    const std::string out = folder / "mine.toml";
    // With the profile of a real device, whose walls begin nearer than the hand goes.
    const Finished guided = run({RT_CORE, "calibrate", "--geometry", folder / "truth.toml", "--hand", hand(), "--hold",
                                 "1", "--wiggle", "5", "--set", "safety.profile=normal", "--out", out, "--yes"});
    ASSERT_EQ(guided.status, 0) << guided.output;
    EXPECT_THAT(guided.output, AllOf(HasSubstr("at the centre"), HasSubstr("held for 1.0 s"),
                                     HasSubstr("string 0: +0 counts"), HasSubstr("range x"), HasSubstr("written to")));
    EXPECT_LT(distance(device::load_device_geometry(out), truth), 5e-4) << "m: the file was right already";
    std::string first;
    std::getline(std::ifstream(out), first);
    EXPECT_EQ(first, "# as it was built") << "the comment is kept";
    const CsvTable wiggle = CsvTable::load(folder / "mine.wiggle.csv");
    EXPECT_GT(wiggle.rows(), 5000u);
    for (const double flags : wiggle.column("flags")) {
        ASSERT_EQ(static_cast<std::uint32_t>(flags) & HAPTIC_TICK_WORKSPACE_EDGE, 0U) << "no wall pushes back";
    }
}

TEST_F(Calibrate, ChangesNothingWhenTheGripWasNotHeld) {
    std::ofstream(folder / "restless.csv") << "time_s,x_m,y_m,z_m\n0,0,0,0\n0.5,0.01,0,0\n9,0.01,0,0\n";
    const std::string out = folder / "mine.toml";
    const Finished guided =
        run({RT_CORE, "calibrate", "--hand", folder / "restless.csv", "--hold", "1", "--out", out, "--yes"});
    EXPECT_NE(guided.status, 0);
    EXPECT_THAT(guided.output, HasSubstr("the grip was not held still"));
    EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(Calibrate, KeepsTheRecordingOfAnEarlierMovement) {
    std::ofstream(folder / "mine.wiggle.csv") << "precious";
    const Finished guided = run({RT_CORE, "calibrate", "--hand", hand(), "--hold", "1", "--wiggle", "5", "--out",
                                 folder / "mine.toml", "--yes"});
    ASSERT_EQ(guided.status, 0) << guided.output;
    std::string kept;
    std::getline(std::ifstream(folder / "mine.wiggle.csv"), kept);
    EXPECT_EQ(kept, "precious");
    EXPECT_GT(CsvTable::load(folder / "mine.wiggle-2.csv").rows(), 5000u);
}

TEST_F(Calibrate, RefusesToAskWithoutATerminal) {
    const Finished guided = run({"/bin/sh", "-c", std::string(RT_CORE) + " calibrate </dev/null"});
    EXPECT_EQ(guided.status, 2);
    EXPECT_THAT(guided.output, AllOf(HasSubstr("not a terminal"), HasSubstr("--yes")));
    const Finished weighed = run({RT_CORE, "calibrate", "--yes", "--weigh", "9=1@2"});
    EXPECT_EQ(weighed.status, 2);
    EXPECT_THAT(weighed.output, HasSubstr("9=1@2"));
}

}  // namespace
}  // namespace haptic::test
