#include "haptic/sim/skin.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <vector>

#include "dynamics/rotation.hpp"
#include "haptic/sim/fish.hpp"
#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {
namespace {

const DeformableBody& fish() {
    static const DeformableBody body = build_body(make_fish_mesh({}), {});
    return body;
}

std::vector<Vec3> skinned(const DeformableBody& body, const ParticleModel& model, bool wide = true) {
    std::vector<Vec3> vertices(body.mesh.vertices.size());
    Skinner(body.mesh.vertices, body.particles, body.skin, wide).skin_vertices(model, vertices);
    return vertices;
}

/// Smallest and largest ratio of an edge's length to its rest length.
std::pair<double, double> stretch_of(const TriangleMesh& mesh, const std::vector<Vec3>& vertices) {
    double smallest = std::numeric_limits<double>::infinity();
    double largest = 0.0;
    for (const Triangle& t : mesh.triangles) {
        for (std::size_t e = 0; e < 3; ++e) {
            const std::uint32_t a = t[e];
            const std::uint32_t b = t[(e + 1) % 3];
            const double ratio =
                glm::length(vertices[a] - vertices[b]) / glm::length(mesh.vertices[a] - mesh.vertices[b]);
            smallest = std::min(smallest, ratio);
            largest = std::max(largest, ratio);
        }
    }
    return {smallest, largest};
}

/// The fish's particles bent about y into an arc of `angle` radians over its length.
ParticleModel bent_fish(double angle) {
    ParticleModel model = fish().particles;
    const double curvature = angle / 0.3;
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3 p = model.rest_position[i];
        const double turn = curvature * p.x;
        const Vec3 outward(-std::sin(turn), 0.0, std::cos(turn));
        const Vec3 centre_line(std::sin(turn) / curvature, p.y, (1.0 - std::cos(turn)) / curvature);
        model.position[i] = centre_line + p.z * outward;
        model.orientation[i] = Quat(std::cos(0.5 * turn), 0.0, -std::sin(0.5 * turn), 0.0);
    }
    return model;
}

TEST(Skin, FollowsARigidMotionExactly) {
    const Quat turn = glm::normalize(Quat(0.3, -0.5, 0.7, 0.2));
    const Vec3 shift(1.0, -2.0, 0.5);
    ParticleModel model = fish().particles;
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i] = shift + to_matrix(turn) * model.rest_position[i];
        model.orientation[i] = turn;
    }
    const std::vector<Vec3> vertices = skinned(fish(), model);
    for (std::size_t j = 0; j < vertices.size(); ++j) {
        EXPECT_LT(glm::length(vertices[j] - (shift + to_matrix(turn) * fish().mesh.vertices[j])), 1e-12);
    }
}

TEST(Skin, IsTheBlendOfItsParticles) {
    const ParticleModel model = bent_fish(2.0);
    const std::vector<Vec3> vertices = skinned(fish(), model);
    for (std::size_t j = 0; j < vertices.size(); ++j) {
        Vec3 expected(0.0);
        for (std::size_t k = 0; k < SkinVertex::kMax; ++k) {
            const std::uint32_t i = fish().skin[j].particle[k];
            expected +=
                fish().skin[j].weight[k] * (model.position[i] + to_matrix(model.orientation[i]) *
                                                                    (fish().mesh.vertices[j] - model.rest_position[i]));
        }
        EXPECT_LT(glm::length(vertices[j] - expected), 1e-15);
    }
}

TEST(Skin, HasTheSameBitsForAnyRegisterWidth) {
    const ParticleModel model = bent_fish(1.0);
    EXPECT_EQ(skinned(fish(), model, true), skinned(fish(), model, false));
}

TEST(Skin, BendsWithoutTearsOrSpikes) {
    // The bend alone stretches outer edges by up to 1 + angle * 0.04 / 0.3: 1.3 at 2.2 radians.
    for (const double angle : {0.5, 1.0, 2.2, -2.2}) {
        const auto [smallest, largest] = stretch_of(fish().mesh, skinned(fish(), bent_fish(angle)));
        EXPECT_GT(smallest, 1.0 - 0.15 * std::abs(angle)) << angle;
        EXPECT_LT(largest, 1.0 + 0.15 * std::abs(angle)) << angle;
    }
}

