// Elements and pairs of bodies with a material: they vanish at rest, differentiate exactly, and have the energy of a
// bent sheet.
#include "haptic/sim/elasticity.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/rotation.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/model_builder.hpp"

namespace haptic::sim {
namespace {

using Places = std::vector<Vec3>;

constexpr double kRounding = 1e-10;  // relative, of sums over some ten thousand terms
// Gradients of a fit that its members hardly determine: its ridge of 1e-12, divided by the smallest eigenvalue.
constexpr double kFitted = 1e-7;

const SolidMaterial kSoft{.young_modulus = 3e4, .poisson_ratio = 0.4, .density = 1000.0};

TriangleMesh block_mesh(std::uint32_t cells = 12) {
    return make_block_mesh({.size = {0.12, 0.06, 0.08}, .cells = cells});
}

ParticleModel block_of(std::size_t particles, std::size_t neighbours) {
    const TriangleMesh mesh = block_mesh();
    BuilderSettings settings;
    settings.particles = particles;
    settings.neighbours = neighbours;
    settings.mass = kSoft.density * 0.12 * 0.06 * 0.08;
    return build_body(mesh, settings).particles;
}

Elasticity solid_of_block(const ParticleModel& model, const SolidMaterial& material = kSoft) {
    return make_solid(model, std::vector<SolidMaterial>(model.size(), material));
}

struct Sheet {
    TriangleMesh mesh;
    ParticleModel model;
};

Sheet square(std::uint32_t vertices_per_side, double side = 1.0) {
    const ClothShape shape{.vertices_per_side = vertices_per_side, .side = side, .mass = 0.1};
    return {make_cloth_mesh(shape), make_cloth_particles(shape, 0.3, 1.0)};
}

Elasticity elasticity_of(const Sheet& sheet, const SheetMaterial& material) {
    return make_sheet(sheet.model, sheet.mesh, std::vector<SheetMaterial>(sheet.model.size(), material));
}

/// sum x_i b_i^T
Eigen::Matrix3d deformation_gradient(const ElasticElement& element, const Places& at) {
    Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
    for (std::size_t k = 0; k < element.members.size(); ++k) {
        const Vec3& x = at[element.members[k]];
        const Vec3& b = element.gradient[k];
        gradient += Eigen::Vector3d(x.x, x.y, x.z) * Eigen::RowVector3d(b.x, b.y, b.z);
    }
    return gradient;
}

/// The strain of elasticity.hpp, with the nearest rotation by the singular values.
Eigen::Matrix3d strain_of(const ElasticElement& element, const Places& at) {
    const Eigen::Matrix3d gradient = deformation_gradient(element, at);
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(gradient, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
    sign(2, 2) = svd.matrixU().determinant() * svd.matrixV().determinant() > 0.0 ? 1.0 : -1.0;
    const Eigen::Matrix3d turned = (svd.matrixU() * sign * svd.matrixV().transpose()).transpose() * gradient;
    Eigen::Matrix3d spread;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            spread(row, column) = element.spread[column][row];
        }
    }
    return 0.5 * (turned + turned.transpose()) - spread;
}

double largest_strain(const Elasticity& elasticity, const Places& at) {
    double largest = 0.0;
    for (const ElasticElement& element : elasticity.elements) {
        largest = std::max(largest, strain_of(element, at).norm());
    }
    return largest;
}

double pair_energy(const Elasticity& elasticity, const Places& at) {
    double energy = 0.0;
    for (const ElasticPair& pair : elasticity.pairs) {
        const Vec3 between = at[pair.first] - at[pair.second];
        energy += 0.5 * pair.stiffness * glm::dot(between, between);
    }
    return energy;
}

/// The energy if no pair had the opposite sign of another: the scale of rounding.
double absolute_pair_energy(const Elasticity& elasticity, const Places& at) {
    double energy = 0.0;
    for (const ElasticPair& pair : elasticity.pairs) {
        const Vec3 between = at[pair.first] - at[pair.second];
        energy += 0.5 * std::abs(pair.stiffness) * glm::dot(between, between);
    }
    return energy;
}

/// Largest force of the pairs on a particle, relative to the largest one that a single pair has.
double largest_pair_force(const Elasticity& elasticity, const Places& at) {
    Places force(at.size(), Vec3(0.0));
    double single = 0.0;
    for (const ElasticPair& pair : elasticity.pairs) {
        const Vec3 pull = pair.stiffness * (at[pair.second] - at[pair.first]);
        force[pair.first] += pull;
        force[pair.second] -= pull;
        single = std::max(single, glm::length(pull));
    }
    double largest = 0.0;
    for (const Vec3& f : force) {
        largest = std::max(largest, glm::length(f));
    }
    return largest / single;
}

Places moved(const Places& rest, const std::function<Vec3(const Vec3&)>& map) {
    Places at;
    at.reserve(rest.size());
    std::transform(rest.begin(), rest.end(), std::back_inserter(at), map);
    return at;
}

Vec3 rigidly(const Vec3& p) {
    return to_matrix(turned(Quat(1.0, 0.0, 0.0, 0.0), Vec3(0.7, -1.9, 2.3))) * p + Vec3(0.4, -0.2, 0.9);
}

Vec3 affinely(const Vec3& p) {
    return {1.3 * p.x + 0.2 * p.y - 0.1, 0.4 * p.x + 0.8 * p.y + 0.3 * p.z, -0.5 * p.y + 1.1 * p.z + 0.2};
}

void expect_neutral(const Elasticity& elasticity, const Places& rest) {
    for (const Places& at : {rest, moved(rest, rigidly)}) {
        EXPECT_LT(largest_strain(elasticity, at), kFitted);
        EXPECT_LT(largest_pair_force(elasticity, at), kFitted);
        EXPECT_LT(std::abs(pair_energy(elasticity, at)), kFitted * absolute_pair_energy(elasticity, at));
    }
    EXPECT_LT(largest_pair_force(elasticity, moved(rest, affinely)), kFitted);
}

std::string elasticity_refusal(const std::function<void()>& make) {
    try {
        make();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "accepted";
}

TEST(Elasticity, ASolidHasNeitherEnergyNorForcesAtRestAndAfterARigidMotion) {
    const ParticleModel model = block_of(200, 16);
    expect_neutral(solid_of_block(model), model.rest_position);
}

TEST(Elasticity, ASheetHasNeitherEnergyNorForcesAtRestAndAfterARigidMotion) {
    const Sheet sheet = square(17);
    expect_neutral(elasticity_of(sheet, {}), sheet.model.rest_position);
}

TEST(Elasticity, GradientsReproduceLinearDisplacements) {
    Eigen::Matrix3d expected;
    expected << 1.3, 0.2, 0.0, 0.4, 0.8, 0.3, 0.0, -0.5, 1.1;
    for (const std::size_t neighbours : {8u, 16u, 32u}) {
        const ParticleModel model = block_of(200, neighbours);
        const Places at = moved(model.rest_position, affinely);
        for (const ElasticElement& element : solid_of_block(model).elements) {
            EXPECT_LT((deformation_gradient(element, at) - expected).norm(), kFitted);
        }
    }
    const Sheet sheet = square(9);
    const Places at = moved(sheet.model.rest_position, affinely);
    for (const ElasticElement& element : elasticity_of(sheet, {}).elements) {
        // Across the sheet, y, a triangle sees nothing.
        Eigen::Matrix3d in_plane = expected;
        in_plane.col(1).setZero();
        EXPECT_LT((deformation_gradient(element, at) - in_plane).norm(), kRounding);
    }
}

/// Largest sum of V b over the elements, m^2, of the particles that are farther than `depth` from the block's surface.
double largest_sum_inside(const ParticleModel& model, const Elasticity& elasticity, double depth) {
    Places sum(model.size(), Vec3(0.0));
    for (const ElasticElement& element : elasticity.elements) {
        for (std::size_t k = 0; k < element.members.size(); ++k) {
            sum[element.members[k]] += element.volume * element.gradient[k];
        }
    }
    double largest = 0.0;
    for (std::size_t i = 0; i < sum.size(); ++i) {
        const Vec3 to_faces = Vec3(0.06, 0.03, 0.04) - glm::abs(model.rest_position[i]);
        if (std::min({to_faces.x, to_faces.y, to_faces.z}) > depth) {
            largest = std::max(largest, glm::length(sum[i]));
        }
    }
    return largest;
}

TEST(Elasticity, ABalancedSolidPushesOnItsSurfaceAlone) {
    // Divergence theorem: an inner particle has no part of the surface. Its neighbours may have one by their elements.
    const ParticleModel model = block_of(1500, 16);
    constexpr double kDepth = 0.022;  // m, three particles
    Elasticity solid = solid_of_block(model);
    const double before = largest_sum_inside(model, solid, kDepth);
    balance_surface(model, block_mesh(), solid);
    const double after = largest_sum_inside(model, solid, kDepth);
    EXPECT_GT(before, 1e-6);  // m^2; a particle's cell is 5e-5 m^2 wide
    EXPECT_LT(after, 1e-2 * before);
    // Affine displacements stay exact.
    Eigen::Matrix3d expected;
    expected << 1.3, 0.2, 0.0, 0.4, 0.8, 0.3, 0.0, -0.5, 1.1;
    const Places at = moved(model.rest_position, affinely);
    for (const ElasticElement& element : solid.elements) {
        EXPECT_LT((deformation_gradient(element, at) - expected).norm(), 1e-6);
    }
}

TEST(Elasticity, ABalanceDoesNotDependOnTheTrianglesOfTheMesh) {
    const ParticleModel model = block_of(300, 16);
    Elasticity coarse = solid_of_block(model);
    Elasticity fine = coarse;
    balance_surface(model, block_mesh(2), coarse);
    balance_surface(model, block_mesh(24), fine);
    for (std::size_t e = 0; e < fine.elements.size(); ++e) {
        for (std::size_t k = 0; k < fine.elements[e].gradient.size(); ++k) {
            const Vec3& gradient = fine.elements[e].gradient[k];
            EXPECT_LT(glm::length(coarse.elements[e].gradient[k] - gradient), 5.0) << e;  // 1/m, of up to 40
        }
    }
}

TEST(Elasticity, GradientsReproduceQuadraticDisplacementsWithEnoughNeighbours) {
    // Curvatures of 1/m: a linear fit would be wrong by the order of the members' distance, 0.02. The quadratic one has
    // a ridge of 1e-5 of the members' weights, which leaves up to a hundredth of that.
    const ParticleModel model = block_of(300, 32);
    const auto curved = [](const Vec3& p) {
        return p + Vec3(0.5 * p.x * p.x - p.y * p.z, p.x * p.y + 0.5 * p.z * p.z, p.x * p.z - 0.5 * p.y * p.y);
    };
    const Places at = moved(model.rest_position, curved);
    for (const ElasticElement& element : solid_of_block(model).elements) {
        const Vec3& p = model.rest_position[element.centre];
        Eigen::Matrix3d expected;
        expected << 1.0 + p.x, -p.z, -p.y, p.y, 1.0 + p.x, p.z, p.z, -p.y, 1.0 + p.x;
        EXPECT_LT((deformation_gradient(element, at) - expected).norm(), 2e-4);
    }
}

TEST(Elasticity, VolumesOfElementsFillTheBody) {
    const ParticleModel model = block_of(200, 16);
    double volume = 0.0;
    for (const ElasticElement& element : solid_of_block(model).elements) {
        volume += element.volume;
    }
    EXPECT_NEAR(volume, 0.12 * 0.06 * 0.08, 1e-12);
    double area = 0.0;
    for (const ElasticElement& element : elasticity_of(square(17, 0.5), {}).elements) {
        area += element.volume;  // a double-faced mesh counts once
    }
    EXPECT_NEAR(area, 0.25, 1e-12);
}

TEST(Elasticity, PairsOfASolidResistWhatIsNotAffine) {
    const ParticleModel model = block_of(200, 16);
    const Elasticity solid = solid_of_block(model);
    const Places bent = moved(model.rest_position, [](const Vec3& p) { return p + Vec3(0.0, 2.0 * p.x * p.x, 0.0); });
    EXPECT_GT(pair_energy(solid, bent), 0.0);
    // A pattern of the size of two particles, which strains may not see.
    Places uneven = model.rest_position;
    for (std::size_t i = 0; i < uneven.size(); ++i) {
        uneven[i].y += i % 2 == 0 ? 1e-3 : -1e-3;
    }
    EXPECT_GT(pair_energy(solid, uneven), 0.0);
}

TEST(Elasticity, ASheetOnACylinderHasTheEnergyOfItsCurvature) {
    const SheetMaterial material{.bending_stiffness = 2e-3};
    const Sheet sheet = square(65);
    const Elasticity elasticity = elasticity_of(sheet, material);
    for (const double radius : {1.0, 3.0}) {
        for (const bool along_x : {true, false}) {
            const Places at = moved(sheet.model.rest_position, [&](const Vec3& p) {
                const double angle = (along_x ? p.x : p.z) / radius;
                const double across = radius * std::sin(angle);
                const double up = radius * (1.0 - std::cos(angle));
                return along_x ? Vec3(across, up, p.z) : Vec3(p.x, up, across);
            });
            const double expected = 0.5 * material.bending_stiffness / (radius * radius);  // an area of 1 m^2
            EXPECT_NEAR(pair_energy(elasticity, at), expected, 0.03 * expected) << radius << " m";
        }
    }
}

TEST(Elasticity, ASheetWithoutBendingStiffnessFoldsFreely) {
    const Sheet sheet = square(9);
    for (const ElasticPair& pair : elasticity_of(sheet, {.bending_stiffness = 0.0}).pairs) {
        EXPECT_EQ(pair.stiffness, 0.0);
    }
}

TEST(Elasticity, NoTwoPairsJoinTheSameParticles) {
    const ParticleModel model = block_of(120, 16);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> joined;
    for (const ElasticPair& pair : solid_of_block(model).pairs) {
        joined.emplace_back(std::min(pair.first, pair.second), std::max(pair.first, pair.second));
    }
    std::sort(joined.begin(), joined.end());
    EXPECT_EQ(std::adjacent_find(joined.begin(), joined.end()), joined.end());
}

TEST(Elasticity, ResolvedStepFollowsTheSpeedOfSound) {
    ParticleModel model = block_of(120, 16);
    model.elasticity = solid_of_block(model);
    const double soft = resolved_step(model);
    SolidMaterial stiff = kSoft;
    stiff.young_modulus *= 100.0;
    model.elasticity = solid_of_block(model, stiff);
    EXPECT_NEAR(resolved_step(model), 0.1 * soft, 1e-9 * soft);
    model.elasticity = {};
    EXPECT_EQ(resolved_step(model), std::numeric_limits<double>::infinity());
}

TEST(Elasticity, RefusesBadMaterialsAndBodiesThatDoNotFit) {
    const ParticleModel model = block_of(60, 16);
    SolidMaterial negative = kSoft;
    negative.young_modulus = -1.0;
    EXPECT_NE(elasticity_refusal([&] { (void)solid_of_block(model, negative); }).find("young_modulus"),
              std::string::npos);
    const std::vector<SolidMaterial> too_few(model.size() - 1, kSoft);
    EXPECT_NE(elasticity_refusal([&] { (void)make_solid(model, too_few); }).find("material for each particle"),
              std::string::npos);
    ParticleModel loose = model;
    loose.groups.clear();
    EXPECT_NE(elasticity_refusal([&] { (void)solid_of_block(loose); }).find("groups"), std::string::npos);
    ParticleModel alone = model;
    alone.groups[5].members = {alone.groups[5].centre};
    EXPECT_NE(elasticity_refusal([&] { (void)solid_of_block(alone); }).find("no neighbours"), std::string::npos);
    const Sheet sheet = square(9);
    EXPECT_NE(elasticity_refusal([&] {
                  (void)elasticity_of(sheet, {.membrane_stiffness = -1.0});
              }).find("membrane_stiffness"),
              std::string::npos);
    Sheet coarse = sheet;
    coarse.model = model;
    EXPECT_NE(elasticity_refusal([&] { (void)elasticity_of(coarse, {}); }).find("each vertex"), std::string::npos);
    Sheet flat = sheet;
    flat.model.rest_position[flat.mesh.triangles[3][0]] = flat.model.rest_position[flat.mesh.triangles[3][1]];
    EXPECT_NE(elasticity_refusal([&] { (void)elasticity_of(flat, {}); }).find("no area"), std::string::npos);
}

}  // namespace
}  // namespace haptic::sim
