// Loads on regions of a body: forces and pressures, against statics.
#include "model/regions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

constexpr const char* kEverywhere = "low = [-9, -9, -9]\nhigh = [9, 9, 9]\n";
// A bar of 20 mm x 80 mm x 20 mm; its upper end is at y = 40 mm.
constexpr const char* kBar =
    "generator = \"block\"\nsize = [0.02, 0.08, 0.02]\ncells = 16\nparticles_count = 240\nheight = 0.0\n";
constexpr double kBarSection = 4e-4;  // m^2
constexpr double kModulus = 1e5;      // Pa
// Particles are in the middle of their cells, so that the end of 6 mm holds a layer of them.
constexpr const char* kUpperEnd = "[[model.regions]]\nlow = [-9, 0.034, -9]\nhigh = [9, 9, 9]\n";
constexpr const char* kLowerEnd = "[[model.regions]]\nlow = [-9, -9, -9]\nhigh = [9, -0.034, 9]\n";
constexpr const char* kUpperFace = "[[model.regions]]\nlow = [-9, 0.0399, -9]\nhigh = [9, 9, 9]\n";
constexpr const char* kLowerFace = "[[model.regions]]\nlow = [-9, -9, -9]\nhigh = [9, -0.0399, 9]\n";

ModelSettings read_regions(const std::string& model) {
    return read_model(Config::parse("[model]\n" + model, "scene.toml"), "model");
}

DeformableBody body_of(const std::string& model) {
    return make_bodies(read_regions(model)).front();
}

std::string region_refusal(const std::string& model) {
    try {
        (void)body_of(model);
    } catch (const ConfigError& error) {
        return error.what();
    }
    return "";
}

/// N, per particle, of all loads of a body whose particles are at `position`, m.
std::vector<Vec3> forces_at(DeformableBody body, const std::vector<Vec3>& position, double time_s) {
    std::vector<Vec3> force(body.particles.size(), Vec3(0.0));
    for (Load& load : body.loads) {
        add_forces(load, time_s, position, force);
    }
    return force;
}

/// The same of the body at rest.
std::vector<Vec3> forces_on(const DeformableBody& body, double time_s = 0.0) {
    return forces_at(body, body.particles.rest_position, time_s);
}

Vec3 sum_of(const std::vector<Vec3>& forces) {
    Vec3 sum(0.0);
    for (const Vec3& force : forces) {
        sum += force;
    }
    return sum;
}

/// N m, about the origin.
Vec3 moment_of(const DeformableBody& body, const std::vector<Vec3>& forces) {
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < forces.size(); ++i) {
        sum += glm::cross(body.particles.rest_position[i], forces[i]);
    }
    return sum;
}

double magnitudes_of(const std::vector<Vec3>& forces) {
    double sum = 0.0;
    for (const Vec3& force : forces) {
        sum += glm::length(force);
    }
    return sum;
}

/// The scene of a body without weight, whose hand is far away, after so much time.
Simulation settled(const std::string& model, double time_s) {
    Simulation simulation(read_scene(Config::parse("[model]\n" + model +
                                                       "[solver]\nstep = 0.01\ngravity = [0, 0, 0]\ndrag = 5.0\n"
                                                       "[hand]\ntimes = [0.0]\npositions = [2, 2, 2]\n",
                                                   "scene.toml"),
                                     "scene"));
    while (simulation.time() < time_s) {
        (void)simulation.step(simulation.scripted_input(nanoseconds(simulation.time())));
    }
    return simulation;
}

/// Strain along an axis between the vertices near two planes across it, m.
double strain(const Simulation& simulation, int axis, double low, double high) {
    const auto mean_shift = [&](double at) {
        double shift = 0.0;
        double count = 0.0;
        for (std::size_t j = 0; j < simulation.vertices().size(); ++j) {
            const double rest = simulation.mesh().vertices[j][axis];
            if (std::abs(rest - at) < 1e-6) {
                shift += simulation.vertices()[j][axis] - rest;
                count += 1.0;
            }
        }
        EXPECT_GT(count, 3.0);
        return shift / count;
    };
    return (mean_shift(high) - mean_shift(low)) / (high - low);
}

/// Strain along an axis of the affine motion that fits all particles best.
double affine_strain(const Simulation& simulation, int axis) {
    const ParticleModel& model = simulation.model();
    double shift = 0.0;
    double square = 0.0;
    for (std::size_t i = 0; i < model.size(); ++i) {
        const double rest = model.rest_position[i][axis];
        shift += rest * (model.position[i][axis] - rest);
        square += rest * rest;
    }
    return shift / square;
}

