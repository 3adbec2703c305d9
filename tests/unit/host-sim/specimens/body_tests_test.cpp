// Homogeneous stress on bodies of any shape: the loads balance and do the work of the stress, and the moduli come near
// those asked for as the particles become more.
#include "specimens/body_tests.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <vector>

#include "haptic/sim/model_settings.hpp"

namespace haptic::sim {
namespace {

constexpr SolidMaterial kFlesh{.young_modulus = 2e4, .poisson_ratio = 0.4, .density = 1050.0};

DeformableBody body_of(Generator generator, std::size_t particles) {
    ModelSettings settings;
    settings.generator = generator;
    settings.builder.particles = particles;
    settings.builder.neighbours = 16;
    settings.material = MaterialSettings{.name = "",
                                         .young_modulus = kFlesh.young_modulus,
                                         .poisson_ratio = kFlesh.poisson_ratio,
                                         .density = kFlesh.density,
                                         .membrane_stiffness = {},
                                         .bending_stiffness = {},
                                         .areal_density = {},
                                         .damping = {}};
    return make_body(settings);
}

TEST(BodyTests, LoadsBalanceAndDoTheWorkOfTheStress) {
    const Mat3 stress(Vec3(3.0, 1.0, -2.0), Vec3(1.0, -1.0, 0.5), Vec3(-2.0, 0.5, 2.0));
    for (const Generator generator : {Generator::Block, Generator::Fish, Generator::Organ}) {
        const DeformableBody body = body_of(generator, 150);
        const BodyTests tests(body, kFlesh, {});
        const std::vector<Vec3> force = tests.forces_of(stress, Mat3(0.0));
        // Their sum and their moment are 0.
        Vec3 sum(0.0);
        Vec3 moment(0.0);
        Mat3 virial(0.0);
        for (std::size_t i = 0; i < force.size(); ++i) {
            const Vec3& x = body.particles.rest_position[i];
            sum += force[i];
            moment += glm::cross(x, force[i]);
            virial += glm::outerProduct(force[i], x);
        }
        const double scale = 3.0 * tests.volume();  // N m
        EXPECT_LT(glm::length(sum), 1e-6 * scale / tests.length_along_axes().x) << body.name;
        EXPECT_LT(glm::length(moment), 1e-3 * scale) << body.name;  // gradients of fins are hardly determined
        // Without flat elements sum f x^T is the stress times the volume.
        for (int k = 0; k < 3 && generator != Generator::Fish; ++k) {
            EXPECT_LT(glm::length(virial[k] - tests.volume() * stress[k]), 1e-4 * scale) << body.name << ' ' << k;
        }
    }
}

TEST(BodyTests, BodiesOfAnyShapeHaveTheModuliAskedFor) {
    for (const Generator generator : {Generator::Block, Generator::Fish, Generator::Organ}) {
        const BodyTests tests(body_of(generator, 300), kFlesh, {});
        const BodyMeasured stretched = tests.stretch();
        EXPECT_TRUE(stretched.at_rest);
        EXPECT_NEAR(stretched.modulus, kFlesh.young_modulus, 0.03 * kFlesh.young_modulus);
        EXPECT_NEAR(stretched.poisson_ratio, kFlesh.poisson_ratio, 0.02);
        const BodyMeasured sheared = tests.shear();
        EXPECT_TRUE(sheared.at_rest);
        const double shear = kFlesh.young_modulus / (2.0 * (1.0 + kFlesh.poisson_ratio));
        EXPECT_NEAR(sheared.modulus, shear, 0.05 * shear);
        const BodyMeasured bent = tests.bend();
        EXPECT_TRUE(bent.at_rest);
        EXPECT_NEAR(bent.modulus, kFlesh.young_modulus, 0.05 * kFlesh.young_modulus);
    }
}

TEST(BodyTests, ModuliImproveWithMoreParticles) {
    // The bulk modulus suffers most from particles at the surface, which have neighbours on one side only.
    const double bulk = kFlesh.young_modulus / (3.0 * (1.0 - 2.0 * kFlesh.poisson_ratio));
    double stretch_error = 1.0;
    double bulk_error = 1.0;
    for (const std::size_t particles : {137u, 300u, 600u}) {
        const BodyTests tests(body_of(Generator::Block, particles), kFlesh, {});
        const double stretch_now = std::abs(tests.stretch().modulus / kFlesh.young_modulus - 1.0);
        const double bulk_now = std::abs(tests.swell().modulus / bulk - 1.0);
        EXPECT_LT(stretch_now, stretch_error) << particles;
        EXPECT_LT(bulk_now, bulk_error) << particles;
        stretch_error = stretch_now;
        bulk_error = bulk_now;
    }
    EXPECT_LT(stretch_error, 0.01);
    EXPECT_LT(bulk_error, 0.12);
}

TEST(BodyTests, StepsDoNotChangeTheModuli) {
    const DeformableBody body = body_of(Generator::Organ, 150);
    const double reference = BodyTests(body, kFlesh, {}).stretch().modulus;
    EXPECT_NEAR(BodyTests(body, kFlesh, {.step = 0.002, .substeps = 1}).stretch().modulus, reference, 2e-3 * reference);
    EXPECT_NEAR(BodyTests(body, kFlesh, {.step = 0.02, .substeps = 1}).stretch().modulus, reference, 2e-3 * reference);
}

TEST(BodyTests, RefusesASheet) {
    ModelSettings settings;
    settings.generator = Generator::Cloth;
    EXPECT_THROW(BodyTests(make_body(settings), kFlesh, {}), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
