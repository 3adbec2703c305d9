#include "device/kinematics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_device.hpp"
#include "not_finite.hpp"
#include "random.hpp"

namespace haptic::rt {
namespace {

using test::kInfinity;
using test::kNaN;

constexpr double kDegree = std::numbers::pi / 180.0;

/// Rotation about an axis by Rodrigues' formula: the oracle shares no quaternion with the code under test.
Vec3 rotated(const Vec3& v, const Vec3& axis, double angle) {
    return v * std::cos(angle) + glm::cross(axis, v) * std::sin(angle) +
           axis * glm::dot(axis, v) * (1.0 - std::cos(angle));
}

struct Placement {
    Vec3 position;
    Vec3 axis;
    double angle;

    [[nodiscard]] Pose pose() const {
        const Vec3 imaginary = axis * std::sin(angle / 2.0);
        return {position, Quat(std::cos(angle / 2.0), imaginary.x, imaginary.y, imaginary.z)};
    }
};

class RandomPlacements : public test::Random {
  public:
    using test::Random::Random;
    Placement placement(double distance, double angle) {
        const Vec3 position = direction() * distance;
        return {position, direction(), angle};
    }
};

double angle_between(const Quat& a, const Quat& b) {
    const Quat difference = glm::conjugate(a) * b;
    const double sine = glm::length(Vec3(difference.x, difference.y, difference.z));
    return 2.0 * std::atan2(sine, std::abs(difference.w));
}

TEST(Kinematics, LengthsAreTheDistancesFromKnotToMotor) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    RandomPlacements random(1);
    for (int k = 0; k < 200; ++k) {
        const Placement placement = random.placement(random.uniform(0.0, 0.04), random.uniform(-1.0, 1.0));
        const StringArray lengths = string_lengths(geometry, placement.pose());
        for (std::size_t i = 0; i < kStrings; ++i) {
            const device::StringFacts& string = geometry.strings[i];
            const Vec3 knot = placement.position + rotated(string.grip, placement.axis, placement.angle);
            EXPECT_NEAR(lengths[i], glm::length(string.motor - knot), 1e-15);
        }
    }
}

TEST(Kinematics, WireMatrixIsMinusTheDerivativeOfTheLengths) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    RandomPlacements random(2);
    constexpr double kStep = 1e-6;       // m, rad
    constexpr double kTolerance = 1e-9;  // m/m, m/rad: rounding 1e-17 / 1e-6, truncation step^2 / length^2
    for (int k = 0; k < 100; ++k) {
        const Placement at = random.placement(random.uniform(0.0, 0.04), random.uniform(-1.0, 1.0));
        const WireMatrix wires = wire_matrix(geometry, at.pose());
        for (std::size_t i = 0; i < kStrings; ++i) {
            const device::StringFacts& string = geometry.strings[i];
            const Vec3 arm = rotated(string.grip, at.axis, at.angle);
            const auto length = [&](const Vec3& shift, const Vec3& about, double by) {
                return glm::length(string.motor - (at.position + shift) - rotated(arm, about, by));
            };
            for (int j = 0; j < 3; ++j) {
                Vec3 unit(0.0, 0.0, 0.0);
                unit[j] = 1.0;
                const double by_shift = (length(unit * kStep, unit, 0.0) - length(-unit * kStep, unit, 0.0)) / 2e-6;
                const double by_turn = (length({}, unit, kStep) - length({}, unit, -kStep)) / 2e-6;
                EXPECT_NEAR(wires[i][static_cast<std::size_t>(j)], -by_shift, kTolerance);
                EXPECT_NEAR(wires[i][static_cast<std::size_t>(j) + 3], -by_turn, kTolerance);
            }
        }
    }
}

TEST(Kinematics, AStringOfZeroLengthHasAZeroRow) {
    device::DeviceGeometry geometry = device::spidar_g6_x3r();
    geometry.strings[3].motor = geometry.strings[3].grip;
    const WireMatrix wires = wire_matrix(geometry, {});
    for (const double entry : wires[3]) {
        EXPECT_EQ(entry, 0.0);
    }
}