std::string material(double poisson_ratio) {
    return "[model.material]\nyoung_modulus = " + std::to_string(kModulus) +
           "\npoisson_ratio = " + std::to_string(poisson_ratio) + "\ndensity = 1000.0\ndamping = 0.02\n";
}

TEST(RegionLoads, AForceIsDividedByMassAmongTheFreeParticles) {
    const DeformableBody body =
        body_of(std::string(kBar) + "orientation = [0, 0, 0, 1]\noffset = [1, 2, 3]\n" + material(0.3) + kUpperEnd +
                "fixed = true\n[[model.regions]]\n" + kEverywhere + "force = [1, -2, 3]\n");
    const std::vector<Vec3> forces = forces_on(body);
    double free_mass = 0.0;
    std::size_t pinned = 0;
    for (std::size_t i = 0; i < forces.size(); ++i) {
        free_mass += body.particles.pinned[i] != 0 ? 0.0 : body.particles.mass[i];
        pinned += body.particles.pinned[i];
    }
    EXPECT_GT(pinned, 3u);
    for (std::size_t i = 0; i < forces.size(); ++i) {
        const double share = body.particles.pinned[i] != 0 ? 0.0 : body.particles.mass[i] / free_mass;
        // N, to rounding; in the scene's axes, although the body is turned.
        EXPECT_LT(glm::length(forces[i] - share * Vec3(1.0, -2.0, 3.0)), 1e-14);
    }
    EXPECT_LT(glm::length(sum_of(forces) - Vec3(1.0, -2.0, 3.0)), 1e-13);
}

TEST(RegionLoads, APressureOnAllOfAClosedBodyHasNoResultant) {
    const std::string pressed = std::string("[[model.regions]]\n") + kEverywhere + "pressure = 1000.0\n";
    for (const char* generator : {"fish", "organ", "block"}) {
        const std::string model = "generator = \"" + std::string(generator) + "\"\nparticles_count = 60\n";
        for (const std::string& given : {material(0.3), std::string("material = \"none\"\n")}) {
            const DeformableBody body = body_of(model + given + pressed);
            const std::vector<Vec3> forces = forces_on(body);
            const double all = magnitudes_of(forces);
            EXPECT_GT(all, 1.0);
            EXPECT_LT(glm::length(sum_of(forces)), 1e-12 * all) << generator;
            EXPECT_LT(glm::length(moment_of(body, forces)), 1e-12 * all) << generator;
        }
    }
}

TEST(RegionLoads, APressureOnAFacePushesWithItsAreaAndTurnsWithTheBody) {
    // N; the fit of the elements is accurate to 1e-10.
    const std::string face = std::string(kUpperFace) + "pressure = 500.0\n";
    const DeformableBody body = body_of(kBar + material(0.3) + face);
    EXPECT_LT(glm::length(sum_of(forces_on(body)) - Vec3(0.0, -500.0 * kBarSection, 0.0)), 1e-9);
    // A quarter turn about z takes y to -x.
    const DeformableBody turned = body_of(
        kBar + std::string("orientation = [0.7071067811865476, 0, 0, 0.7071067811865476]\n") + material(0.3) + face);
    EXPECT_LT(glm::length(sum_of(forces_on(turned)) - Vec3(500.0 * kBarSection, 0.0, 0.0)), 1e-9);
    // The present surface counts: twice as wide in x and z.
    std::vector<Vec3> wide = body.particles.rest_position;
    for (Vec3& p : wide) {
        p *= Vec3(2.0, 1.0, 2.0);
    }
    EXPECT_LT(glm::length(sum_of(forces_at(body, wide, 0.0)) - Vec3(0.0, -4.0 * 500.0 * kBarSection, 0.0)), 1e-9);
}

TEST(RegionLoads, APressureOnASheetCountsOneOfItsFaces) {
    // A cloth of 1 m^2 lies in the x-z plane, its front up.
    const DeformableBody body =
        body_of(std::string("generator = \"cloth\"\nside = 1.0\nvertices_per_side = 9\n") +
                "material = \"cotton\"\n[[model.regions]]\n" + kEverywhere + "pressure = 3.0\n");
    ASSERT_TRUE(body.mesh.double_faced);
    const Vec3 force = sum_of(forces_on(body));
    EXPECT_NEAR(std::abs(force.y), 3.0, 1e-12);
    EXPECT_LT(std::abs(force.x) + std::abs(force.z), 1e-12);
}

