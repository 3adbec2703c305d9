// Pushes at single particles of elastic bodies: what moves, its momenta, reciprocity, and bodies that rest on the
// ground.
#include "dynamics/elastic_pushes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "dynamics/one_lane.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {
namespace {

/// A block of 0.12 x 0.06 x 0.08 m whose middle is at the origin.
ParticleModel pushed_block(const SolidMaterial& material) {
    const Vec3 size(0.12, 0.06, 0.08);
    BuilderSettings settings;
    settings.particles = 80;
    settings.neighbours = 16;
    settings.mass = material.density * size.x * size.y * size.z;
    const TriangleMesh mesh = make_block_mesh({.size = size, .cells = 12});
    ParticleModel model = build_body(mesh, settings).particles;
    model.elasticity = make_solid(model, std::vector<SolidMaterial>(model.size(), material));
    balance_surface(model, mesh, model.elasticity);
    model.groups.clear();
    return model;
}

constexpr Vec3 kNoArm(0.0);

std::vector<Row> rows_of(const ParticleModel& model) {
    std::vector<Row> rows(model.size());
    for (std::size_t i = 0; i < model.size(); ++i) {
        rows[i] = {{model.position[i].x, model.position[i].y, model.position[i].z, 0.0}};
    }
    return rows;
}

Vec3 vector_from_row(const Row& row) {
    return {row.number[0], row.number[1], row.number[2]};
}

ParticleModel held_block(bool held) {
    ParticleModel model = pushed_block({.young_modulus = 1e5, .damping = 0.001});
    model.pinned[5] = model.pinned[40] = held ? 1 : 0;
    return model;
}

class ElasticPushesOf : public testing::TestWithParam<bool> {
  protected:
    /// What every particle moves by with this force on one, or at the end of an arm at it, m.
    std::vector<Vec3> moved_by(std::uint32_t particle, const Vec3& force, const Vec3& arm = kNoArm) {
        std::vector<Row> rows = rows_of(model);
        const ElasticPushes::Place place = pushes.take_part(particle);
        pushes.push(place, arm, force);
        at_place = pushes.displacement(place, arm);
        pushes.move_body(particle, rows.data());
        std::vector<Vec3> moved;
        for (std::size_t i = 0; i < model.size(); ++i) {
            moved.push_back(vector_from_row(rows[i]) - model.position[i]);
        }
        return moved;
    }

    void SetUp() override {
        elastic.prepare(kStep);
        pushes.begin(model, elastic, kStep);
    }

    static constexpr double kStep = 0.002;
    const FlushDenormals flush{};
    ParticleModel model = held_block(GetParam());
    ElasticBodies elastic{model, 1};
    ElasticPushes pushes{model};
    Vec3 at_place{0.0};  // m, by the last force, before the body moved
};

TEST_P(ElasticPushesOf, AParticleMovesByItsCompliance) {
    const Vec3 normal(0.0, 0.6, 0.8);
    const Vec3 first(1.0, 0.0, 0.0);
    const Vec3 second(0.0, -0.8, 0.6);
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        ASSERT_EQ(pushes.answers(i), model.pinned[i] == 0);
        if (!pushes.answers(i)) {
            continue;
        }
        const ElasticPushes::Compliance compliance = pushes.compliance(pushes.take_part(i), kNoArm, normal);
        const std::vector<Vec3> moved = moved_by(i, normal);
        EXPECT_LT(glm::length(at_place - moved[i]), 1e-9 * compliance.along);
        const double across = 0.5 * (glm::dot(moved_by(i, first)[i], first) + glm::dot(moved_by(i, second)[i], second));
        EXPECT_NEAR(glm::dot(moved[i], normal), compliance.along, 1e-9 * compliance.along);
        EXPECT_NEAR(across, compliance.across, 1e-9 * compliance.across);
        for (std::size_t j = 0; j < model.size(); ++j) {
            EXPECT_TRUE(model.pinned[j] == 0 || moved[j] == Vec3(0.0));
        }
    }
}

TEST_P(ElasticPushesOf, AParticleThatJoinsLaterHasMovedToo) {
    const Vec3 force(0.3, -0.5, 0.2);
    const ElasticPushes::Place first = pushes.take_part(7);
    pushes.push(first, kNoArm, force);
    const Vec3 before = pushes.displacement(pushes.take_part(61), kNoArm);
    pushes.push(pushes.take_part(30), kNoArm, force);
    const Vec3 after = pushes.displacement(pushes.take_part(61), kNoArm);
    std::vector<Row> rows = rows_of(model);
    pushes.move_body(7, rows.data());
    EXPECT_NE(before, Vec3(0.0));
    EXPECT_LT(glm::length(vector_from_row(rows[61]) - model.position[61] - after), 1e-9 * glm::length(after));
    // The body has moved: nothing is left to do.
    EXPECT_EQ(pushes.displacement(pushes.take_part(61), kNoArm), Vec3(0.0));
    // The next sub-step has other particles in the same places.
    pushes.begin(model, elastic, kStep);
    pushes.push(pushes.take_part(61), kNoArm, force);
    EXPECT_NE(pushes.displacement(pushes.take_part(61), kNoArm), pushes.displacement(pushes.take_part(7), kNoArm));
}

