#include "haptic/device/tremor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <vector>

#include "emulated/hand_motion.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kMs;

constexpr TremorSettings kTremor{.position = 2e-4, .rotation = 3e-3, .drift = 1e-3, .drift_rotation = 0.01, .seed = 5};

/// Displacement along x over 100 s, every 5 ms.
std::vector<double> displacements(const TremorSettings& settings) {
    const Tremor tremor(settings);
    std::vector<double> all;
    all.reserve(20'000);
    for (std::int64_t k = 0; k < 20'000; ++k) {
        all.push_back(tremor.applied_to({}, k * 5 * kMs).position.x);
    }
    return all;
}

/// Mean square of the samples' Fourier components from `low` to `high` Hz, in steps of 0.01 Hz (100 s).
double power(const std::vector<double>& samples, double low, double high) {
    double sum = 0.0;
    for (int k = 0; low + 0.01 * k <= high; ++k) {
        const double hertz = low + 0.01 * k;
        std::complex<double> component = 0.0;
        for (std::size_t n = 0; n < samples.size(); ++n) {
            component += samples[n] * std::polar(1.0, -2.0 * M_PI * hertz * 0.005 * static_cast<double>(n));
        }
        sum += 2.0 * std::norm(component / static_cast<double>(samples.size()));
    }
    return sum;
}

TEST(Tremor, LeavesThePoseOfASteadyHandUntouched) {
    const Pose pose{{0.01, 0.02, 0.03}, {0.6, 0.8, 0.0, 0.0}};
    const Pose same = Tremor().applied_to(pose, 123 * kMs);
    EXPECT_EQ(same.position, pose.position);
    EXPECT_EQ(same.orientation, pose.orientation);
}

TEST(Tremor, StaysWithinItsAmplitudesAndComesNearThem) {
    double largest = 0.0;
    for (const double x : displacements(kTremor)) {
        largest = std::max(largest, std::fabs(x));
    }
    EXPECT_LE(largest, 2e-4 + 1e-3);
    EXPECT_GE(largest, 0.7 * (2e-4 + 1e-3));
    const Tremor tremor(kTremor);
    for (std::int64_t k = 0; k < 2000; ++k) {
        const Quat turned = tremor.applied_to({}, k * 5 * kMs).orientation;
        const double angle =
            2.0 * std::asin(std::sqrt(turned.x * turned.x + turned.y * turned.y + turned.z * turned.z));
        EXPECT_LE(angle, std::sqrt(3.0) * (3e-3 + 0.01));
    }
}

TEST(Tremor, HasItsPowerBetweenEightAndTwelveHertz) {
    TremorSettings fast = kTremor;
    fast.drift = 0.0;
    const std::vector<double> samples = displacements(fast);
    double mean_square = 0.0;
    for (const double x : samples) {
        mean_square += x * x / static_cast<double>(samples.size());
    }
    // Three sinusoids of a third of the amplitude each: 3 (a/3)^2 / 2.
    EXPECT_NEAR(mean_square, 2e-4 * 2e-4 / 6.0, 0.02 * 2e-4 * 2e-4);
    EXPECT_GT(power(samples, 7.9, 12.1), 0.95 * mean_square);
}

TEST(Tremor, DiffersBetweenAxesAndSeeds) {
    TremorSettings other = kTremor;
    other.seed = 6;
    const Pose one = Tremor(kTremor).applied_to({}, 500 * kMs);
    EXPECT_NE(one.position.x, one.position.y);
    EXPECT_NE(one.position.x, Tremor(other).applied_to({}, 500 * kMs).position.x);
    EXPECT_EQ(one.position.x, Tremor(kTremor).applied_to({}, 500 * kMs).position.x);
}

TEST(Tremor, GoesOnWhileTheHandWaitsAndWithoutAJumpWhenItReturns) {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    HandMotion hand(PoseTrack({0.0, 1.0}, {{{0.0, 0.0, 0.0}, level}, {{0.02, 0.0, 0.0}, level}}), true, kTremor);
    hand.advance(30 * kMs);
    const double waiting = hand.pose().position.x;
    hand.advance(30 * kMs);
    EXPECT_NE(hand.pose().position.x, waiting);
    hand.release();
    hand.advance(500 * kMs);
    const double before = hand.pose().position.x;
    hand.hold();
    EXPECT_NEAR(hand.pose().position.x, before, 1e-12);
}

}  // namespace
}  // namespace haptic::device