TEST(Kinematics, WrenchOfTensionsEqualsThatOfTheEmulatedDevice) {
    // The emulated device computes its wrench independently, string by string.
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    RandomPlacements random(3);
    for (int k = 0; k < 100; ++k) {
        const Pose pose = random.placement(0.02, 0.5).pose();
        device::EmulatedDevice grip({.geometry = geometry, .hand = PoseTrack(pose)});
        std::array<std::int16_t, kStrings> dac_codes{};
        for (std::int16_t& dac_code : dac_codes) {
            dac_code = static_cast<std::int16_t>(random.uniform(0.0, 4095.0));
        }
        grip.set_dac_codes(dac_codes);
        const Wrench wrench = wrench_of_tensions(wire_matrix(geometry, grip.grip_pose()), grip.tensions());
        const Wrench felt = grip.wrench();
        EXPECT_NEAR(glm::length(wrench.force - felt.force), 0.0, 1e-12);
        EXPECT_NEAR(glm::length(wrench.torque - felt.torque), 0.0, 1e-13);
    }
}

TEST(PoseSolver, RotatingTheRightSideAwayIsPositiveAboutY) {
    // As seen by the user in front of an X4: string 1 runs from the right side of the grip to the lower far right
    // motor, string 5 to the upper one, 2 and 6 from the left side to the far left motors. When the right side moves
    // away and the left one approaches, 1 and 5 get shorter and 2 and 6 longer.
    const device::DeviceGeometry geometry = device::built_in_geometry("SpidarG6X4");
    const auto rotation_of = [](const StringArray& lengths, const device::DeviceGeometry& solved) {
        PoseSolver solver(solved);
        PoseEstimate estimate;
        for (int update = 0; update < 3; ++update) {
            estimate = solver.solve(lengths);
        }
        return estimate.pose.orientation.y;
    };
    const StringArray level = string_lengths(geometry, {});
    const StringArray turned = string_lengths(geometry, {{}, Quat(std::cos(0.1), 0.0, std::sin(0.1), 0.0)});
    EXPECT_LT(turned[1], level[1]);
    EXPECT_LT(turned[5], level[5]);
    EXPECT_GT(turned[2], level[2]);
    EXPECT_GT(turned[6], level[6]);
    EXPECT_NEAR(rotation_of(turned, geometry), std::sin(0.1), 1e-9);
    // Mistaking the lists' z axis, which points away, for one towards the user reverses the rotation.
    std::string text(device::built_in_geometry_text("SpidarG6X4"));
    text.replace(text.find("\"away\""), 6, "\"toward\"");
    EXPECT_NEAR(rotation_of(turned, device::parse_device_geometry(text, "mirrored")), -std::sin(0.1), 1e-9);
}

TEST(PoseSolver, StepOf25DegreesAnd27MillimetresIsFoundWithinThreeUpdates) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    RandomPlacements random(4);
    double widest = 0.0;
    double furthest = 0.0;
    for (int k = 0; k < 2000; ++k) {
        const Pose pose = random.placement(0.027, 25.0 * kDegree).pose();
        const StringArray lengths = string_lengths(geometry, pose);
        PoseSolver solver(geometry);
        PoseEstimate estimate;
        for (int update = 0; update < 3; ++update) {
            estimate = solver.solve(lengths);
            ASSERT_EQ(estimate.status, PoseStatus::Ok);
        }
        widest = std::max(widest, angle_between(estimate.pose.orientation, pose.orientation));
        furthest = std::max(furthest, glm::length(estimate.pose.position - pose.position));
        EXPECT_LT(estimate.residual, 1e-12);
    }
    EXPECT_LT(widest, 0.05 * kDegree);
    EXPECT_LT(furthest, 0.02e-3);
}

constexpr const char* kSixDegreesOfFreedom[] = {"SpidarG6X3R", "SpidarG6X3L", "SpidarG6X3F", "SpidarG6X4",
                                                "SpidarG6X5R", "SpidarG6X5L", "SpidarG6T1"};