TEST_P(ElasticPushesOf, ABodyThatWasExpectedToBePushedAnswersWithTheSameBits) {
    const Vec3 force(0.3, -0.5, 0.2);
    const std::vector<Vec3> alone = moved_by(7, force);
    for (const bool steps : {true, false}) {
        pushes.begin(model, elastic, kStep);
        pushes.expect(7);
        if (steps) {
            std::vector<Row> rows = rows_of(model);
            std::vector<Row> orientations(model.size(), Row{{1.0, 0.0, 0.0, 0.0}});
            elastic.step({model, 1.0, rows.data(), orientations.data()});
        }
        EXPECT_EQ(moved_by(7, force), alone);
    }
}

TEST_P(ElasticPushesOf, AnAnswerIsReciprocal) {
    const Vec3 at_first(0.6, 0.0, 0.8);
    const Vec3 at_second(0.0, 0.6, 0.8);
    // Betti (1872): each force does the same work on the motion by the other.
    const double work = glm::dot(moved_by(3, at_first)[61], at_second);
    EXPECT_NEAR(glm::dot(moved_by(61, at_second)[3], at_first), work, 1e-9 * std::abs(work));
    EXPECT_NE(work, 0.0);
}

TEST_P(ElasticPushesOf, AnswerAtArmsAsTheyDoAtParticles) {
    const Vec3 normal(0.0, 0.6, 0.8);
    const Vec3 first(1.0, 0.0, 0.0);
    const Vec3 second(0.0, -0.8, 0.6);
    const bool turns = pushes.turns(pushes.take_part(3));
    ASSERT_NE(turns, GetParam());
    const Vec3 arm = turns ? Vec3(0.01, -0.02, 0.005) : kNoArm;
    const ElasticPushes::Compliance compliance = pushes.compliance(pushes.take_part(3), arm, normal);
    const auto at_arm = [&](const Vec3& force) {
        pushes.begin(model, elastic, kStep);
        (void)moved_by(3, force, arm);
        return at_place;
    };
    EXPECT_NEAR(glm::dot(at_arm(normal), normal), compliance.along, 1e-9 * compliance.along);
    EXPECT_NEAR(0.5 * (glm::dot(at_arm(first), first) + glm::dot(at_arm(second), second)), compliance.across,
                1e-9 * compliance.across);
    // Between two points: what one measures of the other, both ways, and as the kernels sum it up.
    const Vec3 other_arm = turns ? Vec3(0.0, 0.03, 0.01) : kNoArm;
    pushes.begin(model, elastic, kStep);
    const ElasticPushes::Place one = pushes.take_part(3);
    const ElasticPushes::Place other = pushes.take_part(61);
    const PushedContact::Side at_one{.place = &pushes.kernel_place(one), .arm = lane(arm)};
    const PushedContact::Side at_other{.place = &pushes.kernel_place(other), .arm = lane(other_arm)};
    const Vec3 force(0.6, 0.0, 0.8);
    const double there = pushes.response(at_one, normal, at_other, force);
    EXPECT_NEAR(pushes.response(at_other, force, at_one, normal), there, 1e-9 * compliance.along);
    pushes.push(other, other_arm, force);
    const Vec3 moved = pushes.displacement(one, arm);
    EXPECT_NEAR(glm::dot(moved, normal), there, 1e-9 * compliance.along);
    // Also when the body has moved: the arm has turned in all.
    std::vector<Row> rows = rows_of(model);
    pushes.move_body(3, rows.data());
    const Vec3 end = vector_from_row(rows[3]) - model.position[3] + pushes.displacement(one, arm);
    EXPECT_LT(glm::length(end - moved), 1e-9 * glm::length(moved));
    EXPECT_GT(std::abs(there), 1e-3 * compliance.along);
}

INSTANTIATE_TEST_SUITE_P(FreeAndHeldBodies, ElasticPushesOf, testing::Bool(),
                         [](const testing::TestParamInfo<bool>& held) { return held.param ? "held" : "free"; });