TEST(RegionLoads, VaryLinearlyBetweenTheirTimes) {
    const std::string load = std::string(kBar) + material(0.3) + kLowerEnd +
                             "force = [0, -2, 0]\nload_times = [0.0, 0.5, 1.0]\nload_factors = [0.0, 1.0, 0.5]\n";
    const DeformableBody once = body_of(load);
    const auto force_at = [](const DeformableBody& body, double time_s) { return sum_of(forces_on(body, time_s)).y; };
    EXPECT_NEAR(force_at(once, 0.0), 0.0, 1e-15);
    EXPECT_NEAR(force_at(once, 0.25), -1.0, 1e-13);
    EXPECT_NEAR(force_at(once, 0.75), -1.5, 1e-13);
    EXPECT_NEAR(force_at(once, 7.0), -1.0, 1e-13);
    EXPECT_NEAR(force_at(body_of(load + "load_repeat = true\n"), 7.25), -1.0, 1e-13);
}

TEST(RegionLoads, AHangingBarStretchesByItsModulus) {
    // 2 N on 4 cm^2 of 100 kPa: 5 %. No transverse contraction, so the clamp does not disturb.
    const Simulation pulled =
        settled(kBar + material(0.0) + kUpperEnd + "fixed = true\n" + kLowerEnd + "force = [0, -2, 0]\n", 3.0);
    EXPECT_NEAR(strain(pulled, 1, -0.02, 0.02), 2.0 / (kModulus * kBarSection), 0.05 * 0.05);
    // The same by a suction of 5 kPa on its lower end.
    const Simulation drawn =
        settled(kBar + material(0.0) + kUpperEnd + "fixed = true\n" + kLowerFace + "pressure = -5000.0\n", 3.0);
    EXPECT_NEAR(strain(drawn, 1, -0.02, 0.02), 0.05, 0.05 * 0.05);
}

TEST(RegionLoads, APressureOnAllFacesShrinksABodyByItsBulkModulus) {
    const Simulation pressed =
        settled(kBar + material(0.3) + "[[model.regions]]\n" + kEverywhere + "pressure = 5000.0\n", 3.0);
    // Strain in every direction -p (1 - 2 nu) / E (1 + strain)^2, because the pressure acts on the present surface.
    double expected = 0.0;
    for (int k = 0; k < 20; ++k) {
        expected = -5000.0 * 0.4 / kModulus * (1.0 + expected) * (1.0 + expected);
    }
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(affine_strain(pressed, axis), expected, 0.02 * std::abs(expected));
    }
    // It stays where it was and is not turned: 0.2 mm are 1 % of its width.
    const ParticleModel& model = pressed.model();
    for (std::size_t i = 0; i < model.size(); ++i) {
        EXPECT_LT(glm::length(model.position[i] - (1.0 + expected) * model.rest_position[i]), 2e-4);
    }
}

TEST(RegionLoads, ThatNothingCanTakeAreRefused) {
    const std::string bar = kBar + material(0.3);
    EXPECT_THAT(region_refusal(bar + "[[model.regions]]\n" + kEverywhere + "fixed = true\nforce = [0, 1, 0]\n"),
                AllOf(HasSubstr("scene.toml:16: model.regions.0.force: "), HasSubstr("no particle in it can move")));
    EXPECT_THAT(
        region_refusal("generator = \"plate\"\n[[model.regions]]\n" + std::string(kEverywhere) + "force = [0, 1, 0]\n"),
        HasSubstr("no particle in it can move"));
    EXPECT_THAT(
        region_refusal("generator = \"plate\"\n[[model.regions]]\n" + std::string(kEverywhere) + "pressure = 1.0\n"),
        HasSubstr("are all fixed or driven"));
    EXPECT_THAT(region_refusal(bar + "[[model.regions]]\nlow = [-0.005, -0.03, -0.005]\nhigh = [0.005, 0.03, 0.005]\n" +
                               "pressure = 1.0\n"),
                AllOf(HasSubstr("scene.toml:15: model.regions.0.pressure: "), HasSubstr("no triangle of the surface")));
}

TEST(Regions, OutsideTheBodyAreRefusedWithTheirLineAndThePlaceOfTheParticles) {
    const std::string outside = "[[model.regions]]\nlow = [5, 5, 5]\nhigh = [6, 6, 6]\nfixed = true\n";
    EXPECT_THAT(region_refusal(std::string(kBar) + outside),
                AllOf(HasSubstr("scene.toml:7: model.regions.0: has no particle in it"),
                      ContainsRegex("from \\[-0.00[0-9]+, -0.03[0-9]+, -0.00[0-9]+\\] to \\[0.00")));
    // A cloth is built where it falls from; its own frame is about its middle.
    EXPECT_THAT(
        region_refusal("generator = \"cloth\"\nvertices_per_side = 3\n" + outside),
        HasSubstr("scene.toml:4: model.regions.0: has no particle in it; the particles are from [-0.5, 0, -0.5] to "
                  "[0.5, 0, 0.5] m"));
}

