#include "collision/surface_contacts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

#include "haptic/sim/cloth.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/material.hpp"
#include "haptic/sim/solver.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kSide = 13;  // vertices
constexpr std::size_t kPerSheet = std::size_t{kSide} * kSide;

/// A sheet alone, or several of them: of links, or of a material.
class Sheets {
  public:
    struct Settings {
        std::uint32_t side = kSide;
        double step = 0.01;
        std::optional<int> substeps{};  // 2, or as many as the material needs
        Vec3 gravity{0.0};
        CollisionSettings collisions{.static_friction = 0.5, .dynamic_friction = 0.4};
        std::size_t lanes = ParticleCollisions::kWidest;
        bool guarded = true;
        std::size_t held = 0;  // so many sheets, at their borders
        const char* material = nullptr;
        int threads = 1;
    };

    explicit Sheets(const Settings& settings, std::vector<ClothShape> shapes = {ClothShape{}}) : settings_(settings) {
        for (ClothShape& shape : shapes) {
            shape.vertices_per_side = settings.side;
            meshes_.push_back(make_cloth_mesh(shape));
            ParticleModel sheet = make_cloth_particles(shape, 0.0, 1.0);
            if (settings.material != nullptr) {
                const std::vector<SheetMaterial> material(sheet.size(), find_material(settings.material).sheet);
                sheet.elasticity = make_sheet(sheet, meshes_.back(), material);
                sheet.links.clear();
            }
            model.append(sheet);
        }
        const std::size_t per_sheet = std::size_t{settings.side} * settings.side;
        for (std::size_t i = 0; i < settings.held * per_sheet; ++i) {
            const auto at_border = [&](std::size_t k) { return k == 0 || k + 1 == settings.side; };
            const std::size_t of_sheet = i % per_sheet;
            model.pinned[i] = at_border(of_sheet / settings.side) || at_border(of_sheet % settings.side) ? 1 : 0;
        }
        std::vector<ParticleSurface> surfaces;
        std::vector<CheckedSurface> checked;
        std::uint32_t first = 0;
        for (const TriangleMesh& mesh : meshes_) {
            surfaces.push_back({.first_particle = first, .triangles = mesh.triangles, .rest = mesh.vertices});
            checked.push_back({mesh.triangles, first});
            first += static_cast<std::uint32_t>(mesh.vertices.size());
        }
        contacts = std::make_unique<SurfaceContacts>(model, surfaces, settings.collisions, nullptr, settings.lanes);
        crossings_ = std::make_unique<SurfaceCrossings>(checked, model.position);
        solver_ = std::make_unique<ParticleSolver>(
            model, SolverSettings{.step = settings.step,
                                  .substeps = settings.substeps.value_or(settings.material == nullptr ? 2 : 0),
                                  .iterations = 4,
                                  .gravity = settings.gravity,
                                  .threads = settings.threads});
    }

    void set_step(double step) {
        solver_->set_steps(step, solver_->settings().substeps, solver_->settings().iterations);
    }
    void step() { solver_->step(model, {}, {settings_.guarded ? contacts.get() : nullptr}); }

    [[nodiscard]] std::size_t crossings() { return crossings_->find(model.position, 1e-14).size(); }

    /// m, of all features that share no vertex.
    [[nodiscard]] double least_distance() const {
        double least = 1.0;
        const SurfaceFeatures& features = contacts->features();
        const auto at = [&](std::uint32_t v) { return model.position[v]; };
        for (const std::uint32_t v : features.vertices()) {
            for (const Triangle& t : features.triangles()) {
                if (std::ranges::find(t, v) == t.end()) {
                    const FeatureVertices x{at(v), at(t[0]), at(t[1]), at(t[2])};
                    least = std::min(least, nearest_points(PairKind::VertexTriangle, x).distance);
                }
            }
        }
        for (const auto& e : features.edges()) {
            for (const auto& f : features.edges()) {
                if (e[0] != f[0] && e[0] != f[1] && e[1] != f[0] && e[1] != f[1]) {
                    const FeatureVertices x{at(e[0]), at(e[1]), at(f[0]), at(f[1])};
                    least = std::min(least, nearest_points(PairKind::EdgeEdge, x).distance);
                }
            }
        }
        return least;
    }