TEST(ElasticPushes, GiveAFreeBodyTheMomentaOfTheForce) {
    const double h = 0.004;
    const ParticleModel model = pushed_block({.young_modulus = 1e6});
    ElasticBodies elastic(model, 1);
    elastic.prepare(h);
    ElasticPushes pushes(model);
    pushes.begin(model, elastic, h);
    for (const std::uint32_t i : {0U, 17U, 79U}) {
        const Vec3 force(-0.4, 1.0, 0.2);
        const Vec3 arm(0.02, 0.0, -0.01);
        std::vector<Row> rows = rows_of(model);
        pushes.push(pushes.take_part(i), arm, force);
        pushes.move_body(i, rows.data());
        const Vec3 impulse = h * force;
        Vec3 linear(0.0);
        Vec3 angular(0.0);
        for (std::size_t j = 0; j < model.size(); ++j) {
            const Vec3 momentum = model.mass[j] / h * (vector_from_row(rows[j]) - model.position[j]);
            linear += momentum;
            angular += glm::cross(model.position[j], momentum);
        }
        const Vec3 moment = glm::cross(model.position[i] + arm, impulse);
        EXPECT_LT(glm::length(linear - impulse), 1e-9 * glm::length(impulse));
        EXPECT_LT(glm::length(angular - moment), 1e-9 * glm::length(moment));
    }
}

TEST(ElasticPushes, AStiffBlockLandsAndRestsWithItsShape) {
    const FlushDenormals flush;
    for (const double young : {3e4, 1e6}) {
        for (const double step : {0.002, 0.01}) {
            ParticleModel model = pushed_block({.young_modulus = young, .damping = 0.005});
            for (Vec3& x : model.position) {
                x.y += 0.05;
            }
            ParticleCollisions ground(model, {.ground = true, .ground_height = 0.0}, nullptr);
            ParticleSolver solver(model, {.step = step, .substeps = 0, .iterations = 1});
            for (double time = 0.0; time < 2.0; time += step) {
                solver.step(model, {}, {&ground});
            }
            // Its weight presses it together by rho g L^2 / (2 E), 30 um of 60 mm at 30 kPa.
            double fastest = 0.0;
            double most = 0.0;
            for (std::size_t i = 0; i < model.size(); ++i) {
                fastest = std::max(fastest, glm::length(model.velocity[i]));
                for (std::size_t j = 0; j < i; ++j) {
                    const double now = glm::length(model.position[i] - model.position[j]);
                    const double rest = glm::length(model.rest_position[i] - model.rest_position[j]);
                    most = std::max(most, std::abs(now - rest));
                }
            }
            EXPECT_LT(fastest, 2e-3) << young << " Pa, " << step << " s";
            EXPECT_LT(most, young > 1e5 ? 3e-4 : 2e-3) << young << " Pa, " << step << " s";
        }
    }
}

/// Two blocks that fall on one another and on the ground, turning, after so many steps of 5 ms.
std::vector<Vec3> fallen_blocks(int steps, std::size_t lanes, int threads) {
    const FlushDenormals flush;
    ParticleModel model;
    for (const double height : {0.05, 0.14}) {
        ParticleModel block = pushed_block({.young_modulus = 1e5, .damping = 0.005});
        for (std::size_t i = 0; i < block.size(); ++i) {
            block.position[i] += Vec3(0.2 * height, height, 0.0);
            block.velocity[i] = Vec3(-0.3, -1.0, 0.0) + glm::cross(Vec3(0.0, 2.0, 3.0), block.position[i]);
        }
        model.append(block);
    }
    ParticleCollisions collisions(model, {.ground = true, .static_friction = 0.5, .dynamic_friction = 0.4}, nullptr);
    ParticleSolver solver(model, {.step = 0.005, .iterations = 1, .threads = threads}, lanes);
    std::size_t most = 0;
    for (int i = 0; i < steps; ++i) {
        solver.step(model, {}, {&collisions});
        most = std::max(most, collisions.counts().active);
    }
    EXPECT_GT(most, 2 * kPlacePadding) << "some body has more places than its rows hold at first";
    return model.position;
}

TEST(ElasticPushes, GiveTheSameBitsWithAnyNumberOfLanesAndThreads) {
    const std::vector<Vec3> first = fallen_blocks(60, 1, 1);
    for (const std::size_t lanes : ParticleSolver::usable_lanes()) {
        EXPECT_EQ(fallen_blocks(60, lanes, 1), first) << lanes << " lanes";
    }
    for (const int threads : {2, 3}) {
        EXPECT_EQ(fallen_blocks(60, ParticleSolver::kWidest, threads), first) << threads << " threads";
    }
}

}  // namespace
}  // namespace haptic::sim