TEST(PoseSolver, AStepIsFoundWithinThreeUpdatesOnEveryDevice) {
    for (const char* name : kSixDegreesOfFreedom) {
        const device::DeviceGeometry geometry = device::built_in_geometry(name);
        RandomPlacements random(4);
        double widest = 0.0;
        double furthest = 0.0;
        for (int k = 0; k < 1000; ++k) {
            const Pose pose = random.placement(0.027, 25.0 * kDegree).pose();
            const StringArray lengths = string_lengths(geometry, pose);
            PoseSolver solver(geometry);
            PoseEstimate estimate;
            for (int update = 0; update < 3; ++update) {
                estimate = solver.solve(lengths);
                ASSERT_EQ(estimate.status, PoseStatus::Ok) << name;
            }
            widest = std::max(widest, angle_between(estimate.pose.orientation, pose.orientation));
            furthest = std::max(furthest, glm::length(estimate.pose.position - pose.position));
        }
        EXPECT_LT(widest, 0.05 * kDegree) << name;
        EXPECT_LT(furthest, 0.02e-3) << name;
    }
}

/// Diagonal of (A^T A)^-1, by Gauss-Jordan elimination.
Vec6 inverse_diagonal(const WireMatrix& wires) {
    std::array<std::array<double, 12>, 6> rows{};
    for (std::size_t j = 0; j < 6; ++j) {
        for (std::size_t k = 0; k < 6; ++k) {
            for (const Vec6& wire : wires) {
                rows[j][k] += wire[j] * wire[k];
            }
        }
        rows[j][6 + j] = 1.0;
    }
    for (std::size_t pivot = 0; pivot < 6; ++pivot) {
        const double value = rows[pivot][pivot];
        for (double& entry : rows[pivot]) {
            entry /= value;
        }
        for (std::size_t row = 0; row < 6; ++row) {
            const double factor = rows[row][pivot];
            for (std::size_t k = 0; row != pivot && k < 12; ++k) {
                rows[row][k] -= factor * rows[pivot][k];
            }
        }
    }
    Vec6 diagonal{};
    for (std::size_t j = 0; j < 6; ++j) {
        diagonal[j] = rows[j][6 + j];
    }
    return diagonal;
}

/// Standard deviation of the solved pose (m, rad) from lengths that are rounded to whole counts, near the centre.
Vec6 noise_of(const device::DeviceGeometry& geometry, int samples) {
    const double count = std::fabs(geometry.strings[0].metres_per_count);
    RandomPlacements random(5);
    PoseSolver solver(geometry);
    Vec6 squares{};
    for (int k = 0; k < samples; ++k) {
        // Far enough apart for the eight rounding errors to be independent.
        const Pose pose = random.placement(random.uniform(0.0, 1e-3), random.uniform(0.0, 0.02)).pose();
        StringArray lengths = string_lengths(geometry, pose);
        for (double& length : lengths) {
            length = std::round(length / count) * count;
        }
        const PoseEstimate estimate = solver.solve(lengths);
        EXPECT_EQ(estimate.status, PoseStatus::Ok);
        const Vec3 moved = estimate.pose.position - pose.position;
        const Quat turned = estimate.pose.orientation * glm::conjugate(pose.orientation);
        const Vec3 turn = 2.0 * Vec3(turned.x, turned.y, turned.z) * (turned.w < 0.0 ? -1.0 : 1.0);
        for (int axis = 0; axis < 3; ++axis) {
            squares[static_cast<std::size_t>(axis)] += moved[axis] * moved[axis];
            squares[static_cast<std::size_t>(axis) + 3] += turn[axis] * turn[axis];
        }
    }
    for (double& square : squares) {
        square = std::sqrt(square / samples);
    }
    return squares;
}

TEST(PoseSolver, NoiseFloorOfEveryDeviceIsThatOfItsEncoders) {
    // Rounding to whole counts gives each length a variance of count^2 / 12, and the least-squares pose a covariance of
    // (A^T A)^-1 times that.
    for (const char* name : kSixDegreesOfFreedom) {
        const device::DeviceGeometry geometry = device::built_in_geometry(name);
        const double count = geometry.strings[0].metres_per_count;
        const Vec6 expected = inverse_diagonal(wire_matrix(geometry, {}));
        const Vec6 noise = noise_of(geometry, 10000);
        for (std::size_t axis = 0; axis < 6; ++axis) {
            // 10,000 samples determine a standard deviation to 0.7 %; poses up to 1 mm and 1 degree off change it a
            // little.
            const double ratio = noise[axis] / std::sqrt(expected[axis] * count * count / 12.0);
            EXPECT_NEAR(ratio, 1.0, 0.04) << name << ", axis " << axis;
        }
    }
}

