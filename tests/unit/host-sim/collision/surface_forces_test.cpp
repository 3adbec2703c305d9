// Forces of contacts between sheets and with the ground: they keep apart what they are given, and nothing else.
#include "collision/surface_forces.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <vector>

#include "collision/vertex_masses.hpp"
#include "dynamics/elastic_bodies.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/material.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kAlongSheet = 5;  // vertices along a side
constexpr std::uint32_t kVerticesOfSheet = kAlongSheet * kAlongSheet;
constexpr std::uint32_t kMiddleOfSheet = 12;
constexpr double kSubstepOfForces = 0.002;  // s
constexpr double kErrorOfForces = 1e-5;     // m
constexpr FrictionCoefficients kFrictionOfForces{.sticking = 0.5, .sliding = 0.4};

/// Two sheets of 0.2 m, one 2 mm above the other, of cotton or of links.
class PressedSheets {
  public:
    explicit PressedSheets(bool cotton, bool pinned = false) {
        std::vector<ParticleSurface> sheets;
        for (std::uint32_t k = 0; k < 2; ++k) {
            ClothShape shape;
            shape.vertices_per_side = kAlongSheet;
            shape.side = 0.2;
            shape.centre = Vec3(0.0, 0.002 * k, 0.0);
            meshes_.push_back(make_cloth_mesh(shape));
            ParticleModel sheet = make_cloth_particles(shape, 0.0, 1.0);
            if (cotton) {
                const std::vector<SheetMaterial> material(sheet.size(), find_material("cotton").sheet);
                sheet.elasticity = make_sheet(sheet, meshes_.back(), material);
                sheet.links.clear();
            }
            model.append(sheet);
        }
        model.pinned.assign(model.size(), pinned ? 1 : 0);
        for (std::uint32_t k = 0; k < 2; ++k) {
            sheets.push_back({.first_particle = k * kVerticesOfSheet,
                              .triangles = meshes_[k].triangles,
                              .rest = meshes_[k].vertices});
        }
        masses_.emplace(model);
        elastic.emplace(model, 1);
        elastic->prepare(kSubstepOfForces);
        forces.emplace(model, sheets, *masses_, kFrictionOfForces, kErrorOfForces, 16);
        for (const Vec3& x : model.position) {
            start.push_back(row_of(x));
        }
        position = start;
    }
    /// Begins a sub-step with this contact, new, and moves the sheets.
    void press(const SurfaceContact& contact) {
        forces->begin(*elastic, kSubstepOfForces, false, position.data(),
                      [](const SurfaceContact& of) { return std::optional(of); });
        forces->add(contact);
        forces->solve(start.data(), position.data());
    }
    /// kg m, of what has been moved since the start.
    [[nodiscard]] Vec3 moved() const {
        return sum([&](std::size_t i) { return vector_of(position[i]) - vector_of(start[i]); });
    }
    /// m, per particle: what the forces would have done to it alone.
    [[nodiscard]] std::vector<Row> pushed() const {
        std::vector<Row> rows(model.size(), Row{});
        forces->add_pushes(rows.data(), [](const SurfaceContact& /*of*/) { return true; });
        return rows;
    }
    /// kg m, of that.
    [[nodiscard]] Vec3 impulse() const {
        const std::vector<Row> rows = pushed();
        return sum([&](std::size_t i) { return vector_of(rows[i]); });
    }

    ParticleModel model;
    std::vector<Row> start;
    std::vector<Row> position;
    std::optional<ElasticBodies> elastic;
    std::optional<SurfaceForces> forces;

  private:
    /// Of the particles, mass times way(particle).
    template <class Way>
    [[nodiscard]] Vec3 sum(const Way& way) const {
        Vec3 all(0.0);
        for (std::size_t i = 0; i < model.size(); ++i) {
            all += model.mass[i] * way(i);
        }
        return all;
    }

    std::vector<TriangleMesh> meshes_;
    std::optional<VertexMasses> masses_;
};

TEST(SurfaceForces, LiftAVertexOffTheGroundAndItsSheetWithIt) {
    for (const bool cotton : {false, true}) {
        PressedSheets sheets(cotton);
        sheets.press(SurfaceContact::with_ground(kMiddleOfSheet, 0.001));
        EXPECT_NEAR(sheets.position[kMiddleOfSheet].number[1], 0.001, kErrorOfForces) << cotton;
        // What moves has the momentum of the force, however much of the sheet that is.
        const Vec3 impulse = sheets.impulse();
        EXPECT_GT(impulse.y, 0.0);
        EXPECT_LT(glm::length(sheets.moved() - impulse), 1e-9 * impulse.y) << cotton;
        EXPECT_EQ(sheets.position[kMiddleOfSheet + 1].number[1] > 0.0, cotton);
    }
}

