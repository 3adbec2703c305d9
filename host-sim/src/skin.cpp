#include "haptic/sim/skin.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "haptic/sim/rotation.hpp"

namespace haptic::sim {
namespace {

void check(const SkinVertex& vertex, std::size_t index, std::size_t particles) {
    const auto refuse = [index](const std::string& why) {
        throw std::invalid_argument("skin: vertex " + std::to_string(index) + " " + why);
    };
    double sum = 0.0;
    for (std::size_t k = 0; k < SkinVertex::kMost; ++k) {
        if (vertex.particle[k] >= particles) {
            refuse("is carried by particle " + std::to_string(vertex.particle[k]) + ", of " +
                   std::to_string(particles));
        }
        if (!(vertex.weight[k] >= 0.0)) {
            refuse("has a weight below 0");
        }
        sum += vertex.weight[k];
    }
    if (!(std::abs(sum - 1.0) <= 1e-9)) {
        refuse("has weights that sum to " + std::to_string(sum) + " instead of 1");
    }
}

bool is_particle(const SkinVertex& vertex, std::size_t index) {
    return vertex.particle[0] == index && vertex.weight[0] == 1.0;
}

}  // namespace

Skin skin_of_particles(std::size_t count) {
    Skin skin(count);
    for (std::size_t j = 0; j < count; ++j) {
        skin[j].particle.fill(static_cast<std::uint32_t>(j));
        skin[j].weight[0] = 1.0;
    }
    return skin;
}

Skinner::Skinner(std::span<const Vec3> rest, const ParticleModel& model, const Skin& skin)
    : skin_(skin), arm_(skin.size()) {
    if (skin.size() != rest.size()) {
        throw std::invalid_argument("skin: " + std::to_string(skin.size()) + " elements for " +
                                    std::to_string(rest.size()) + " vertices");
    }
    one_to_one_ = rest.size() == model.size();
    for (std::size_t j = 0; j < skin.size(); ++j) {
        check(skin[j], j, model.size());
        one_to_one_ = one_to_one_ && is_particle(skin[j], j) && rest[j] == model.rest_position[j];
        for (std::size_t k = 0; k < SkinVertex::kMost; ++k) {
            arm_[j][k] = rest[j] - model.rest_position[skin[j].particle[k]];
        }
    }
}

void Skinner::place(const ParticleModel& model, std::span<Vec3> vertices) const {
    if (one_to_one_) {
        std::copy(model.position.begin(), model.position.end(), vertices.begin());
        return;
    }
    for (std::size_t j = 0; j < skin_.size(); ++j) {
        Vec3 sum(0.0);
        for (std::size_t k = 0; k < SkinVertex::kMost; ++k) {
            const std::uint32_t i = skin_[j].particle[k];
            sum += skin_[j].weight[k] * (model.position[i] + to_matrix(model.orientation[i]) * arm_[j][k]);
        }
        vertices[j] = sum;
    }
}

}  // namespace haptic::sim