TEST(Skin, StaysSmoothWhereShapeMatchingBendsTheFish) {
    // The middle is fixed. The tail, 0.08 m away, moves 0.06 m to the side within 0.15 s and back, without rotating. At
    // the turning point their straight distance is 1.25 times that at rest.
    ParticleModel model = fish().particles;
    std::vector<std::uint32_t> led;
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        const double x = model.rest_position[i].x;
        model.pinned[i] = std::abs(x) < 0.02 || x < -0.10 ? 1 : 0;
        if (x < -0.10) {
            led.push_back(i);
        }
    }
    ParticleSolver solver(model, {.step = 0.005, .iterations = 5, .gravity = Vec3(0.0), .shape_damping = 5.0});
    Skinner skinner(fish().mesh.vertices, fish().particles, fish().skin);
    std::vector<Vec3> vertices(fish().mesh.vertices.size());
    double smallest = 1.0;
    double largest = 1.0;
    double farthest = 0.0;
    for (int step = 0; step < 120; ++step) {
        const double phase = static_cast<double>(step % 60) / 30.0;
        const double speed = phase < 1.0 ? 0.06 / 0.15 : -0.06 / 0.15;
        for (const std::uint32_t i : led) {
            model.velocity[i] = Vec3(0.0, 0.0, speed);
        }
        solver.step(model, {});
        skinner.skin_vertices(model, vertices);
        const auto [shortest, longest] = stretch_of(fish().mesh, vertices);
        smallest = std::min(smallest, shortest);
        largest = std::max(largest, longest);
        for (const Vec3& p : vertices) {
            farthest = std::max(farthest, p.z);
        }
    }
    EXPECT_GT(farthest, 0.055);
    EXPECT_LT(largest, 2.5);
    EXPECT_GT(smallest, 0.25);
}

TEST(Skin, OfOneVertexPerParticleCopiesPositions) {
    const std::vector<Vec3> rest{{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}};
    ParticleModel model;
    model.add(rest[0], 1.0, 0.1);
    model.add(rest[1], 1.0, 0.1);
    Skinner skinner(rest, model, skin_of_particles(2));
    model.position = {{0.1, 0.2, 0.3}, {-0.4, 0.5, 1e-300}};
    std::vector<Vec3> vertices(2);
    skinner.skin_vertices(model, vertices);
    EXPECT_EQ(vertices, model.position);
}

TEST(Skin, UpdatesOnlyTheBodyThatHasMoved) {
    ParticleModel model = fish().particles;
    model.append(fish().particles);
    std::vector<Vec3> rest = fish().mesh.vertices;
    const std::size_t half = rest.size();
    rest.insert(rest.end(), fish().mesh.vertices.begin(), fish().mesh.vertices.end());
    Skin skin = fish().skin;
    for (SkinVertex vertex : fish().skin) {
        for (std::uint32_t& carrier : vertex.particle) {
            carrier += static_cast<std::uint32_t>(fish().particles.size());
        }
        skin.push_back(vertex);
    }
    Skinner skinner(rest, model, skin);
    const Skinner::Part first{0, half, 0, fish().particles.size()};
    const Skinner::Part second{half, half, fish().particles.size(), fish().particles.size()};
    EXPECT_TRUE(skinner.has_moved(model, first)) << "it was never placed";
    std::vector<Vec3> vertices(rest.size(), Vec3(7.0));
    skinner.skin_vertices(model, first, vertices);
    EXPECT_EQ(vertices[half], Vec3(7.0));
    EXPECT_TRUE(skinner.has_moved(model, second));
    skinner.skin_vertices(model, second, vertices);
    EXPECT_FALSE(skinner.has_moved(model, first) || skinner.has_moved(model, second));
    model.position[second.first_particle + 3].y += 0.01;
    model.orientation[2] = turned(model.orientation[2], Vec3(0.0, 0.1, 0.0));
    EXPECT_TRUE(skinner.has_moved(model, first) && skinner.has_moved(model, second));
    skinner.skin_vertices(model, first, vertices);
    skinner.skin_vertices(model, second, vertices);
    std::vector<Vec3> whole(rest.size());
    Skinner(rest, model, skin, false).skin_vertices(model, whole);
    EXPECT_EQ(vertices, whole);
}

TEST(Skin, RefusesInvalidWeights) {
    const std::vector<Vec3> rest{{0.0, 0.0, 0.0}};
    ParticleModel model;
    model.add(rest[0], 1.0, 0.1);
    Skin skin = skin_of_particles(1);
    skin[0].weight[0] = 0.9;
    EXPECT_THROW(Skinner(rest, model, skin), std::invalid_argument);
    skin[0].weight = {1.5, -0.5, 0.0, 0.0};
    EXPECT_THROW(Skinner(rest, model, skin), std::invalid_argument);
    skin = skin_of_particles(1);
    skin[0].particle[2] = 1;
    EXPECT_THROW(Skinner(rest, model, skin), std::invalid_argument);
    EXPECT_THROW(Skinner(rest, model, skin_of_particles(2)), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
