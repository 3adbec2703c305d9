#include "device/geometry_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <random>
#include <stdexcept>

#include "haptic/csv.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr int kValues = 56;

/// A device as built: the nominal geometry with errors drawn from the priors.
device::DeviceGeometry built(const device::DeviceGeometry& nominal, const FitSettings& priors, std::mt19937& random) {
    std::normal_distribution<double> normal;
    device::DeviceGeometry geometry = nominal;
    for (device::StringFacts& string : geometry.strings) {
        for (int k = 0; k < 3; ++k) {
            string.motor[k] += priors.motor * normal(random);
            string.grip[k] += priors.knot * normal(random);
        }
        string.metres_per_count *= 1.0 + priors.scale * normal(random);
    }
    return geometry;
}

/// A hand that moves the grip by about +-2 cm and +-25 degrees, starting slightly off the centre.
PoseTrack wiggling_hand(std::mt19937& random, double size = 1.0) {
    std::normal_distribution<double> normal;
    Vec3 begin(0.0);
    for (int k = 0; k < 3; ++k) {  // separate statements: the evaluation order of arguments is unspecified
        begin[k] = 5e-4 * normal(random);
    }
    std::uniform_real_distribution<double> frequency(0.3, 1.7);
    std::uniform_real_distribution<double> phase(0.0, 6.28);
    std::array<double, 18> f{};
    std::array<double, 18> at{};
    for (std::size_t i = 0; i < f.size(); ++i) {
        f[i] = 6.28 * frequency(random);
        at[i] = phase(random);
    }
    std::vector<double> times;
    std::vector<Pose> poses;
    for (int i = 0; i <= 2000; ++i) {
        const double t = i * 0.01;
        const double ease = size * std::min(1.0, t);
        const auto wave = [&](std::size_t axis) {
            double sum = 0.0;
            for (std::size_t k = 3 * axis; k < 3 * axis + 3; ++k) {
                sum += std::sin(f[k] * t + at[k]) / 1.7;
            }
            return sum;
        };
        const Vec3 turn = 0.4 * ease * Vec3(wave(3), wave(4), wave(5));
        const double angle = glm::length(turn);
        poses.push_back({begin + 0.018 * ease * Vec3(wave(0), wave(1), wave(2)),
                         angle > 0.0 ? glm::angleAxis(angle, turn / angle) : Quat(1, 0, 0, 0)});
        times.push_back(t);
    }
    return {std::move(times), std::move(poses)};
}

/// Counts that the board of the emulated device gives every 5 ms.
Wiggle counted(const device::DeviceGeometry& geometry, const PoseTrack& hand) {
    device::EmulatedDevice device({.geometry = geometry, .hand = hand});
    Wiggle wiggle;
    std::array<std::uint32_t, kStrings> last{};
    for (std::int64_t t = 0; t < nanoseconds(20.0); t += 5'000'000) {
        device.advance(t);
        const std::array<std::uint32_t, kStrings> counters = device.counters();
        StringCounts counts{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            const auto step = static_cast<std::int16_t>(static_cast<std::uint16_t>(counters[i] - last[i]));
            counts[i] = wiggle.empty() ? 0 : wiggle.back()[i] + step;
        }
        last = counters;
        wiggle.push_back(counts);
    }
    return wiggle;
}

FitSettings quick() {
    FitSettings settings;
    settings.max_samples = 500;
    return settings;
}

/// True minus nominal, in the order of GeometryFit::values.
std::vector<double> differences(const device::DeviceGeometry& geometry, const device::DeviceGeometry& nominal) {
    std::vector<double> result;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const device::StringFacts& is = geometry.strings[i];
        const device::StringFacts& was = nominal.strings[i];
        for (int k = 0; k < 3; ++k) {
            result.push_back(is.motor[k] - was.motor[k]);
        }
        for (int k = 0; k < 3; ++k) {
            result.push_back(is.grip[k] - was.grip[k]);
        }
        result.push_back(is.metres_per_count / was.metres_per_count - 1.0);
    }
    return result;
}

TEST(GeometryFit, FindsTheDeviceAsBuiltWithRealisticDeviations) {
    const FitSettings settings = quick();
    const device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X3R");
    constexpr int kSeeds = 12;
    double all_square = 0.0;
    double determined_square = 0.0;
    int determined = 0;
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
        std::mt19937 random(seed);
        const device::DeviceGeometry truth = built(nominal, settings, random);
        const GeometryFit fit = fit_geometry(nominal, counted(truth, wiggling_hand(random)), settings);
        ASSERT_TRUE(fit.converged);
        ASSERT_EQ(fit.values.size(), static_cast<std::size_t>(kValues));
        const double rounding = std::fabs(nominal.strings[0].metres_per_count) / std::sqrt(12.0);
        EXPECT_GT(fit.rms_before, 10.0 * rounding) << "m, seed " << seed;
        EXPECT_NEAR(fit.rms_after, rounding, 0.15 * rounding) << "m: the rounding to counts, seed " << seed;

        // Remaining errors, in units of the standard deviations that the fit reports.
        const std::vector<double> real = differences(truth, nominal);
        const std::vector<double> found = differences(fit.geometry, nominal);
        double before = 0.0;
        double after = 0.0;
        for (int i = 0; i < kValues; ++i) {
            const FittedValue& value = fit.values[static_cast<std::size_t>(i)];
            const double error = found[static_cast<std::size_t>(i)] - real[static_cast<std::size_t>(i)];
            EXPECT_NEAR(value.change, found[static_cast<std::size_t>(i)], 1e-12) << value.name;
            EXPECT_LE(value.deviation, value.prior * (1.0 + 1e-9)) << value.name;
            before += std::pow(real[static_cast<std::size_t>(i)] / value.prior, 2);
            after += std::pow(error / value.prior, 2);
            all_square += std::pow(error / value.deviation, 2);
            if (value.determined()) {
                ++determined;
                determined_square += std::pow(error / value.deviation, 2);
            }
        }
        EXPECT_LT(after, 0.75 * before) << "the fit is hardly closer to the truth than the nominal geometry, seed "
                                        << seed;
    }
    // Mean of squares of standard normal values. Those of one fit are correlated; counted as half as many, the standard
    // deviation of the mean of 12 x 56 is 0.08.
    EXPECT_NEAR(all_square / (kSeeds * kValues), 1.0, 0.3);
    ASSERT_GT(determined, 200) << "of 672";
    EXPECT_NEAR(determined_square / determined, 1.0, 0.5);
}

