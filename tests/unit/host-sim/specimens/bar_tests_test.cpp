// Virtual tests of a bar: the moduli that the solver gives a solid are those that were asked for, whatever the step,
// the sub-steps and the number of particles.
#include "specimens/bar_tests.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>

namespace haptic::sim {
namespace {

// Bounds of the discretisation error, relative: groups at the surface reach into the body only, and 500 particles are
// four across the bar.
constexpr double kTension = 0.005;
constexpr double kPoisson = 0.005;  // absolute
constexpr double kBending = 0.07;
constexpr double kTorsion = 0.10;
// Between steps nothing but the remaining motion may differ, which at rest is 1 / 2e4.
constexpr double kOverSteps = 2e-3;

BarTest soft_bar(std::size_t particles) {
    return {.material = {.young_modulus = 3e4, .poisson_ratio = 0.4, .density = 1000.0}, .particles = particles};
}

double shear_modulus_of(const SolidMaterial& material) {
    return material.young_modulus / (2.0 * (1.0 + material.poisson_ratio));
}

class BarOf : public testing::TestWithParam<std::size_t> {};

TEST_P(BarOf, StretchesByItsYoungModulusAndThinsByItsPoissonRatio) {
    for (const double poisson : {0.0, 0.3, 0.45}) {
        BarTest test = soft_bar(GetParam());
        test.material.poisson_ratio = poisson;
        const Measured measured = measure_tension(test);
        EXPECT_TRUE(measured.at_rest);
        EXPECT_NEAR(measured.modulus, test.material.young_modulus, kTension * test.material.young_modulus) << poisson;
        EXPECT_NEAR(measured.poisson_ratio, poisson, kPoisson);
    }
}

TEST_P(BarOf, SagsByItsYoungModulus) {
    const BarTest test = soft_bar(GetParam());
    const Measured measured = measure_bending(test);
    EXPECT_TRUE(measured.at_rest);
    EXPECT_NEAR(measured.modulus, test.material.young_modulus, kBending * test.material.young_modulus);
}

TEST_P(BarOf, TwistsByItsShearModulus) {
    const BarTest test = soft_bar(GetParam());
    const Measured measured = measure_torsion(test);
    EXPECT_TRUE(measured.at_rest);
    EXPECT_NEAR(measured.modulus, shear_modulus_of(test.material), kTorsion * shear_modulus_of(test.material));
}

INSTANTIATE_TEST_SUITE_P(Particles, BarOf, testing::Values(250, 500),
                         [](const auto& bar) { return std::to_string(bar.param); });

TEST(BarTests, AnElasticModulusIsTheSameForAllSteps) {
    for (const double young : {3e4, 1e6}) {
        BarTest test = soft_bar(120);
        test.material.young_modulus = young;
        const double reference = measure_tension(test).modulus;
        for (const double step : {0.001, 0.002, 0.005, 0.02}) {
            test.step = step;
            const Measured measured = measure_tension(test);
            EXPECT_TRUE(measured.at_rest) << young << " Pa, " << step << " s";
            EXPECT_NEAR(measured.modulus, reference, kOverSteps * reference) << young << " Pa, " << step << " s";
        }
    }
}

TEST(BarTests, AnElasticModulusIsTheSameForAllSubSteps) {
    BarTest test = soft_bar(120);
    const double reference = measure_tension(test).modulus;
    for (const int substeps : {1, 8}) {
        test.substeps = substeps;
        for (const double step : {0.001, 0.01, 0.02}) {
            test.step = step;
            const Measured measured = measure_tension(test);
            EXPECT_TRUE(measured.at_rest) << substeps << " sub-steps of " << step << " s";
            EXPECT_NEAR(measured.modulus, reference, kOverSteps * reference) << substeps << " of " << step << " s";
        }
    }
}

TEST(BarTests, BendingAndTorsionAreTheSameForAllSteps) {
    BarTest test = soft_bar(120);
    const double bending = measure_bending(test).modulus;
    const double torsion = measure_torsion(test).modulus;
    test.step = 0.002;
    EXPECT_NEAR(measure_bending(test).modulus, bending, kOverSteps * bending);
    EXPECT_NEAR(measure_torsion(test).modulus, torsion, kOverSteps * torsion);
}

TEST(BarTests, AModulusIsInPascals) {
    // Scaled in stress and density alike the bar moves in the same way.
    BarTest test = soft_bar(120);
    const double soft = measure_tension(test).modulus;
    test.material.young_modulus *= 4.0;
    test.material.density *= 4.0;
    EXPECT_NEAR(measure_tension(test).modulus, 4.0 * soft, 1e-6 * soft);
}

TEST(BarTests, DampingDoesNotChangeTheModulus) {
    BarTest test = soft_bar(120);
    const double elastic = measure_tension(test).modulus;
    test.material.damping = 0.005;
    EXPECT_NEAR(measure_tension(test).modulus, elastic, kOverSteps * elastic);
}

}  // namespace
}  // namespace haptic::sim
