// Random body with as many particles and as large groups as the thesis' fish.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "haptic/sim/particles.hpp"

namespace haptic::sim {

inline constexpr std::size_t kParticles = 137;  // as in the thesis' fish
inline constexpr std::size_t kMembers = 9;

/// Particles of different masses at random positions in an ellipsoid 0.3 m long, each in a group with its eight
/// nearest.
inline ParticleModel strewn_body(std::uint32_t seed, double stiffness) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    ParticleModel model;
    while (model.size() < kParticles) {
        const double x = uniform(random);
        const double y = uniform(random);
        const double z = uniform(random);
        const Vec3 at(0.15 * x, 0.04 * y, 0.02 * z);
        const auto near = [&](const Vec3& other) { return glm::length(other - at) < 0.008; };
        if (x * x + y * y + z * z < 1.0 && std::none_of(model.position.begin(), model.position.end(), near)) {
            model.add(at, 0.002 * (1.5 + x), 0.01);
        }
    }
    for (std::uint32_t centre = 0; centre < kParticles; ++centre) {
        std::vector<std::uint32_t> nearest(kParticles);
        for (std::uint32_t i = 0; i < kParticles; ++i) {
            nearest[i] = i;
        }
        const auto distance = [&](std::uint32_t i) { return glm::length(model.position[i] - model.position[centre]); };
        std::partial_sort(nearest.begin(), nearest.begin() + kMembers, nearest.end(),
                          [&](std::uint32_t a, std::uint32_t b) { return distance(a) < distance(b); });
        nearest.resize(kMembers);
        model.groups.push_back({centre, nearest, stiffness});
    }
    return model;
}

}  // namespace haptic::sim