    /// Throws the vertices at each other: random velocities and a squeeze from two sides, m/s.
    void throw_together(std::uint32_t seed, double speed) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> unit(-1.0, 1.0);
        for (std::size_t i = 0; i < model.size(); ++i) {
            const double a = unit(random), b = unit(random), c = unit(random);
            model.velocity[i] = speed * (0.5 * Vec3(a, b, c) - 2.0 * model.position[i]);
        }
    }

    ParticleModel model;
    std::unique_ptr<SurfaceContacts> contacts;

  private:
    Settings settings_;
    std::vector<TriangleMesh> meshes_;
    std::unique_ptr<SurfaceCrossings> crossings_;
    std::unique_ptr<ParticleSolver> solver_;
};

struct Throw {
    double speed;  // m/s
    double step;   // s
};

constexpr const char* kLinks = nullptr;  // no material

class ThrownTogether : public ::testing::TestWithParam<std::tuple<Throw, const char*>> {};

TEST_P(ThrownTogether, NothingCrossesAndTheGapIsKept) {
    const auto& [thrown, material] = GetParam();
    const auto [speed, step] = thrown;
    for (std::uint32_t seed = 1; seed <= 3; ++seed) {
        Sheets sheets({.step = step, .material = material});
        sheets.throw_together(seed, speed);
        for (int i = 0; i < 60; ++i) {
            sheets.step();
            ASSERT_EQ(sheets.crossings(), 0u) << "seed " << seed << ", step " << i;
        }
        EXPECT_GE(sheets.least_distance(), 0.999 * sheets.contacts->least_gap()) << "seed " << seed;
        // Links that are thrown gently fall short of one another.
        EXPECT_TRUE(sheets.contacts->counts().contacts > 0 || speed < 20.0) << "they have not met, seed " << seed;
    }
}

INSTANTIATE_TEST_SUITE_P(Speeds, ThrownTogether,
                         ::testing::Combine(::testing::Values(Throw{2.0, 0.01}, Throw{20.0, 0.01}, Throw{20.0, 0.033},
                                                              Throw{100.0, 0.1}),
                                            ::testing::Values(kLinks, "cotton", "paper")));

TEST(SurfaceContacts, WithoutThemTheSameThrowCrosses) {
    Sheets sheets({.guarded = false});
    sheets.throw_together(1, 20.0);
    std::size_t crossings = 0;
    for (int i = 0; i < 60; ++i) {
        sheets.step();
        crossings += sheets.crossings();
    }
    EXPECT_GT(crossings, 100u);
}

TEST(SurfaceContacts, KeepBothMomenta) {
    for (const auto& [material, speed] : {std::pair(kLinks, 20.0), std::pair("cotton", 200.0)}) {
        Sheets sheets({.material = material});
        sheets.throw_together(4, speed);
        const Vec3 linear = linear_momentum(sheets.model);
        const Vec3 angular = angular_momentum(sheets.model);
        for (int i = 0; i < 60; ++i) {
            sheets.step();
            EXPECT_LT(glm::length(linear_momentum(sheets.model) - linear), 1e-12) << "step " << i;
            EXPECT_LT(glm::length(angular_momentum(sheets.model) - angular), 1e-9) << "step " << i;
        }
        EXPECT_GT(sheets.contacts->counts().contacts, 100u);
        EXPECT_GT(sheets.contacts->counts().held, 0u) << "contacts alone kept all apart: throw harder";
    }
}

TEST(SurfaceContacts, TakeEnergyOut) {
    for (const char* const material : {kLinks, "cotton", "paper"}) {
        for (const double step : {0.01, 0.033}) {
            Sheets sheets({.step = step, .material = material});
            sheets.throw_together(5, 20.0);
            const double before = kinetic_energy(sheets.model);
            for (int i = 0; i < 200; ++i) {
                sheets.step();
                EXPECT_LT(kinetic_energy(sheets.model), before) << "step " << i;
            }
            EXPECT_LT(kinetic_energy(sheets.model), 0.1 * before);
            EXPECT_GT(sheets.contacts->counts().contacts, 100u) << "they have not met";
        }
    }
}

