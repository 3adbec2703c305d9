#include "haptic/sim/skin.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "dynamics/one_lane.hpp"
#include "simd/kernels.hpp"
#include "simd/lane_rotation.hpp"

namespace haptic::sim {
namespace {

void check(const SkinVertex& vertex, std::size_t index, std::size_t particles) {
    const auto refuse = [index](const std::string& why) {
        throw std::invalid_argument("skin: vertex " + std::to_string(index) + " " + why);
    };
    double sum = 0.0;
    for (std::size_t k = 0; k < SkinVertex::kMax; ++k) {
        if (vertex.particle[k] >= particles) {
            refuse("refers to particle " + std::to_string(vertex.particle[k]) + ", but the model has " +
                   std::to_string(particles));
        }
        if (!(vertex.weight[k] >= 0.0)) {
            refuse("has a negative weight");
        }
        sum += vertex.weight[k];
    }
    if (!(std::abs(sum - 1.0) <= 1e-9)) {
        refuse("has weights that sum to " + std::to_string(sum) + " instead of 1");
    }
}

void set_row(SkinRow& row, const LaneVec<double>& v) {
    row.number[0] = v.x;
    row.number[1] = v.y;
    row.number[2] = v.z;
}

}  // namespace

bool is_at_particle(const SkinVertex& vertex, std::size_t particle) noexcept {
    return vertex.particle[0] == particle && vertex.weight[0] == 1.0;
}

Skin skin_of_particles(std::size_t count) {
    Skin skin(count);
    for (std::size_t j = 0; j < count; ++j) {
        skin[j].particle.fill(static_cast<std::uint32_t>(j));
        skin[j].weight[0] = 1.0;
    }
    return skin;
}

Skinner::Skinner(std::span<const Vec3> rest, const ParticleModel& model, const Skin& skin, bool wide)
    : rest_(rest.begin(), rest.end()),
      rest_position_(model.rest_position),
      frame_(model.size()),
      skinned_position_(model.size(), Vec3(std::numeric_limits<double>::quiet_NaN())),
      skinned_orientation_(model.orientation),
      skin_((wide ? widest_kernels() : kBaselineKernels).skin) {
    if (skin.size() != rest.size()) {
        throw std::invalid_argument("skin: " + std::to_string(skin.size()) + " elements for " +
                                    std::to_string(rest.size()) + " vertices");
    }
    // Flat arrays for the kernel. Cloth, whose vertices are its particles, needs no skinning.
    one_to_one_ = rest.size() == model.size();
    for (std::size_t j = 0; j < skin.size(); ++j) {
        check(skin[j], j, model.size());
        one_to_one_ = one_to_one_ && is_at_particle(skin[j], j) && rest[j] == model.rest_position[j];
        for (std::size_t k = 0; k < SkinVertex::kMax; ++k) {
            particle_.push_back(skin[j].particle[k]);
            weight_.push_back(skin[j].weight[k]);
        }
    }
}

Skinner::Skinner(Skinner&&) noexcept = default;
Skinner& Skinner::operator=(Skinner&&) noexcept = default;
Skinner::~Skinner() = default;

void Skinner::skin_vertices(const ParticleModel& model, std::span<Vec3> vertices) {
    skin_vertices(model, {0, std::min(vertices.size(), rest_.size()), 0, frame_.size()}, vertices);
}

bool Skinner::has_moved(const ParticleModel& model, const Part& part) const noexcept {
    for (std::size_t i = part.first_particle; i < part.first_particle + part.particles; ++i) {
        if (model.position[i] != skinned_position_[i] || model.orientation[i] != skinned_orientation_[i]) {
            return true;
        }
    }
    return false;
}

void Skinner::skin_vertices(const ParticleModel& model, const Part& part, std::span<Vec3> vertices,
                            std::span<Vec3> before) {
    // Record the pose for has_moved().
    for (std::size_t i = part.first_particle; i < part.first_particle + part.particles; ++i) {
        skinned_position_[i] = model.position[i];
        skinned_orientation_[i] = model.orientation[i];
    }
    // Cloth: the vertices are the particles.
    if (one_to_one_) {
        if (!before.empty()) {
            std::copy_n(&vertices[part.first_vertex], part.vertices, &before[part.first_vertex]);
        }
        std::copy_n(&model.position[part.first_vertex], part.vertices, &vertices[part.first_vertex]);
        return;
    }
    // Transform of each particle: p -> R p + (x - R X).
    for (std::size_t i = part.first_particle; i < part.first_particle + part.particles; ++i) {
        const Quat& q = model.orientation[i];
        const LaneMat<double> rotation = lane_matrix(LaneQuat<double>{q.w, q.x, q.y, q.z});
        set_row(frame_[i].row[0], rotation.x);
        set_row(frame_[i].row[1], rotation.y);
        set_row(frame_[i].row[2], rotation.z);
        set_row(frame_[i].row[3], lane(model.position[i]) - rotation * lane(rest_position_[i]));
    }
    // Linear blend skinning: each vertex by the weighted sum of its particles' transforms.
    static_assert(sizeof(Vec3) == 3 * sizeof(double) && SkinVertex::kMax == kParticlesPerVertex);
    const SkinningTask task{.vertices = part.vertices,
                            .particle = particle_.data() + part.first_vertex * SkinVertex::kMax,
                            .weight = weight_.data() + part.first_vertex * SkinVertex::kMax,
                            .rest = &rest_.data()[part.first_vertex].x,
                            .frame = frame_.data(),
                            .out = &vertices.data()[part.first_vertex].x,
                            .before = before.empty() ? nullptr : &before[part.first_vertex].x};
    skin_(task);
}

}  // namespace haptic::sim
