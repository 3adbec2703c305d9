#include "device/pose_proof.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "haptic/device/device_geometry_file.hpp"
#include "random.hpp"

namespace haptic::rt {
namespace {

using Verdict = PoseProof::Verdict;

/// Movement of a hand: smooth, about the centre, of this amplitude in m and rad.
Pose wandering(double time_s, double position, double angle, const std::array<double, 6>& rates) {
    std::array<double, 6> wave{};
    for (std::size_t i = 0; i < 6; ++i) {
        wave[i] = std::sin(rates[i] * time_s);
    }
    const Vec3 turn = angle * Vec3(wave[3], wave[4], wave[5]);
    const double size = glm::length(turn);
    return {position * Vec3(wave[0], wave[1], wave[2]),
            size > 0.0 ? glm::angleAxis(size, turn / size) : Quat(1.0, 0.0, 0.0, 0.0)};
}

/// How a device differs from its geometry, and where the grip is when the lengths are set.
struct Device {
    device::DeviceGeometry geometry;                                       // true
    Pose start;                                                            // of the grip, at the calibration
    std::array<std::size_t, kStrings> encoder_of{0, 1, 2, 3, 4, 5, 6, 7};  // string that encoder i counts
    StringArray sign{1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
};

struct Outcome {
    Verdict verdict = Verdict::Pending;
    double after_s = 0.0;
    Vec6 offset{};
};

/// Moves the grip for 20 s by up to 15 mm and 9 degrees in each direction.
Outcome move(const device::DeviceGeometry& assumed, const Device& device, std::uint64_t seed) {
    test::Random random(seed);
    std::array<double, 6> rates{};
    for (double& rate : rates) {
        rate = random.uniform(1.0, 4.0);
    }
    PoseSolver solver(assumed);
    PoseProof proof(assumed, {});
    const StringArray at_start = string_lengths(device.geometry, device.start);
    Outcome outcome;
    for (int tick = 0; tick < 2000 && outcome.verdict == Verdict::Pending; ++tick) {
        outcome.after_s = 0.01 * tick;
        const Pose motion = wandering(outcome.after_s, 0.015, 0.16, rates);
        const StringArray now = string_lengths(
            device.geometry, {device.start.position + motion.position, motion.orientation * device.start.orientation});
        // Counters: rounded lengths of the strings that they count, relative to the start.
        StringArray lengths{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            const double count = std::fabs(assumed.strings[i].metres_per_count);
            const std::size_t counted = device.encoder_of[i];
            const double counts = std::floor((now[counted] - at_start[counted]) / count + 0.5);
            lengths[i] = assumed.rest_length(i) + device.sign[i] * count * counts;
        }
        const PoseEstimate& estimate = solver.solve(lengths);
        outcome.verdict = proof.update(lengths, estimate, wire_matrix(assumed, estimate.pose));
        outcome.offset = proof.offset();
    }
    return outcome;
}

class PoseProofOf : public testing::TestWithParam<const char*> {
  protected:
    device::DeviceGeometry geometry = device::find_device_geometry(GetParam());

    /// A device whose motors and knots are off by about a millimetre.
    Device imperfect(std::uint64_t seed) const {
        test::Random random(seed);
        Device result{geometry, Pose{}};
        for (device::StringFacts& string : result.geometry.strings) {
            string.motor += 0.6e-3 * random.direction();
            string.grip += 0.6e-3 * random.direction();
        }
        return result;
    }
};

TEST_P(PoseProofOf, PassesADeviceThatIsBuiltToAMillimetreAndHeldAtTheCentre) {
    double longest_s = 0.0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        Device device = imperfect(seed);
        test::Random random(seed + 1000);
        device.start = {2e-3 * random.direction(), glm::angleAxis(0.05, random.direction())};
        const Outcome outcome = move(geometry, device, seed);
        EXPECT_EQ(outcome.verdict, Verdict::Passed) << "seed " << seed;
        longest_s = std::max(longest_s, outcome.after_s);
    }
    std::printf("%s: passed after %.1f s at most\n", GetParam(), longest_s);
}

TEST_P(PoseProofOf, RefusesAGripThatWasNotAtTheCentreAndSaysWhereItWas) {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        test::Random random(seed + 2000);
        Device device = imperfect(seed);
        const Vec3 place = 0.02 * random.direction();
        device.start.position = place;
        const Outcome outcome = move(geometry, device, seed);
        EXPECT_EQ(outcome.verdict, Verdict::Refused) << "seed " << seed;
        // The sums are linear in the offset, so one this large is known roughly.
        const Vec3 found(outcome.offset[0], outcome.offset[1], outcome.offset[2]);
        EXPECT_GT(glm::dot(found, place) / glm::length(place), 0.01) << "seed " << seed;
    }
}

TEST_P(PoseProofOf, RefusesAGripThatWasNotLevelAndSaysHowItWasTurned) {
    double along = 0.0;  // rad, mean rotation found about the true axis
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        test::Random random(seed + 3000);
        Device device = imperfect(seed);
        const Vec3 axis = random.direction();
        device.start.orientation = glm::angleAxis(0.5236, axis);
        const Outcome outcome = move(geometry, device, seed);
        EXPECT_EQ(outcome.verdict, Verdict::Refused) << "seed " << seed;
        const Vec3 found(outcome.offset[3], outcome.offset[4], outcome.offset[5]);
        along += glm::dot(found, axis) / 40.0;
    }
    EXPECT_NEAR(along, 0.5236, 0.15) << "the sums are linear in the offset, so one this large is known roughly";
}

TEST_P(PoseProofOf, NeverPassesExchangedStringsOrAnEncoderThatCountsWrong) {
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (std::size_t j = i; j < kStrings; ++j) {
            Device device = imperfect(10 * i + j + 1);
            std::swap(device.encoder_of[i], device.encoder_of[j]);
            device.sign[i] = i == j ? -1.0 : 1.0;
            for (std::uint64_t seed = 1; seed <= 10; ++seed) {
                EXPECT_NE(move(geometry, device, seed).verdict, Verdict::Passed) << i << " and " << j;
            }
        }
    }
}

TEST_P(PoseProofOf, KnowsNothingBeforeTheGripMoves) {
    PoseSolver solver(geometry);
    PoseProof proof(geometry, {});
    const StringArray lengths = string_lengths(geometry, Pose{});
    for (int tick = 0; tick < 1000; ++tick) {
        const PoseEstimate& estimate = solver.solve(lengths);
        EXPECT_EQ(proof.update(lengths, estimate, wire_matrix(geometry, estimate.pose)), Verdict::Pending);
    }
    EXPECT_EQ(proof.samples(), 1u);
    EXPECT_EQ(proof.uncertainty(), 1.0);
}

TEST(PoseProof, RejectsSettingsThatAreNotPositive) {
    EXPECT_THROW(PoseProof(device::spidar_g6_x3r(), {.position = 0.0}), std::invalid_argument);
    EXPECT_THROW(PoseProof(device::spidar_g6_x3r(), {.spacing = -1.0}), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Geometries, PoseProofOf, testing::Values("SpidarG6X3R", "SpidarG6X4"),
                         [](const testing::TestParamInfo<const char*>& param) { return param.param; });

}  // namespace
}  // namespace haptic::rt