TEST(PoseSolver, TracksAHandWithoutLag) {
    // 3 cm and half a radian at 3 Hz: 0.57 m/s and 9 rad/s. One update per millisecond must leave no visible lag.
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    PoseSolver solver(geometry);
    double furthest = 0.0;
    double widest = 0.0;
    for (int tick = 0; tick < 2000; ++tick) {
        const double phase = 2.0 * std::numbers::pi * 3.0 * tick * 1e-3;
        const Placement at{{0.03 * std::sin(phase), 0.02 * std::sin(2.0 * phase), 0.02 * std::sin(phase + 1.0)},
                           glm::normalize(Vec3(1.0, std::sin(phase / 7.0), -0.5)),
                           0.5 * std::sin(phase)};
        const PoseEstimate estimate = solver.solve(string_lengths(geometry, at.pose()));
        ASSERT_EQ(estimate.status, PoseStatus::Ok);
        if (tick < 3) {
            continue;  // the hand starts 17 mm away from the solver's start
        }
        furthest = std::max(furthest, glm::length(estimate.pose.position - at.position));
        widest = std::max(widest, angle_between(estimate.pose.orientation, at.pose().orientation));
    }
    // A thousandth of the encoders' resolution (3.5 um, 0.2 mrad).
    EXPECT_LT(furthest, 3.5e-9);
    EXPECT_LT(widest, 0.2e-6);
}

TEST(PoseSolver, NoiseOfQuantisedLengthsAtTheCentreIsThePublishedOne) {
    // Published for the X3R at the centre: 3.3 to 3.5 um and 10 to 12 mdeg, one standard deviation, on the worst axis.
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    const Vec6 noise = noise_of(geometry, 20000);
    const double worst_um = 1e6 * std::max({noise[0], noise[1], noise[2]});
    const double worst_mdeg = 1e3 / kDegree * std::max({noise[3], noise[4], noise[5]});
    EXPECT_GT(worst_um, 3.2);
    EXPECT_LT(worst_um, 3.6);
    EXPECT_GT(worst_mdeg, 9.5);
    EXPECT_LT(worst_mdeg, 13.0);
    RecordProperty("worst_um", std::to_string(worst_um));
    RecordProperty("worst_mdeg", std::to_string(worst_mdeg));
}

TEST(PoseSolver, ResidualShowsALengthThatContradictsTheOthers) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    StringArray lengths = string_lengths(geometry, {});
    PoseSolver solver(geometry);
    EXPECT_LT(solver.solve(lengths).residual, 1e-15);
    lengths[2] += 0.005;
    // Two of eight dimensions are redundant: a fault of one string shows by its component in them.
    EXPECT_GT(solver.solve(lengths).residual, 0.1 * 0.005 / std::sqrt(8.0));
}

TEST(PoseSolver, KeepsTheLastPoseForLengthsThatAreNotFinite) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    const Pose pose = Placement{{0.01, 0.0, -0.01}, {0.0, 1.0, 0.0}, 0.3}.pose();
    const StringArray good = string_lengths(geometry, pose);
    PoseSolver solver(geometry);
    solver.solve(good);
    const Pose before = solver.solve(good).pose;
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
        StringArray lengths = good;
        lengths[5] = bad;
        const PoseEstimate estimate = solver.solve(lengths);
        EXPECT_EQ(estimate.status, PoseStatus::NonFinite);
        EXPECT_EQ(estimate.pose.position, before.position);
        EXPECT_EQ(estimate.pose.orientation, before.orientation);
    }
    EXPECT_EQ(solver.solve(good).status, PoseStatus::Ok);
}

TEST(PoseSolver, ReportsWhereTheStringsDoNotDetermineThePose) {
    // All strings tied to one point: the grip rotates freely about it.
    device::DeviceGeometry geometry = device::spidar_g6_x3r();
    for (device::StringFacts& string : geometry.strings) {
        string.grip = {0.0, 0.0225, 0.0};
    }
    PoseSolver solver(geometry);
    const Pose start = Placement{{0.001, 0.002, 0.003}, {0.0, 0.0, 1.0}, 0.1}.pose();
    solver.reset(start);
    const PoseEstimate estimate = solver.solve(string_lengths(geometry, {}));
    EXPECT_EQ(estimate.status, PoseStatus::RankDeficient);
    EXPECT_EQ(estimate.pose.position, start.position);
    EXPECT_LT(angle_between(estimate.pose.orientation, start.orientation), 1e-15);
}

