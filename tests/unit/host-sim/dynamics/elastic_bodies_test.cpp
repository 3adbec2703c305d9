// Bodies with a material in motion: momenta, free fall, energy, recovery from any deformation, the answer to forces,
// and the factors behind it.
#include "dynamics/elastic_bodies.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "dynamics/rotation.hpp"
#include "dynamics/stiffness_factor.hpp"
#include "free_motion.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/solver.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

/// A block of 0.12 x 0.06 x 0.08 m.
ParticleModel elastic_block(const SolidMaterial& material, std::size_t particles = 80) {
    const Vec3 size(0.12, 0.06, 0.08);
    BuilderSettings settings;
    settings.particles = particles;
    settings.neighbours = 16;
    settings.mass = material.density * size.x * size.y * size.z;
    ParticleModel model = build_body(make_block_mesh({.size = size, .cells = 12}), settings).particles;
    model.elasticity = make_solid(model, std::vector<SolidMaterial>(model.size(), material));
    model.groups.clear();
    return model;
}

/// A square of 0.3 m.
ParticleModel elastic_sheet(const SheetMaterial& material) {
    const ClothShape shape{.vertices_per_side = 9, .side = 0.3, .mass = 0.09 * material.areal_density};
    ParticleModel model = make_cloth_particles(shape, 0.3, 1.0);
    model.elasticity = make_sheet(model, make_cloth_mesh(shape), std::vector<SheetMaterial>(model.size(), material));
    model.groups.clear();
    model.links.clear();
    return model;
}

/// Sub-steps as the material needs, one pass, no gravity.
SolverSettings elastic_settings(double step = 0.01) {
    return {.step = step, .substeps = 0, .iterations = 1, .gravity = Vec3(0.0)};
}

double total_mass(const ParticleModel& model) {
    double mass = 0.0;
    for (const double m : model.mass) {
        mass += m;
    }
    return mass;
}

Vec3 mean_position(const ParticleModel& model) {
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        sum += model.mass[i] * model.position[i];
    }
    return sum / total_mass(model);
}

Vec3 spin_of(const ParticleModel& model) {
    return angular_momentum(model) - glm::cross(mean_position(model), linear_momentum(model));
}

/// Deforms by `map`, applied to positions about the origin.
void deform(ParticleModel& model, const Mat3& map) {
    for (Vec3& x : model.position) {
        x = map * x;
    }
}

Mat3 diagonal(double x, double y, double z) {
    return {Vec3(x, 0.0, 0.0), Vec3(0.0, y, 0.0), Vec3(0.0, 0.0, z)};
}

/// Largest change of the distance of a particle to each other one, m: 0 for any rigid motion, and for a mirrored body.
double largest_change_of_shape(const ParticleModel& model) {
    double largest = 0.0;
    for (std::size_t i = 0; i < model.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            const double now = glm::length(model.position[i] - model.position[j]);
            const double rest = glm::length(model.rest_position[i] - model.rest_position[j]);
            largest = std::max(largest, std::abs(now - rest));
        }
    }
    return largest;
}

/// Sign of the determinant of the affine map from the rest shape: negative for a mirrored body.
bool is_mirrored(const ParticleModel& model) {
    Mat3 moment(0.0);
    const Vec3 centre = mean_position(model);
    for (std::size_t i = 0; i < model.size(); ++i) {
        moment += glm::outerProduct(model.position[i] - centre, model.rest_position[i]);
    }
    return glm::dot(glm::cross(moment[0], moment[1]), moment[2]) < 0.0;
}

TEST(ElasticBodies, AFreeBodyKeepsItsMomenta) {
    const FlushDenormals flush;
    for (const double young : {3e3, 1e6}) {
        ParticleModel model = elastic_block({.young_modulus = young});
        const Vec3 rate(3.0, -2.0, 4.0);  // rad/s
        for (std::size_t i = 0; i < model.size(); ++i) {
            model.position[i].y += 2.0 * model.position[i].x * model.position[i].x;
            model.velocity[i] = Vec3(0.3, -0.2, 0.1) + glm::cross(rate, model.position[i]);
            model.angular_velocity[i] = rate;
        }
        const Vec3 linear = linear_momentum(model);
        const Vec3 spin = spin_of(model);
        ParticleSolver solver(model, elastic_settings());
        for (int i = 0; i < 2000; ++i) {
            solver.step(model, {});
        }
        EXPECT_LT(glm::length(linear_momentum(model) - linear), 1e-9 * glm::length(linear)) << young;
        EXPECT_LT(glm::length(spin_of(model) - spin), 1e-6 * glm::length(spin)) << young;
    }
}