TEST(GeometryFit, LeavesACorrectGeometryUnchanged) {
    std::mt19937 random(3);
    const device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X4");
    const GeometryFit fit = fit_geometry(nominal, counted(nominal, wiggling_hand(random)), quick());
    for (const FittedValue& value : fit.values) {
        EXPECT_LT(std::fabs(value.change), 3.5 * value.deviation) << value.name;
    }
}

TEST(GeometryFit, IsRobustAgainstAFewOutliers) {
    std::mt19937 random(8);
    const FitSettings settings;
    const device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X3R");
    const device::DeviceGeometry truth = built(nominal, settings, random);
    Wiggle wiggle = thinned(counted(truth, wiggling_hand(random)), quick().max_samples);
    const GeometryFit clean = fit_geometry(nominal, wiggle, quick());
    std::size_t spoilt = 0;
    for (std::size_t k = 50; k < wiggle.size(); k += 50) {
        wiggle[k][spoilt++ % kStrings] += 60;  // a millimetre
    }
    const GeometryFit fit = fit_geometry(nominal, wiggle, quick());
    EXPECT_GE(fit.outliers, clean.outliers + spoilt);
    for (std::size_t i = 0; i < fit.values.size(); ++i) {
        EXPECT_NEAR(fit.values[i].change, clean.values[i].change, 4.0 * fit.values[i].deviation) << fit.values[i].name;
    }
    EXPECT_LT(fit.noise, 2.0 * clean.noise);
}

TEST(GeometryFit, ReportsWhatASmallWiggleDoesNotDetermine) {
    std::mt19937 random(4);
    const FitSettings settings;
    const device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X3R");
    const device::DeviceGeometry truth = built(nominal, settings, random);
    const GeometryFit wide = fit_geometry(nominal, counted(truth, wiggling_hand(random)), quick());
    const GeometryFit small = fit_geometry(nominal, counted(truth, wiggling_hand(random, 0.1)), quick());
    const auto determined = [](const GeometryFit& fit) {
        return std::count_if(fit.values.begin(), fit.values.end(),
                             [](const auto& value) { return value.determined(); });
    };
    EXPECT_GT(determined(wide), determined(small));
    EXPECT_THAT(describe(small), HasSubstr("not determined by the wiggle"));
}

TEST(GeometryFit, RejectsAGripThatWasNotMoved) {
    const device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X3R");
    const auto message = [&nominal](const Wiggle& wiggle) {
        try {
            static_cast<void>(fit_geometry(nominal, wiggle));
        } catch (const std::invalid_argument& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_THAT(message(Wiggle(10)), HasSubstr("at least 50 samples, but there are 10"));
    EXPECT_THAT(message(Wiggle(1000)), AllOf(HasSubstr("0.0"), HasSubstr("rotate it about all three axes")));
}

TEST(Thinned, SpacesSamplesByMovementAndKeepsAtMostTheWantedNumber) {
    std::mt19937 random(2);
    const Wiggle wiggle = counted(device::built_in_geometry("SpidarG6X3R"), wiggling_hand(random));
    const Wiggle few = thinned(wiggle, 300);
    EXPECT_LE(few.size(), 300u);
    EXPECT_GT(few.size(), 200u);
    EXPECT_EQ(thinned(Wiggle(1000), 300).size(), 1u) << "a resting grip is one sample";
    EXPECT_EQ(thinned(few, 300), few);
}

TEST(LoadWiggle, UnwrapsCountersFromTheCalibrationOn) {
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("haptic-wiggle-" + std::to_string(getpid()) + ".csv");
    std::ofstream(file) << "safety_state,counter0,counter1,counter2,counter3,counter4,counter5,counter6,counter7\n"
                           "2,7,0,0,0,0,0,0,0\n"
                           "3,65530,5,0,0,0,0,0,100\n"
                           "3,3,65533,0,0,0,0,0,90\n"
                           "4,3,65533,0,0,0,0,0,0\n"
                           "3,0,0,0,0,0,0,0,0\n";
    const Wiggle wiggle = load_wiggle(file, device::built_in_geometry("SpidarG6X3R"));
    EXPECT_EQ(wiggle, (Wiggle{StringCounts{}, StringCounts{9, -8, 0, 0, 0, 0, 0, -10}}));
    std::ofstream(file) << "safety_state,counter0,counter1,counter2,counter3,counter4,counter5,counter6,counter7\n"
                           "2,7,0,0,0,0,0,0,0\n";
    EXPECT_THROW(static_cast<void>(load_wiggle(file, device::built_in_geometry("SpidarG6X3R"))), CsvError);
    std::ofstream(file) << "time_s,x_m\n";
    EXPECT_THROW(static_cast<void>(load_wiggle(file, device::built_in_geometry("SpidarG6X3R"))), CsvError);
    std::filesystem::remove(file);
}

}  // namespace
}  // namespace haptic::rt
