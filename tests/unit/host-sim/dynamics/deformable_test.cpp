#include "haptic/sim/deformable.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "dynamics/rotation.hpp"
#include "haptic/sim/cloth.hpp"

namespace haptic::sim {
namespace {

DeformableBody small_cloth() {
    const ClothShape shape{.vertices_per_side = 5, .side = 0.2, .mass = 0.01};
    DeformableBody body;
    body.mesh = make_cloth_mesh(shape);
    body.particles = make_cloth_particles(shape, 0.5, 1.0);
    body.skin = skin_of_particles(body.mesh.vertices.size());
    return body;
}

// 30 degrees about z: cos(15), sin(15).
const Placement kAside{{1.0, 2.0, 3.0}, {0.9659258262890683, 0.0, 0.0, 0.25881904510252074}, {0.0, -1.0, 0.5}};

TEST(Placement, TransformsSurfaceParticlesAndMotions) {
    DeformableBody body = small_cloth();
    body.particles.pinned[0] = 1;
    body.motions.push_back({{0}, {0.0, 1.0}, {Vec3(0.0), Vec3(0.1, 0.0, 0.0)}, false});
    const DeformableBody before = body;
    place(body, kAside);
    const auto expected = [](const Vec3& p) {
        const double c = std::sqrt(3.0) / 2.0;
        return Vec3(1.0 + c * p.x - 0.5 * p.y, 2.0 + 0.5 * p.x + c * p.y, 3.0 + p.z);
    };
    for (std::size_t i = 0; i < body.particles.size(); ++i) {
        const Vec3 where = expected(before.particles.position[i]);
        EXPECT_LT(glm::length(body.particles.position[i] - where), 1e-14);
        EXPECT_EQ(body.particles.position[i], body.particles.rest_position[i]);
        EXPECT_EQ(body.particles.position[i], body.mesh.vertices[i]);
    }
    EXPECT_EQ(body.particles.velocity[1], kAside.velocity);
    EXPECT_EQ(body.particles.velocity[0], Vec3(0.0)) << "a pinned particle was set in motion";
    EXPECT_LT(glm::length(body.motions[0].offsets[1] - Vec3(0.1 * std::sqrt(3.0) / 2.0, 0.05, 0.0)), 1e-15);
}

TEST(Motion, InterpolatesItsOffsetsAndHoldsTheLast) {
    const Motion motion{{0}, {0.0, 1.0, 3.0}, {Vec3(0.0), Vec3(0.0, 2.0, 0.0), Vec3(0.0, 0.0, 4.0)}, false};
    EXPECT_EQ(offset_at(motion, 0.0), Vec3(0.0));
    EXPECT_EQ(offset_at(motion, 0.5), Vec3(0.0, 1.0, 0.0));
    EXPECT_EQ(offset_at(motion, 2.0), Vec3(0.0, 1.0, 2.0));
    EXPECT_EQ(offset_at(motion, 100.0), Vec3(0.0, 0.0, 4.0));
}

TEST(Motion, IsPeriodicIfItRepeats) {
    const Motion motion{{0}, {0.0, 1.0, 2.0}, {Vec3(0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0)}, true};
    for (const double whole : {0.0, 2.0, 20.0}) {
        EXPECT_LT(glm::length(offset_at(motion, whole + 0.25) - Vec3(0.0, 0.25, 0.0)), 1e-13);
        EXPECT_LT(glm::length(offset_at(motion, whole + 1.5) - Vec3(0.0, 0.5, 0.0)), 1e-13);
    }
}

TEST(ParticleModel, AppendsBodiesWithTheirGroupsAndLinks) {
    const DeformableBody body = small_cloth();
    ParticleModel both;
    both.append(body.particles);
    both.append(body.particles);
    both.check();
    const auto n = static_cast<std::uint32_t>(body.particles.size());
    ASSERT_EQ(both.size(), 2 * n);
    ASSERT_EQ(both.bodies.size(), 2u);
    EXPECT_EQ(both.bodies[1].begin, n);
    EXPECT_EQ(both.bodies[1].end, 2 * n);
    EXPECT_EQ(both.groups.back().centre, body.particles.groups.back().centre + n);
    EXPECT_EQ(both.links.back().second, body.particles.links.back().second + n);
}

TEST(ParticleModel, RefusesBodiesThatDoNotCoverAllParticles) {
    ParticleModel model = small_cloth().particles;
    model.bodies = {{0, 10}, {12, 25}};
    EXPECT_THROW(model.check(), std::invalid_argument);
    model.bodies = {{0, 10}};
    EXPECT_THROW(model.check(), std::invalid_argument);
    model.bodies = {{0, 10}, {10, 25}};
    EXPECT_NO_THROW(model.check());
}

}  // namespace
}  // namespace haptic::sim