TEST(SurfaceForces, LeaveAloneWhatIsFarEnough) {
    for (const bool cotton : {false, true}) {
        PressedSheets sheets(cotton);
        sheets.press(SurfaceContact::with_ground(kMiddleOfSheet, -0.001));
        for (std::size_t i = 0; i < sheets.position.size(); ++i) {
            EXPECT_EQ(vector_of(sheets.position[i]), vector_of(sheets.start[i]));
        }
        EXPECT_EQ(sheets.impulse(), Vec3(0.0));
    }
}

TEST(SurfaceForces, PushTwoSheetsOppositely) {
    // The middle of the upper one and a triangle of the lower one, below it.
    for (const bool cotton : {false, true}) {
        PressedSheets sheets(cotton);
        sheets.press({.kind = PairKind::VertexTriangle,
                      .vertex = {kVerticesOfSheet + kMiddleOfSheet, kMiddleOfSheet, kMiddleOfSheet + 1,
                                 kMiddleOfSheet + kAlongSheet},
                      .weight = {1.0, -1.0, 0.0, 0.0},
                      .normal = Vec3(0.0, 1.0, 0.0),
                      .min_separation = 0.003});
        const double apart =
            sheets.position[kVerticesOfSheet + kMiddleOfSheet].number[1] - sheets.position[kMiddleOfSheet].number[1];
        EXPECT_NEAR(apart, 0.003, kErrorOfForces) << cotton;
        const double one_way = sheets.model.mass[kMiddleOfSheet] * 0.001;
        EXPECT_LT(glm::length(sheets.impulse()), 1e-9 * one_way) << cotton;
        EXPECT_LT(glm::length(sheets.moved()), 1e-9 * one_way) << cotton;
    }
}

TEST(SurfaceForces, UndoSlipWithinTheConeAndOnlySoMuchBeyond) {
    constexpr double depth = 0.001;
    for (const double slip : {0.4 * depth, 3.0 * depth}) {
        PressedSheets sheets(false);
        Row& at = sheets.position[kMiddleOfSheet];
        at.number[0] += slip;
        at.number[1] -= depth;
        sheets.press(SurfaceContact::with_ground(kMiddleOfSheet, 0.0));
        const double left = at.number[0] - sheets.start[kMiddleOfSheet].number[0];
        const double expected =
            slip <= kFrictionOfForces.sticking * depth ? 0.0 : slip - kFrictionOfForces.sliding * depth;
        EXPECT_NEAR(left, expected, 1e-15) << slip;
        EXPECT_NEAR(at.number[1], 0.0, 1e-15);
    }
}

TEST(SurfaceForces, ThatPushedGoOnWithTheSameForce) {
    PressedSheets sheets(true);
    const SurfaceContact contact = SurfaceContact::with_ground(kMiddleOfSheet, 0.001);
    sheets.press(contact);
    const double alone = vector_of(sheets.pushed()[kMiddleOfSheet]).y;
    EXPECT_FALSE(sheets.forces->pushes_on(contact.kind, contact.vertex));
    const auto same = [](const SurfaceContact& of) { return std::optional(of); };
    const auto none = [](const SurfaceContact& /*of*/) { return std::optional<SurfaceContact>(); };
    const auto moved_by = [&](double h, bool goes_on, const auto& renewed) {
        // After a sub-step with that force.
        sheets.position = sheets.start;
        sheets.press(contact);
        sheets.position = sheets.start;
        sheets.elastic->prepare(h);
        sheets.forces->begin(*sheets.elastic, h, goes_on, sheets.position.data(), renewed);
        sheets.elastic->prepare(kSubstepOfForces);
        return sheets.position[kMiddleOfSheet].number[1] - sheets.start[kMiddleOfSheet].number[1];
    };
    EXPECT_NEAR(moved_by(kSubstepOfForces, true, same), alone, 1e-12);
    EXPECT_TRUE(sheets.forces->pushes_on(contact.kind, contact.vertex));
    EXPECT_FALSE(sheets.forces->pushes_on(
        contact.kind, {kMiddleOfSheet + 1, kMiddleOfSheet + 1, kMiddleOfSheet + 1, kMiddleOfSheet + 1}));
    // The same force, in half of the time.
    EXPECT_NEAR(moved_by(0.5 * kSubstepOfForces, true, same), 0.25 * alone, 1e-12);
    EXPECT_EQ(moved_by(kSubstepOfForces, true, none), 0.0);
    EXPECT_EQ(moved_by(kSubstepOfForces, false, same), 0.0);
    EXPECT_FALSE(sheets.forces->pushes_on(contact.kind, contact.vertex));
}

TEST(SurfaceForces, AreNoneBetweenWhatIsPinned) {
    PressedSheets sheets(true, true);
    sheets.press(SurfaceContact::with_ground(kMiddleOfSheet, 0.001));
    EXPECT_EQ(sheets.forces->size(), 0U);
    EXPECT_EQ(vector_of(sheets.position[kMiddleOfSheet]), vector_of(sheets.start[kMiddleOfSheet]));
}

}  // namespace
}  // namespace haptic::sim