TEST(SurfaceContacts, LeaveWhatMeetsNothingAsItIs) {
    // A turning sheet in free flight, with and without.
    Sheets guarded({});
    Sheets free({.guarded = false});
    for (Sheets* sheets : {&guarded, &free}) {
        for (std::size_t i = 0; i < sheets->model.size(); ++i) {
            sheets->model.velocity[i] =
                Vec3(14.0, 0.0, 0.0) + glm::cross(Vec3(1.0, 2.0, 3.0), sheets->model.position[i]);
        }
    }
    for (int i = 0; i < 100; ++i) {
        guarded.step();
        free.step();
    }
    for (std::size_t i = 0; i < free.model.size(); ++i) {
        EXPECT_LT(glm::length(guarded.model.position[i] - free.model.position[i]), 1e-6);
    }
    EXPECT_EQ(guarded.contacts->counts().contacts, 0u);
}

TEST(SurfaceContacts, SearchNothingOnceTheStateHasDiverged) {
    Sheets at_rest({});
    at_rest.step();
    EXPECT_GT(at_rest.contacts->counts().searches, 0u);
    // Farther than that, each position is rounded to the same: all pairs would be near.
    for (const double gravity : {1e20, 1e160, 1e308}) {
        Sheets sheets({.gravity = {0.0, -gravity, 0.0}});
        for (int i = 0; i < 3; ++i) {
            sheets.step();
        }
        EXPECT_EQ(sheets.contacts->counts().searches, 0u) << gravity;
        EXPECT_FALSE(sheets.model.position[0].y > -1e10) << gravity;
    }
}

TEST(SurfaceContacts, StayAboveTheGround) {
    // Pressed down on its edge at 20 m/s.
    const double half = std::numbers::sqrt2 / 2.0;
    Sheets sheets({.gravity = {0.0, -9.81, 0.0}, .collisions = {.ground = true, .ground_height = -0.6}},
                  {{.orientation = Quat(half, half, 0.0, 0.0)}});
    for (Vec3& v : sheets.model.velocity) {
        v = Vec3(0.1, -20.0, 0.2);
    }
    for (int i = 0; i < 100; ++i) {
        sheets.step();
        ASSERT_EQ(sheets.crossings(), 0u) << "step " << i;
        for (const Vec3& x : sheets.model.position) {
            ASSERT_GE(x.y, -0.6) << "step " << i;
        }
    }
}

/// A sheet of this material that has fallen flat on the ground a second ago.
Sheets lying(const char* material, const Vec3& gravity, std::optional<int> substeps = {}) {
    Sheets sheets(
        {.substeps = substeps,
         .gravity = gravity,
         .collisions = {.ground = true, .ground_height = -0.1, .static_friction = 0.5, .dynamic_friction = 0.4},
         .material = material});
    for (int i = 0; i < 100; ++i) {
        sheets.step();
    }
    return sheets;
}

double fastest(const ParticleModel& model) {
    double speed = 0.0;
    for (const Vec3& v : model.velocity) {
        speed = std::max(speed, glm::length(v));
    }
    return speed;
}

class LyingSheet : public ::testing::TestWithParam<const char*> {};

TEST_P(LyingSheet, LiesStillAlsoWhenTheSubStepChanges) {
    Sheets sheets = lying(GetParam(), {0.0, -9.81, 0.0}, 20);
    for (const double step : {0.01, 0.005, 0.02, 0.01}) {
        sheets.set_step(step);
        for (int i = 0; i < 50; ++i) {
            sheets.step();
            ASSERT_LT(fastest(sheets.model), 0.03) << "step " << i << " of " << step << " s";
        }
    }
    for (std::size_t i = 0; i < sheets.model.size(); ++i) {
        const double resting = -0.1 + sheets.model.semi_axes[i].y;
        EXPECT_NEAR(sheets.model.position[i].y, resting, 1e-4) << "particle " << i;
    }
}

TEST_P(LyingSheet, SticksToASlopeBelowTheAngleOfFriction) {
    const auto slid = [&](double slope) {
        const double down = 9.81 / std::sqrt(1.0 + slope * slope);
        Sheets sheets = lying(GetParam(), {slope * down, -down, 0.0});
        const Vec3 before = sheets.model.position[0];
        for (int i = 0; i < 100; ++i) {
            sheets.step();
        }
        return sheets.model.position[0].x - before.x;
    };
    EXPECT_LT(slid(0.35), 1e-3);
    EXPECT_GT(slid(0.55), 0.3);
}

INSTANTIATE_TEST_SUITE_P(Materials, LyingSheet, ::testing::Values("cotton", "paper"));

