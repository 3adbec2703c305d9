// Virtual tests of sheets: stiffness against stretching and bending, and drape.
#include "specimens/sheet_tests.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace haptic::sim {
namespace {

constexpr SheetMaterial kCloth{.membrane_stiffness = 1000.0,
                               .bending_stiffness = 1e-5,
                               .poisson_ratio = 0.3,
                               .areal_density = 0.15,
                               .damping = 0.002};

TEST(SheetTests, ASquareStretchesByItsMembraneStiffness) {
    // The strain is uniform, which triangles represent exactly; 1e-3 is the geometry of a finite strain.
    for (const double poisson : {0.0, 0.3, 0.48}) {
        SheetTest test{.material = kCloth, .vertices_per_side = 17};
        test.material.poisson_ratio = poisson;
        const SheetMeasured measured = measure_membrane(test);
        EXPECT_TRUE(measured.at_rest);
        EXPECT_NEAR(measured.value, kCloth.membrane_stiffness, 1e-3 * kCloth.membrane_stiffness);
        EXPECT_NEAR(measured.poisson_ratio, poisson, 1e-3);
        EXPECT_NEAR(measured.areal_density, kCloth.areal_density, 1e-9);
    }
}

TEST(SheetTests, AStripSagsByItsBendingStiffness) {
    // Hinges of a grid with alternating diagonals yield more than a plate: 0.81 of the stiffness is measured.
    for (const double stiffness : {1e-6, 1e-5, 1e-4}) {
        SheetTest test{.material = kCloth};
        test.material.bending_stiffness = stiffness;
        const SheetMeasured measured = measure_sheet_bending(test);
        EXPECT_TRUE(measured.at_rest) << stiffness;
        EXPECT_NEAR(measured.value, 0.9 * stiffness, 0.12 * stiffness);
    }
}

TEST(SheetTests, StepsDoNotChangeTheBendingStiffness) {
    SheetTest test{.material = kCloth};
    const double reference = measure_sheet_bending(test).value;
    for (const double step : {0.001, 0.02}) {
        test.step = step;
        EXPECT_NEAR(measure_sheet_bending(test).value, reference, 5e-3 * reference) << step;
    }
}

TEST(SheetTests, AShadowIsTheAreaSeenFromAbove) {
    const TriangleMesh square{.vertices = {{0.0, 0.0, 0.0}, {0.2, 0.3, 0.0}, {0.2, -0.1, 0.1}, {0.0, 0.0, 0.1}},
                              .triangles = {{0, 1, 2}, {0, 2, 3}, {0, 2, 1}},
                              .closed = false,
                              .double_faced = false};
    EXPECT_NEAR(shadow_area(square), 0.02, 1e-4);  // cells of 0.25 mm along an edge of 0.6 m
}

TEST(SheetTests, LimpSheetsDrapeMoreThanStiffOnes) {
    SheetTest test{.material = kCloth};
    test.material.bending_stiffness = 1e-6;
    const Drape limp = measure_drape(test);
    test.material.bending_stiffness = 1e-3;
    const Drape stiff = measure_drape(test);
    EXPECT_TRUE(limp.at_rest);
    EXPECT_TRUE(stiff.at_rest);
    EXPECT_GT(limp.coefficient, 0.1);
    EXPECT_LT(limp.coefficient, 0.6);
    EXPECT_GE(limp.folds, 4);
    EXPECT_GT(stiff.coefficient, 0.9);
    EXPECT_LT(stiff.coefficient, 1.0);
    // The support's edge stays where it is.
    for (const Vec3& p : limp.mesh.vertices) {
        if (std::hypot(p.x, p.z) < 0.5 * Drape::kSupport) {
            EXPECT_EQ(p.y, 0.0);
        }
        EXPECT_GT(p.y, -(Drape::kDisc - Drape::kSupport) * 1.1);
    }
}

TEST(SheetTests, CottonDrapesAsPublishedAndSilkMore) {
    const auto drape_of = [](const char* name) {
        const Drape drape = measure_drape({.material = find_material(name).sheet});
        EXPECT_TRUE(drape.at_rest) << name;
        EXPECT_GE(drape.folds, 6) << name;
        EXPECT_LE(drape.folds, 10) << name;
        return drape.coefficient;
    };
    // @source Analysis of a fabric drape profile, Fibres and Textiles 1/2018: plain weaves of cotton, 48 to 72 %.
    const double cotton = drape_of("cotton");
    EXPECT_GE(cotton, 0.48);
    EXPECT_LE(cotton, 0.72);
    EXPECT_LE(drape_of("silk"), cotton - 0.03);
}

TEST(SheetTests, RefuseWhatTheyCannotMeasure) {
    SheetTest test{.material = kCloth};
    test.material.bending_stiffness = 0.0;
    EXPECT_THROW((void)measure_sheet_bending(test), std::invalid_argument);
    EXPECT_THROW((void)measure_membrane({.material = kCloth, .vertices_per_side = 5}), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
