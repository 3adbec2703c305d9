#include "haptic/sim/skin.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "haptic/sim/rotation.hpp"
#include "skinning.hpp"

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

bool has_wide_registers() {
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx2") != 0;
#else
    return false;
#endif
}

void set_row(SkinRow& row, const Vec3& v) {
    row.number[0] = v.x;
    row.number[1] = v.y;
    row.number[2] = v.z;
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

Skinner::Skinner(std::span<const Vec3> rest, const ParticleModel& model, const Skin& skin, bool wide)
    : frame_(model.size()), wide_(wide && has_wide_registers()) {
    if (skin.size() != rest.size()) {
        throw std::invalid_argument("skin: " + std::to_string(skin.size()) + " elements for " +
                                    std::to_string(rest.size()) + " vertices");
    }
    one_to_one_ = rest.size() == model.size();
    for (std::size_t j = 0; j < skin.size(); ++j) {
        check(skin[j], j, model.size());
        one_to_one_ = one_to_one_ && is_particle(skin[j], j) && rest[j] == model.rest_position[j];
        for (std::size_t k = 0; k < SkinVertex::kMost; ++k) {
            const double weight = skin[j].weight[k];
            const Vec3 arm = weight * (rest[j] - model.rest_position[skin[j].particle[k]]);
            particle_.push_back(skin[j].particle[k]);
            arm_.push_back({weight, {arm.x, arm.y, arm.z}});
        }
    }
}

Skinner::Skinner(Skinner&&) noexcept = default;
Skinner& Skinner::operator=(Skinner&&) noexcept = default;
Skinner::~Skinner() = default;

void Skinner::place(const ParticleModel& model, std::span<Vec3> vertices) {
    if (one_to_one_) {
        std::copy(model.position.begin(), model.position.end(), vertices.begin());
        return;
    }
    for (std::size_t i = 0; i < frame_.size(); ++i) {
        const Mat3 rotation = to_matrix(model.orientation[i]);
        set_row(frame_[i].position, model.position[i]);
        for (int column = 0; column < 3; ++column) {
            set_row(frame_[i].axis[column], rotation[column]);
        }
    }
    static_assert(sizeof(Vec3) == 3 * sizeof(double));
    const SkinningTask task{.vertices = std::min(vertices.size(), particle_.size() / SkinVertex::kMost),
                            .particle = particle_.data(),
                            .arm = arm_.data(),
                            .frame = frame_.data(),
                            .out = &vertices.data()->x};
#if defined(__x86_64__)
    if (wide_) {
        skin_avx2(task);
        return;
    }
#endif
    skin_baseline(task);
}

}  // namespace haptic::sim