TEST(ElasticBodies, SolvingForPositionsMovesABodyAsACorrectionDoes) {
    // Damping beyond the step's own, even a trace in one element, makes the step a correction of x0, with all pairs.
    ParticleModel by_positions = elastic_block({.young_modulus = 3e4, .damping = 0.002});
    for (std::size_t i = 0; i < by_positions.size(); ++i) {
        by_positions.position[i].y += 2.0 * by_positions.position[i].x * by_positions.position[i].x;
        by_positions.velocity[i] = glm::cross(Vec3(3.0, -2.0, 4.0), by_positions.position[i]);
    }
    ParticleModel by_correction = by_positions;
    by_correction.elasticity.elements[0].damping *= 1.0 + 1e-9;
    SolverSettings settings = elastic_settings(0.002);
    settings.substeps = 1;
    ParticleSolver positions(by_positions, settings);
    ParticleSolver correction(by_correction, settings);
    for (int step = 0; step < 50; ++step) {
        positions.step(by_positions, {});
        correction.step(by_correction, {});
    }
    for (std::size_t i = 0; i < by_positions.size(); ++i) {
        const double apart = glm::length(by_positions.position[i] - by_correction.position[i]);
        ASSERT_LT(apart, 1e-11) << "particle " << i;  // m: rounding of 0.1 m, 50 times
    }
}

/// Kinetic energy of a released block, J, times s: what moves less long is damped more.
double motion_after_release(double step, double damping) {
    ParticleModel model = elastic_block({.young_modulus = 3e3, .damping = damping});
    deform(model, diagonal(1.1, 0.96, 0.96));
    SolverSettings settings = elastic_settings(step);
    settings.substeps = 1;
    ParticleSolver solver(model, settings);
    double sum = 0.0;
    for (double time = 0.0; time < 1.0; time += step) {
        solver.step(model, {});
        sum += step * kinetic_energy(model);
    }
    return sum;
}

TEST(ElasticBodies, TheDampingOfTheStepIsAPartOfTheMaterials) {
    const FlushDenormals flush;
    const double damped = motion_after_release(2.5e-4, 0.005);
    for (const double step : {0.001, 0.0025, 0.005}) {
        EXPECT_NEAR(motion_after_release(step, 0.005), damped, 0.2 * damped) << step;
    }
    // Without damping of the material it is that of the step alone.
    EXPECT_NEAR(motion_after_release(0.005, 0.0), damped, 0.2 * damped);
    EXPECT_GT(motion_after_release(0.001, 0.0), 2.0 * damped);
}

TEST(ElasticBodies, AReleasedBodyNeverMovesFasterThanItHas) {
    const FlushDenormals flush;
    for (const double young : {3e3, 1e6}) {
        for (const double step : {0.001, 0.01}) {
            ParticleModel model = elastic_block({.young_modulus = young});
            deform(model, diagonal(1.2, 0.95, 0.95));
            ParticleSolver solver(model, elastic_settings(step));
            // The first half of a second has many periods of the slowest vibration.
            double first = 0.0;
            double later = 0.0;
            for (double time = 0.0; time < 2.0; time += step) {
                solver.step(model, {});
                double& highest = time < 0.5 ? first : later;
                highest = std::max(highest, kinetic_energy(model));
            }
            EXPECT_GT(first, 0.0);
            EXPECT_LE(later, first) << young << " Pa, " << step << " s";
        }
    }
}

TEST(ElasticBodies, AReleasedBodyNeverHasMoreEnergyThanThatOfItsDeformation) {
    // A uniform stretch of 1 % along x: energy V (mu |e|^2 + lambda / 2 tr(e)^2). Pairs have none.
    const SolidMaterial material{.young_modulus = 3e4};
    ParticleModel model = elastic_block(material);
    const double strain = 0.01;
    deform(model, diagonal(1.0 + strain, 1.0, 1.0));
    double energy = 0.0;
    for (const ElasticElement& e : model.elasticity.elements) {
        energy += e.volume * (e.shear_modulus + 0.5 * e.lame_modulus) * strain * strain;
    }
    ParticleSolver solver(model, elastic_settings());
    double highest = 0.0;
    for (int i = 0; i < 500; ++i) {
        solver.step(model, {});
        highest = std::max(highest, kinetic_energy(model));
        ASSERT_LE(kinetic_energy(model), energy) << "step " << i;
    }
    EXPECT_GT(highest, 0.1 * energy);  // it does vibrate
}

