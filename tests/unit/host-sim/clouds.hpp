// Bodies of random ellipsoids, for tests of collisions.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numeric>
#include <random>
#include <vector>

#include "dynamics/rotation.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {

struct Cloud {
    Vec3 semi_axes{0.15, 0.05, 0.025};  // m, of the whole body
    std::size_t particles = 137;
    std::size_t neighbours = 8;
    double stiffness = 0.9;
    double mass = 0.3;  // kg, of the whole body
};

/// Particles evenly spread over an ellipsoid. Each is a randomly rotated ellipsoid that slightly overlaps its nearest
/// neighbours, in a shape-matching group with them.
inline ParticleModel make_cloud(const Cloud& cloud, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const auto vector = [&] {
        const double x = unit(random), y = unit(random), z = unit(random);
        return Vec3(x, y, z);
    };
    const auto point_inside = [&] {
        Vec3 p = vector();
        while (glm::dot(p, p) > 1.0) {
            p = vector();
        }
        return p * cloud.semi_axes;
    };
    // Best-candidate sampling: of many random points, the farthest from all earlier ones.
    std::vector<Vec3> points;
    double spacing = 0.0;
    while (points.size() < cloud.particles) {
        Vec3 best(0.0);
        double best_distance = -1.0;
        for (int k = 0; k < 60; ++k) {
            const Vec3 p = point_inside();
            double distance = 1e9;
            for (const Vec3& q : points) {
                distance = std::min(distance, glm::length(p - q));
            }
            if (distance > best_distance) {
                best = p;
                best_distance = distance;
            }
        }
        points.push_back(best);
        spacing = best_distance;
    }
    ParticleModel model;
    for (const Vec3& p : points) {
        model.add(p, cloud.mass / static_cast<double>(cloud.particles), 0.5 * spacing);
        const double a = 0.6 + 0.2 * unit(random);
        model.semi_axes.back() = spacing * Vec3(a, 0.6 + 0.2 * unit(random), 0.6);
        model.axes.back() = turned(Quat(1.0, 0.0, 0.0, 0.0), 2.0 * vector());
    }
    std::vector<std::uint32_t> order(points.size());
    for (std::uint32_t i = 0; i < points.size(); ++i) {
        std::iota(order.begin(), order.end(), 0u);
        std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
            return glm::length(points[a] - points[i]) < glm::length(points[b] - points[i]);
        });
        const std::size_t count = std::min(order.size(), cloud.neighbours + 1);
        model.groups.push_back(
            {i, {order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count)}, cloud.stiffness});
    }
    return model;
}

/// Translates a model and sets its velocity.
inline ParticleModel moved(ParticleModel model, const Vec3& by, const Vec3& velocity) {
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i] += by;
        model.rest_position[i] += by;
        model.velocity[i] = velocity;
    }
    return model;
}

}  // namespace haptic::sim
