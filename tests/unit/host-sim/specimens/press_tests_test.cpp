// A sphere pressed into a layer: force over depth against the theory of elasticity, whatever the step.
#include "specimens/press_tests.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace haptic::sim {
namespace {

constexpr std::array kDepths{0.001, 0.0015, 0.002, 0.0025};  // m
// Error of the particles in space: waves of the size of a few particles are too soft, and the contact has many such
// waves. Measured with 1000 particles, over the depths: 0.83 to 0.88 of the force.
constexpr double kSoftest = 0.80;
// Of the exponent over depth, 1.5 on a half-space: small contacts have more of that error. Measured: 1.56.
constexpr double kExponent = 0.08;
// Between steps nothing but the remaining motion may differ.
constexpr double kOverPressSteps = 2e-3;

PressTest gel_layer(std::size_t particles) {
    PressTest test;
    test.contact.material = {.young_modulus = 3e4, .poisson_ratio = 0.45, .density = 1000.0};
    test.particles = particles;
    return test;
}

double relative(const PressTest& test, const PressMeasured& measured) {
    return measured.force / layer_force(test.contact, measured.depth);
}

TEST(PressTests, TheForceIsThatOfABondedLayer) {
    const PressTest test = gel_layer(1000);
    const std::vector<PressMeasured> measured = measure_press(test, kDepths);
    ASSERT_EQ(measured.size(), kDepths.size());
    for (const PressMeasured& m : measured) {
        EXPECT_TRUE(m.at_rest) << m.depth;
        EXPECT_GT(relative(test, m), kSoftest) << m.depth << " m";
        EXPECT_LT(relative(test, m), 1.0) << m.depth << " m";
    }
    // Without the layer's part the exponent is that of Hertz, 3/2.
    const double exponent = 1.5 + std::log(relative(test, measured.back()) / relative(test, measured.front())) /
                                      std::log(kDepths.back() / kDepths.front());
    EXPECT_NEAR(exponent, 1.5, kExponent);
    // More particles resolve the contact better.
    const PressTest coarse = gel_layer(300);
    const double coarse_modulus = fitted_modulus(coarse, measure_press(coarse, kDepths));
    EXPECT_GT(fitted_modulus(test, measured), 1.02 * coarse_modulus);
    EXPECT_GT(fitted_modulus(test, measured), 0.85 * test.contact.material.young_modulus);
}

TEST(PressTests, AMaterialOfLowPoissonRatioIsNearer) {
    PressTest test = gel_layer(300);
    const double rubber = fitted_modulus(test, measure_press(test, kDepths));
    test.contact.material.poisson_ratio = 0.0;
    EXPECT_GT(fitted_modulus(test, measure_press(test, kDepths)), rubber);
}

TEST(PressTests, TheModulusIsTheSameForAllSteps) {
    PressTest test = gel_layer(300);
    const double reference = fitted_modulus(test, measure_press(test, kDepths));
    // One sub-step of 10 ms is longer than any that is chosen.
    test.substeps = 1;
    for (const double step : {0.001, 0.01}) {
        test.step = step;
        EXPECT_NEAR(fitted_modulus(test, measure_press(test, kDepths)), reference, kOverPressSteps * reference) << step;
    }
}

TEST(PressTests, TheForceIsTheSameAfterAGreaterDepth) {
    // At rest contact has no memory: no friction, no damping.
    const PressTest test = gel_layer(300);
    const std::vector<PressMeasured> measured = measure_press(test, std::array{0.0015, 0.0025, 0.0015});
    EXPECT_NEAR(measured[2].force, measured[0].force, kOverPressSteps * measured[0].force);
    EXPECT_EQ(measured[2].touching, measured[0].touching);
}

TEST(PressTests, AForceIsInNewtons) {
    // Scaled in stress and density alike the layer moves in the same way.
    PressTest test = gel_layer(200);
    const double soft = measure_press(test, std::array{0.002}).front().force;
    test.contact.material.young_modulus *= 4.0;
    test.contact.material.density *= 4.0;
    EXPECT_NEAR(measure_press(test, std::array{0.002}).front().force, 4.0 * soft, 1e-6 * soft);
}

TEST(PressTests, RefusesWhatItCannotPress) {
    EXPECT_THROW(static_cast<void>(measure_press(gel_layer(200), {})), std::invalid_argument);
    EXPECT_THROW(static_cast<void>(measure_press(gel_layer(200), std::array{0.001, 0.0})), std::invalid_argument);
    // A sphere as wide as the block touches more vertices than a contact problem has rows.
    PressTest wide = gel_layer(400);
    wide.contact.radius = 2.0;
    EXPECT_THROW(static_cast<void>(measure_press(wide, std::array{0.003})), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