TEST(ElasticBodies, ABodyFallsAsAStone) {
    const FlushDenormals flush;
    ParticleModel solid = elastic_block({.young_modulus = 3e4});
    ParticleModel sheet = elastic_sheet({});
    for (ParticleModel* const model : {&solid, &sheet}) {
        SolverSettings settings = elastic_settings();
        settings.gravity = Vec3(0.0, -9.81, 0.0);
        ParticleSolver solver(*model, settings);
        constexpr int kSteps = 100;
        for (int i = 0; i < kSteps; ++i) {
            solver.step(*model, {});
        }
        // Implicit Euler: after n sub-steps of h, g h^2 n (n + 1) / 2.
        const int n = kSteps * solver.substeps();
        const double h = settings.step / solver.substeps();
        const Vec3 fallen = settings.gravity * (h * h * 0.5 * n * (n + 1.0));
        for (std::size_t i = 0; i < model->size(); ++i) {
            ASSERT_LT(glm::length(model->position[i] - model->rest_position[i] - fallen), 1e-8) << "particle " << i;
        }
    }
}

TEST(ElasticBodies, ACrushedBodyRecoversItsShape) {
    const FlushDenormals flush;
    const SolidMaterial material{.young_modulus = 3e4, .damping = 0.01};
    for (const Mat3& crush : {diagonal(0.05, 0.05, 0.05), diagonal(1.0, 0.0, 1.0), diagonal(4.0, 4.0, 4.0),
                              diagonal(-0.3, 0.3, 0.3), diagonal(1.0, 0.0, 0.0)}) {
        ParticleModel model = elastic_block(material);
        deform(model, crush);
        ParticleSolver solver(model, elastic_settings());
        for (int i = 0; i < 1000; ++i) {
            solver.step(model, {});
        }
        EXPECT_TRUE(is_finite(model));
        EXPECT_LT(largest_change_of_shape(model), 1e-4) << crush[0].x << ' ' << crush[1].y << ' ' << crush[2].z;
        EXPECT_FALSE(is_mirrored(model)) << crush[0].x << ' ' << crush[1].y << ' ' << crush[2].z;
    }
}

TEST(ElasticBodies, AnInvertedBodyRecoversItsShape) {
    const FlushDenormals flush;
    for (const Mat3& inversion : {diagonal(-1.0, 1.0, 1.0), diagonal(-1.0, -1.0, -1.0)}) {
        ParticleModel model = elastic_block({.young_modulus = 3e4, .damping = 0.01});
        deform(model, inversion);
        ParticleSolver solver(model, elastic_settings());
        for (int i = 0; i < 2000; ++i) {
            solver.step(model, {});
        }
        EXPECT_TRUE(is_finite(model));
        EXPECT_LT(largest_change_of_shape(model), 1e-4) << inversion[0].x << ' ' << inversion[1].y;
        EXPECT_FALSE(is_mirrored(model)) << inversion[0].x << ' ' << inversion[1].y;
    }
}

TEST(ElasticBodies, ACrumpledSheetUnfolds) {
    const FlushDenormals flush;
    ParticleModel model = elastic_sheet({.bending_stiffness = 3e-3, .damping = 0.01});
    std::mt19937 random(4);
    std::uniform_real_distribution<double> uniform(-0.02, 0.02);
    for (Vec3& x : model.position) {
        x += Vec3{uniform(random), uniform(random), uniform(random)};
    }
    ParticleSolver solver(model, elastic_settings());
    for (int i = 0; i < 2000; ++i) {
        solver.step(model, {});
    }
    EXPECT_LT(largest_change_of_shape(model), 1e-4);
}

class RespondingBlock : public testing::Test {
  protected:
    /// Displacements, m, by forces, N, one row per particle; a fourth column of zeros.
    std::vector<Row> answer(std::vector<Row> forces) {
        bodies_.prepare(kStep);
        bodies_.respond({0, static_cast<std::uint32_t>(model_.size())}, forces);
        return forces;
    }
    std::vector<Row> random_forces(std::uint32_t seed) const {
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> uniform(-1.0, 1.0);
        std::vector<Row> forces(model_.size());
        for (Row& row : forces) {
            row = {{uniform(random), uniform(random), uniform(random), uniform(random)}};
        }
        return forces;
    }