TEST(SurfaceContacts, KeepSheetsApart) {
    // One falls on another that is held at its border.
    for (const bool between : {true, false}) {
        Sheets sheets({.gravity = {0.0, -9.81, 0.0}, .collisions = {.between_bodies = between}, .held = 1},
                      {{}, {.centre = {0.05, 0.2, 0.03}, .orientation = glm::normalize(Quat(1.0, 0.0, 0.0, 0.15))}});
        const std::vector<Vec3> before = sheets.model.position;
        for (std::size_t i = kPerSheet; i < sheets.model.size(); ++i) {
            sheets.model.velocity[i] = Vec3(0.0, -5.0, 0.0);
        }
        std::size_t crossings = 0;
        for (int i = 0; i < 100; ++i) {
            sheets.step();
            crossings += sheets.crossings();
        }
        EXPECT_EQ(crossings == 0, between);
        for (std::size_t i = 0; i < kPerSheet; ++i) {
            EXPECT_TRUE(sheets.model.pinned[i] == 0 || sheets.model.position[i] == before[i]) << "particle " << i;
        }
    }
}

TEST(SurfaceContacts, StayFiniteBetweenSheetsThatAreHeldSideBySide) {
    // Their borders are nearer than a thickness and slightly askew: nearest points move to where both are held.
    Sheets sheets({.gravity = {0.0, -9.81, 0.0}, .held = 2, .material = "cotton"},
                  {{}, {.centre = {0.003, 0.004, 0.002}, .orientation = glm::normalize(Quat(1.0, 0.0, 0.002, 0.001))}});
    for (int i = 0; i < 100; ++i) {
        sheets.step();
        for (const Vec3& x : sheets.model.position) {
            ASSERT_LT(glm::length(x), 2.0) << "step " << i;
        }
    }
    EXPECT_GT(sheets.contacts->counts().contacts, 100u);
}

class FreeSheets : public ::testing::TestWithParam<const char*> {};

TEST_P(FreeSheets, ExchangeMomentum) {
    // A sheet flies into a resting one, of twice its size and weight, that lies askew.
    Sheets sheets({.step = 0.02, .material = GetParam()}, {{.side = 1.4, .mass = 0.2}, {.centre = {0.1, 0.1, 0.05}}});
    for (std::size_t i = kPerSheet; i < sheets.model.size(); ++i) {
        sheets.model.velocity[i] = Vec3(3.0, -20.0, 1.0);
    }
    const Vec3 momentum = linear_momentum(sheets.model);
    const double energy = kinetic_energy(sheets.model);
    for (int i = 0; i < 60; ++i) {
        sheets.step();
        ASSERT_EQ(sheets.crossings(), 0u) << "step " << i;
        EXPECT_LT(glm::length(linear_momentum(sheets.model) - momentum), 1e-12) << "step " << i;
        EXPECT_LE(kinetic_energy(sheets.model), energy) << "step " << i;
    }
    Vec3 given(0.0);
    for (std::size_t i = 0; i < kPerSheet; ++i) {
        given += sheets.model.mass[i] * sheets.model.velocity[i];
    }
    EXPECT_LT(given.y, -0.5) << "N s";
}

INSTANTIATE_TEST_SUITE_P(Materials, FreeSheets, ::testing::Values(kLinks, "cotton"));

TEST(SurfaceContacts, RefuseAThicknessThatRoundingOrTheSheetExceeds) {
    for (const double thickness : {1e-9, -1.0, 1.0}) {
        EXPECT_THROW(Sheets({.collisions = {.thickness = thickness}}), std::invalid_argument) << thickness;
    }
}

TEST(SurfaceContacts, HaveTheSameBitsWithAnyNumberOfLanesAndThreads) {
    for (const char* const material : {kLinks, "cotton"}) {
        const auto thrown = [&](std::size_t lanes, int threads) {
            Sheets sheets({.lanes = lanes, .material = material, .threads = threads},
                          {{}, {.centre = {0.05, 0.1, 0.03}}});
            sheets.throw_together(6, 20.0);
            for (int i = 0; i < 40; ++i) {
                sheets.step();
            }
            return sheets;
        };
        const Sheets expected = thrown(1, 1);
        for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
            for (const int threads : {1, 4}) {
                const Sheets sheets = thrown(lanes, threads);
                EXPECT_EQ(sheets.model.position, expected.model.position)
                    << lanes << " lanes, " << threads << " threads";
                EXPECT_EQ(sheets.model.velocity, expected.model.velocity)
                    << lanes << " lanes, " << threads << " threads";
            }
        }
    }
}

}  // namespace
}  // namespace haptic::sim