TEST(Regions, WhoseCornersAreSwappedAreRefusedWithTheAxis) {
    EXPECT_THAT(
        region_refusal(
            "generator = \"cloth\"\n[[model.regions]]\nlow = [-1, 0.2, -1]\nhigh = [1, 0.1, 1]\nfixed = true\n"),
        HasSubstr("scene.toml:4: model.regions.0.low: is above high along y: 0.2 > 0.1"));
}

TEST(Regions, WithAMaterialOfTheOtherKindAreBlamedThemselves) {
    const std::string bar = kBar + std::string("material = \"liver\"\n[[model.regions]]\n") + kEverywhere;
    EXPECT_THAT(region_refusal(bar + "material = \"cotton\"\n"),
                HasSubstr("scene.toml:11: model.regions.0.material: \"cotton\" is a sheet, but the body is a solid"));
    EXPECT_THAT(region_refusal(bar + "[model.regions.material]\nname = \"cotton\"\n"),
                HasSubstr("scene.toml:12: model.regions.0.material.name: \"cotton\" is a sheet"));
    EXPECT_THAT(region_refusal(bar + "[model.regions.material]\nareal_density = 0.1\n"),
                HasSubstr("scene.toml:12: model.regions.0.material.areal_density: is a value of a sheet, but the body "
                          "is a solid; give it density"));
}

TEST(Regions, WithWhatDoesNotApplyToTheirBodyAreRefusedWithTheirLine) {
    const std::string region = std::string(kBar) + "[[model.regions]]\n" + kEverywhere;
    EXPECT_THAT(region_refusal(region + "material = \"skin\"\n"),
                AllOf(HasSubstr("scene.toml:10: model.regions.0.material: needs a body with a material"),
                      HasSubstr("give it one with model.material")));
    EXPECT_THAT(region_refusal("material = \"liver\"\n" + region + "stiffness = 0.5\n"),
                HasSubstr("scene.toml:11: model.regions.0.stiffness: does not apply to a body with a material"));
    EXPECT_THAT(region_refusal("material = \"liver\"\n" + region + "material = \"none\"\n"),
                HasSubstr("scene.toml:11: model.regions.0.material: cannot be"));
    EXPECT_EQ(region_refusal("material = \"none\"\n" + region + "material = \"skin\"\n"), "");
}

TEST(Regions, WithoutAnEffectAreRefused) {
    const std::string region = std::string(kBar) + "[[model.regions]]\n" + kEverywhere;
    EXPECT_THAT(region_refusal(region), HasSubstr("scene.toml:7: model.regions.0: has no effect; give it fixed"));
    EXPECT_THAT(region_refusal(region + "fixed = true\nmotion_repeat = true\n"),
                HasSubstr("scene.toml:11: model.regions.0.motion_repeat: has no motion to repeat"));
    EXPECT_THAT(region_refusal(region + "force = [0, 1, 0]\nload_repeat = true\n"),
                HasSubstr("scene.toml:11: model.regions.0.load_repeat: has no course to repeat"));
    EXPECT_EQ(region_refusal(region + "fixed = true\nmotion_repeat = false\nload_repeat = false\n"), "");
}

TEST(PlatesAndRods, HaveNoMaterial) {
    EXPECT_THAT(region_refusal("generator = \"plate\"\nmaterial = \"liver\"\n"),
                HasSubstr("scene.toml:3: model.material: does not apply to plates and rods, which are rigid"));
}

TEST(RegionLoads, WithWrongTimesAreRefusedWithTheirLine) {
    const std::string region = std::string(kBar) + "[[model.regions]]\n" + kEverywhere;
    EXPECT_THAT(region_refusal(region + "force = [0, 1, 0]\nload_times = [0.0, 1.0]\nload_factors = [1.0]\n"),
                AllOf(HasSubstr("scene.toml:12: model.regions.0.load_factors: needs one number for each of the 2"),
                      HasSubstr("has 1")));
    EXPECT_THAT(region_refusal(region + "force = [0, 1, 0]\nload_times = [0.5, 1.0]\nload_factors = [1.0, 1.0]\n"),
                HasSubstr("model.regions.0.load_times: must start at 0 and increase"));
    EXPECT_THAT(region_refusal(region + "load_times = [0.0, 1.0]\nload_factors = [1.0, 1.0]\n"),
                HasSubstr("give the region a force or a pressure"));
}

}  // namespace
}  // namespace haptic::sim