    static constexpr double kStep = 0.002;  // s
    ParticleModel model_ = elastic_block({.young_modulus = 3e4, .damping = 0.002});
    ElasticBodies bodies_{model_, kWidestLanes};
};

TEST_F(RespondingBlock, AnswersSymmetrically) {
    const std::vector<Row> p = random_forces(1);
    const std::vector<Row> q = random_forces(2);
    const std::vector<Row> by_p = answer(p);
    const std::vector<Row> by_q = answer(q);
    for (std::size_t lane = 0; lane < 4; ++lane) {
        double p_of_q = 0.0;
        double q_of_p = 0.0;
        double p_of_p = 0.0;
        for (std::size_t i = 0; i < p.size(); ++i) {
            p_of_q += p[i].number[lane] * by_q[i].number[lane];
            q_of_p += q[i].number[lane] * by_p[i].number[lane];
            p_of_p += p[i].number[lane] * by_p[i].number[lane];
        }
        EXPECT_GT(p_of_p, 0.0);
        EXPECT_NEAR(p_of_q, q_of_p, 1e-12 * p_of_p);
    }
}

TEST_F(RespondingBlock, MovesItsCentreOfMassByTheForceAlone) {
    const std::vector<Row> forces = random_forces(3);
    const std::vector<Row> moved_by = answer(forces);
    const double mass = total_mass(model_);
    for (std::size_t lane = 0; lane < 4; ++lane) {
        double force = 0.0;
        double centre = 0.0;
        for (std::size_t i = 0; i < forces.size(); ++i) {
            force += forces[i].number[lane];
            centre += model_.mass[i] / mass * moved_by[i].number[lane];
        }
        EXPECT_NEAR(centre, force * kStep * kStep / mass, 1e-10 * kStep * kStep / mass);  // 1 N, rounded
    }
}

TEST_F(RespondingBlock, AnswersAsAStepDoes) {
    // The displacement that a step has with the force and lacks without it.
    std::vector<Row> forces = random_forces(5);
    std::vector<Vec3> force;
    for (Row& row : forces) {
        row.number[3] = 0.0;
        for (double& number : row.number) {
            number *= 1e-3;
        }
        force.emplace_back(row.number[0], row.number[1], row.number[2]);
    }
    const std::vector<Row> expected = answer(forces);
    std::vector<Row> position(model_.size());
    std::vector<Row> orientation(model_.size(), Row{{1.0, 0.0, 0.0, 0.0}});
    for (std::size_t i = 0; i < model_.size(); ++i) {
        const Vec3 given = model_.position[i] + kStep * kStep / model_.mass[i] * force[i];
        position[i] = {{given.x, given.y, given.z, 0.0}};
    }
    bodies_.step({model_, 1.0, position.data(), orientation.data()});
    for (std::size_t i = 0; i < model_.size(); ++i) {
        const Vec3 moved_by(position[i].number[0] - model_.position[i].x, position[i].number[1] - model_.position[i].y,
                            position[i].number[2] - model_.position[i].z);
        const Vec3 by_force(expected[i].number[0], expected[i].number[1], expected[i].number[2]);
        EXPECT_LT(glm::length(moved_by - by_force), 1e-9 * kStep) << "particle " << i;
    }
}

TEST_F(RespondingBlock, AnswersAsBeforeAfterAStepForWhichItCannotBeSolved) {
    const std::vector<Row> forces = random_forces(6);
    const std::vector<Row> before = answer(forces);
    EXPECT_THROW(bodies_.prepare(std::numeric_limits<double>::quiet_NaN()), TooStiff);
    const std::vector<Row> after = answer(forces);
    for (std::size_t i = 0; i < before.size(); ++i) {
        EXPECT_TRUE(std::ranges::equal(before[i].number, after[i].number)) << i;
    }
}

TEST(ElasticBodies, PinnedParticlesDoNotAnswer) {
    ParticleModel model = elastic_block({.young_modulus = 3e4});
    model.pinned[3] = 1;
    ElasticBodies bodies(model, kWidestLanes);
    bodies.prepare(0.002);
    std::vector<Row> columns(model.size(), Row{{1.0, 1.0, 1.0, 1.0}});
    bodies.respond({0, static_cast<std::uint32_t>(model.size())}, columns);
    EXPECT_EQ(columns[3].number[0], 0.0);
    EXPECT_GT(columns[4].number[0], 0.0);
}

