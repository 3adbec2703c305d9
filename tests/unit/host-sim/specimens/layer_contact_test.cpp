// A sphere on a bonded layer: the integral equation against its limits and against published series.
#include "specimens/layer_contact.hpp"

#include <gtest/gtest.h>

namespace haptic::sim {
namespace {

constexpr SolidMaterial kGel{.young_modulus = 3e4, .poisson_ratio = 0.45, .density = 1000.0};

/// Force of the layer by that of the half-space where sqrt(R d) is x times the thickness.
double factor_at(double x, double poisson, double (*force)(const LayerContact&, double)) {
    LayerContact contact{.material = kGel, .thickness = 0.05, .radius = 0.2};
    contact.material.poisson_ratio = poisson;
    const double depth = x * x * contact.thickness * contact.thickness / contact.radius;
    return force(contact, depth) / half_space_force(contact, depth);
}

TEST(LayerContact, AHalfSpaceHasHertzsForce) {
    // 4/3 * 8 kPa / (1 - 0.25) * sqrt(0.01 m * 0.0001 m) * 0.0001 m
    const LayerContact contact{
        .material = {.young_modulus = 8e3, .poisson_ratio = 0.5, .density = 1000.0}, .thickness = 1.0, .radius = 0.01};
    EXPECT_NEAR(half_space_force(contact, 1e-4), 1.422222e-3, 1e-9);
}

TEST(LayerContact, AThickLayerIsAHalfSpace) {
    for (const double poisson : {0.0, 0.3, 0.48}) {
        EXPECT_NEAR(factor_at(1e-4, poisson, layer_force), 1.0, 2e-4) << poisson;
    }
}

TEST(LayerContact, TheSeriesHasThePublishedCoefficients) {
    // Dimitriadis et al. 2002, equation 12, for nu = 0.5; c_4 with the sign of the general equation.
    const auto published = [](double x) {
        return 1.0 + 1.133 * x + 1.283 * x * x + 0.769 * x * x * x - 0.0975 * x * x * x * x;
    };
    for (const double x : {0.1, 0.5, 1.0}) {
        EXPECT_NEAR(factor_at(x, 0.5, layer_series_force), published(x), 1e-3) << x;
    }
}

TEST(LayerContact, TheSolutionBeginsAsTheSeriesOfDimitriadis) {
    // Where x^2 does not count: its part is 1e-4.
    for (const double poisson : {0.3, 0.4, 0.45, 0.5}) {
        EXPECT_NEAR(factor_at(0.01, poisson, layer_force), factor_at(0.01, poisson, layer_series_force), 1e-4);
    }
}

TEST(LayerContact, TheSolutionIsThatOfGarciaForNoChangeOfVolume) {
    // P. D. Garcia, R. Garcia, "Determination of the elastic moduli of a single cell cultured on a rigid support by
    // force microscopy", 2018, which has the terms that the series of Dimitriadis lacks.
    for (const double x : {0.1, 0.2, 0.3, 0.4}) {
        const double published = 1.0 + 1.133 * x + 1.497 * x * x + 1.469 * x * x * x + 0.755 * x * x * x * x;
        EXPECT_NEAR(factor_at(x, 0.5, layer_force), published, 0.005 * published) << x;
    }
}

TEST(LayerContact, TheSeriesIsTooSoftByAFewPercent) {
    const double at_022 = factor_at(0.22, 0.45, layer_series_force) / factor_at(0.22, 0.45, layer_force);
    const double at_035 = factor_at(0.35, 0.45, layer_series_force) / factor_at(0.35, 0.45, layer_force);
    EXPECT_NEAR(at_022, 0.99, 0.003);
    EXPECT_NEAR(at_035, 0.97, 0.003);
}

}  // namespace
}  // namespace haptic::sim
