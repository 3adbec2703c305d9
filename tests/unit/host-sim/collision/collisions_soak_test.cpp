// Soak test: bodies thrown together hard, repeatedly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "clouds.hpp"
#include "collision/ellipsoids.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kBodies = 4;
constexpr double kSpeed = 5.0;  // m/s

EllipsoidShape shape_now(const ParticleModel& model, std::size_t i) {
    return shape_of(model.semi_axes[i], model.orientation[i] * model.axes[i]);
}

/// From the corners of a square above the ground toward its centre, each slightly beside it.
ParticleModel thrown(std::uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    ParticleModel model;
    for (std::uint32_t b = 0; b < kBodies; ++b) {
        const double sideways = 0.1 * unit(random);
        const double height = 0.3 + 0.1 * unit(random);
        const double x = b % 2 == 0 ? 1.0 : -1.0;
        const Vec3 corner = b < 2 ? Vec3(x, 0.0, 0.0) : Vec3(0.0, 0.0, x);
        const Vec3 beside(corner.z, 0.0, corner.x);
        model.append(moved(make_cloud({}, 10 * seed + b), 0.4 * corner + sideways * beside + Vec3(0.0, height, 0.0),
                           -kSpeed * corner));
    }
    return model;
}

struct Depths {
    double deepest = 0.0;  // of the distance at which the two would touch; 1: the centres coincide
    double mean = 0.0;     // over overlapping pairs
};

Depths depths(const ParticleModel& model) {
    Depths result;
    int count = 0;
    const auto body_size = static_cast<std::size_t>(model.bodies[0].end);
    for (std::size_t a = 0; a < model.size(); ++a) {
        for (std::size_t b = 0; b < a - a % body_size; ++b) {
            const Vec3 c = model.position[a] - model.position[b];
            if (glm::length(c) > glm::length(model.semi_axes[a]) + glm::length(model.semi_axes[b])) {
                continue;
            }
            const EllipsoidShape first = shape_now(model, a);
            const EllipsoidShape second = shape_now(model, b);
            const Vec3 n = separating_normal({first, second, 1.0, c, c});
            const double depth = 1.0 - glm::dot(n, c) / (reach_of(first, n) + reach_of(second, n));
            if (depth > 0.0) {
                result.deepest = std::max(result.deepest, depth);
                result.mean += depth;
                ++count;
            }
        }
    }
    result.mean /= std::max(count, 1);
    return result;
}

TEST(Collisions, OfFourBodiesThrownTogetherEndWithNoneInsideAnother) {
    const FlushDenormals flush;
    for (std::uint32_t seed = 1; seed <= 40; ++seed) {
        ParticleModel model = thrown(seed);
        ParticleSolver solver(model, {});
        ParticleCollisions collisions(model, {.ground = true, .static_friction = 0.5, .dynamic_friction = 0.4});
        double worst = 0.0;
        for (int step = 0; step < 1000; ++step) {
            solver.step(model, {}, {&collisions});
            ASSERT_TRUE(is_finite(model)) << seed;
            ASSERT_EQ(collisions.counts().dropped, 0u) << seed;
            if (step < 100 || step % 50 == 0) {
                worst = std::max(worst, depths(model).deepest);
            }
            for (std::size_t i = 0; i < model.size(); ++i) {
                // A body that rotates within a step may touch the ground with another end than the one that was
                // stopped.
                ASSERT_GT(model.position[i].y, 0.0) << seed << " at step " << step;
                ASSERT_GT(model.position[i].y - std::sqrt(shape_now(model, i).yy), -8e-3) << seed;
            }
        }
        const Depths end = depths(model);
        EXPECT_LT(worst, 0.7) << seed;  // for a moment; which pair comes first decides: 0.62 in one of the forty
        EXPECT_LT(end.deepest, 0.2) << seed;
        EXPECT_LT(kinetic_energy(model), 0.02) << seed;
        RecordProperty("worst_" + std::to_string(seed), std::to_string(worst));
    }
}

}  // namespace
}  // namespace haptic::sim