TEST(StiffnessFactor, SolvesAsADenseFactorisation) {
    // M M^T + 1 of a sparse M: positive definite.
    constexpr Eigen::Index kSize = 60;
    std::mt19937 random(6);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Eigen::MatrixXd part = Eigen::MatrixXd::Zero(kSize, kSize);
    for (Eigen::Index row = 0; row < kSize; ++row) {
        for (const Eigen::Index column : {row, (row * 7 + 3) % kSize, (row * 11 + 5) % kSize}) {
            part(row, column) += uniform(random);
        }
    }
    const Eigen::MatrixXd matrix = part * part.transpose() + Eigen::MatrixXd::Identity(kSize, kSize);
    std::vector<MatrixElement> lower;
    for (Eigen::Index row = 0; row < kSize; ++row) {
        for (Eigen::Index column = 0; column <= row; ++column) {
            if (matrix(row, column) != 0.0) {
                // Named twice: both halves add up.
                const MatrixElement half{.row = static_cast<std::uint32_t>(row),
                                         .column = static_cast<std::uint32_t>(column),
                                         .stiffness = 0.5 * matrix(row, column)};
                lower.insert(lower.end(), {half, half});
            }
        }
    }
    StiffnessFactor factor(kSize, lower, 2);
    ASSERT_TRUE(factor.factorise(1, 0.5));
    EXPECT_EQ(factor.size(), static_cast<std::size_t>(kSize));
    Eigen::MatrixXd sides(kSize, 4);
    for (Eigen::Index row = 0; row < kSize; ++row) {
        for (Eigen::Index lane = 0; lane < 4; ++lane) {
            sides(row, lane) = uniform(random);
        }
    }
    const Eigen::MatrixXd expected = matrix.llt().solve(sides);
    for (const Kernels* const kernels : usable_kernels()) {
        LaneArray<Row> rows(kSize);
        for (Eigen::Index row = 0; row < kSize; ++row) {
            for (Eigen::Index lane = 0; lane < 4; ++lane) {
                rows[static_cast<std::size_t>(row)].number[lane] = sides(row, lane);
            }
        }
        factor.solve(kernels->elastic, 1, {rows.data(), rows.size()});
        for (Eigen::Index row = 0; row < kSize; ++row) {
            for (Eigen::Index lane = 0; lane < 4; ++lane) {
                EXPECT_NEAR(rows[static_cast<std::size_t>(row)].number[lane], expected(row, lane), 1e-12);
            }
        }
        // Solved beside another right-hand side, three numbers of each keep their bits.
        LaneArray<Row> beside(kSize);
        LaneArray<Row> reversed(kSize);
        for (std::size_t row = 0; row < kSize; ++row) {
            for (std::size_t lane = 0; lane < 4; ++lane) {
                const auto at = static_cast<Eigen::Index>(row);
                beside[row].number[lane] = sides(at, static_cast<Eigen::Index>(lane));
                reversed[row].number[lane] = sides(at, static_cast<Eigen::Index>(3 - lane));
            }
        }
        factor.solve(kernels->elastic, 1, {beside.data(), beside.size()}, {reversed.data(), reversed.size()});
        for (std::size_t row = 0; row < kSize; ++row) {
            for (std::size_t lane = 0; lane < 3; ++lane) {
                EXPECT_EQ(beside[row].number[lane], rows[row].number[lane]);
                EXPECT_EQ(reversed[row].number[lane], rows[row].number[3 - lane]);
            }
            EXPECT_EQ(beside[row].number[3], sides(static_cast<Eigen::Index>(row), 3));
            EXPECT_EQ(reversed[row].number[3], sides(static_cast<Eigen::Index>(row), 0));
        }
    }
}

TEST(StiffnessFactor, RefusesAnIndefiniteMatrix) {
    const auto factorise = [](std::size_t size, const std::vector<MatrixElement>& lower) {
        return StiffnessFactor(size, lower, 1).factorise(0, 0.01);
    };
    const auto element = [](std::uint32_t row, std::uint32_t column, double stiffness) {
        return MatrixElement{.row = row, .column = column, .stiffness = stiffness};
    };
    EXPECT_FALSE(factorise(2, {element(0, 0, 1.0), element(1, 0, 2.0), element(1, 1, 1.0)}));
    EXPECT_FALSE(factorise(2, {element(0, 0, 1.0), element(1, 0, 1.0), element(1, 1, 1.0)}));
    EXPECT_FALSE(factorise(1, {element(0, 0, -1.0)}));
    EXPECT_TRUE(factorise(0, {}));
}

}  // namespace
}  // namespace haptic::sim