TEST(PoseSolver, StaysFiniteAndNormalisedForAnyInputAndRecovers) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    RandomPlacements random(6);
    const double magnitudes[] = {0.0, 1e-300, 1e-3, 0.1, 1.0, 1e3, 1e100, 1e200, 1e308};
    PoseSolver solver(geometry);
    for (int k = 0; k < 20000; ++k) {
        StringArray lengths{};
        for (double& length : lengths) {
            length = random.uniform(-1.0, 1.0) * magnitudes[static_cast<std::size_t>(random.uniform(0.0, 9.0))];
        }
        const PoseEstimate& estimate = solver.solve(lengths);
        const Pose& pose = estimate.pose;
        ASSERT_TRUE(std::isfinite(pose.position.x) && std::isfinite(pose.position.y) &&
                    std::isfinite(pose.position.z) && std::isfinite(estimate.residual));
        ASSERT_NEAR(glm::length(pose.orientation), 1.0, 1e-14);
        ASSERT_LE(glm::length(pose.position), 0.1140);  // distance of the motors
    }
    // After a reset the hand is found again.
    solver.reset({});
    const Pose pose = Placement{{0.01, 0.0, -0.01}, {0.0, 1.0, 0.0}, 0.3}.pose();
    PoseEstimate estimate;
    for (int update = 0; update < 3; ++update) {
        estimate = solver.solve(string_lengths(geometry, pose));
    }
    EXPECT_LT(glm::length(estimate.pose.position - pose.position), 1e-9);
}

TEST(PoseSolver, AStringOfZeroLengthIsIgnored) {
    // Seven strings still determine the pose.
    device::DeviceGeometry geometry = device::spidar_g6_x3r();
    geometry.strings[3].motor = geometry.strings[3].grip;
    PoseSolver solver(geometry);
    const PoseEstimate estimate = solver.solve(string_lengths(geometry, {}));
    EXPECT_EQ(estimate.status, PoseStatus::Ok);
    EXPECT_LT(glm::length(estimate.pose.position), 1e-12);
    EXPECT_LT(estimate.residual, 1e-12);
}

TEST(PoseSolver, OrientationStaysUnitOverManyUpdates) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    PoseSolver solver(geometry);
    const StringArray a = string_lengths(geometry, Placement{{0.01, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.2}.pose());
    const StringArray b = string_lengths(geometry, Placement{{0.0, 0.01, 0.0}, {1.0, 0.0, 0.0}, 0.2}.pose());
    for (int k = 0; k < 100000; ++k) {
        solver.solve(a);
        solver.solve(b);
    }
    EXPECT_NEAR(glm::length(solver.solve(a).pose.orientation), 1.0, 1e-15);
}

TEST(PoseSolver, ResetReplacesAnInvalidPoseByTheCentre) {
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    PoseSolver solver(geometry);
    const StringArray level = string_lengths(geometry, {});
    for (const Pose& bad : {Pose{{kNaN, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}}, Pose{{}, {0.0, 0.0, 0.0, 0.0}},
                            Pose{{}, {kInfinity, 0.0, 0.0, 0.0}}, Pose{{1e300, 1e300, 0.0}, {1.0, 0.0, 0.0, 0.0}}}) {
        solver.reset(bad);
        const PoseEstimate estimate = solver.solve(level);
        EXPECT_EQ(estimate.status, PoseStatus::Ok);
        EXPECT_LT(glm::length(estimate.pose.position), 0.114);
    }
    EXPECT_LT(glm::length(solver.solve(level).pose.position), 1e-9);
}

TEST(PoseSolver, RejectsADeviceWithoutGeometry) {
    EXPECT_THROW(PoseSolver{device::DeviceGeometry{}}, std::invalid_argument);
}

}  // namespace
}  // namespace haptic::rt
