#include "dynamics/elastic_pushes.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// Columns kept per body. More contacts than that in one body find columns again and again.
constexpr std::size_t kMaxColumns = 256;
constexpr std::size_t kSideBySide = 4;
constexpr std::size_t kLevers = 6;

/// v x w = cross_matrix(v) w.
Mat3 cross_matrix(const Vec3& v) noexcept {
    return {Vec3(0.0, v.z, -v.y), Vec3(-v.z, 0.0, v.x), Vec3(v.y, -v.x, 0.0)};
}

Row row_of_vector(const Vec3& v) noexcept {
    return {{v.x, v.y, v.z, 0.0}};
}

}  // namespace

ElasticPushes::ElasticPushes(const ParticleModel& model)
    : body_of_particle_(model.size(), kNone), column_(model.size(), kNone) {
    std::vector<std::uint8_t> solid(model.size(), 0);
    for (const ElasticElement& element : model.elasticity.elements) {
        solid[element.centre] = solid[element.centre] != 0 || element.members.size() != 3;
    }
    std::size_t largest = 0;
    for (const ParticleRange& range : bodies_of(model)) {
        if (solid[range.begin] == 0) {
            continue;
        }
        Body body{.particles = range, .is_free = has_no_pinned(model, range)};
        for (std::uint32_t i = range.begin; i < range.end; ++i) {
            body_of_particle_[i] = model.pinned[i] == 0 ? static_cast<std::uint32_t>(bodies_.size()) : kNone;
        }
        const std::size_t size = range.end - range.begin;
        body.columns.resize(std::min(size, kMaxColumns) * size);
        body.owner.reserve(std::min(size, kMaxColumns));
        largest = std::max(largest, size);
        bodies_.push_back(std::move(body));
    }
    scratch_.resize(largest);
    lever_.resize(bodies_.empty() ? 0 : kLevers * model.size());
}

void ElasticPushes::begin(const ParticleModel& start, ElasticBodies& elastic, double h) noexcept {
    start_ = &start;
    elastic_ = &elastic;
    h_ = h;
    for (Body& body : bodies_) {
        body.placed = false;
    }
}

Vec3 ElasticPushes::lever(std::uint32_t particle, std::size_t first) const noexcept {
    const double* const at = lever_.data() + kLevers * particle + first;
    return {at[0], at[1], at[2]};
}

/// The particle's column of W, found with those of the next particles that have none yet.
std::uint32_t ElasticPushes::column(Body& body, std::uint32_t particle) noexcept {
    const std::size_t size = body.particles.end - body.particles.begin;
    const std::size_t room = body.columns.size() / size;
    if (body.h != h_ || (column_[particle] == kNone && body.owner.size() == room)) {
        for (const std::uint32_t owner : body.owner) {
            column_[owner] = kNone;
        }
        body.owner.clear();
        body.h = h_;
    }
    if (column_[particle] != kNone) {
        return column_[particle];
    }
    const auto rows = std::span(scratch_).first(size);
    std::fill(rows.begin(), rows.end(), Row{});
    const std::size_t first = body.owner.size();
    const std::size_t end = std::min(first + kSideBySide, room);
    for (std::uint32_t i = particle; i < body.particles.end && body.owner.size() < end; ++i) {
        if (column_[i] == kNone && answers(i)) {
            rows[i - body.particles.begin].number[body.owner.size() - first] = 1.0;
            column_[i] = static_cast<std::uint32_t>(body.owner.size());
            body.owner.push_back(i);
        }
    }
    elastic_->respond(body.particles, rows);
    for (std::size_t c = first; c < body.owner.size(); ++c) {
        for (std::size_t j = 0; j < size; ++j) {
            body.columns[c * size + j] = rows[j].number[c - first];
        }
    }
    return column_[particle];
}

/// Centre, inertia and levers of a free body at the start of the sub-step, once in it.
void ElasticPushes::place(Body& body) noexcept {
    if (std::exchange(body.placed, true)) {
        return;
    }
    const ParticleRange& range = body.particles;
    const Vec3 centre = centre_of_mass(*start_, range);
    const auto rows = std::span(scratch_).first(range.end - range.begin);
    Mat3 scatter(0.0);
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        const Vec3 arm = start_->position[i] - centre;
        scatter += start_->mass[i] * glm::outerProduct(arm, arm);
        rows[i - range.begin] = row_of_vector(start_->mass[i] * arm);
        for (int c = 0; c < 3; ++c) {
            lever_[kLevers * i + 3 + static_cast<std::size_t>(c)] = arm[c];
        }
    }
    for (int c = 0; c < 3; ++c) {
        Vec3 axis(0.0);
        axis[c] = 1.0;
        body.inverse_inertia[c] = solve_inertia(scatter, axis);
    }
    // Q, and J from it.
    elastic_->respond(range, rows);
    body.turning = Mat3(0.0);
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        std::copy_n(rows[i - range.begin].number, 3, lever_.begin() + static_cast<std::ptrdiff_t>(kLevers * i));
        body.turning -= start_->mass[i] * cross_matrix(lever(i, 0)) * cross_matrix(lever(i, 3));
    }
}

ElasticPushes::Compliance ElasticPushes::compliance(std::uint32_t particle, const Vec3& normal) noexcept {
    Body& body = bodies_[body_of_particle_[particle]];
    const std::size_t size = body.particles.end - body.particles.begin;
    const double alone = body.columns[column(body, particle) * size + particle - body.particles.begin];
    if (!body.is_free) {
        return {alone, alone};
    }
    // The particle's own answer, a symmetric matrix.
    place(body);
    const Mat3 q = cross_matrix(lever(particle, 0));
    const Mat3 r = cross_matrix(lever(particle, 3));
    const Mat3 alpha = body.inverse_inertia * r;
    const Mat3 beta = body.inverse_inertia * (q - body.turning * alpha);
    const Mat3 answer = Mat3(alone) + q * alpha - r * (h_ * h_ * alpha - beta);
    const double along = glm::dot(normal, answer * normal);
    return {along, 0.5 * (answer[0][0] + answer[1][1] + answer[2][2] - along)};
}

void ElasticPushes::push(std::uint32_t particle, const Vec3& force, Row* position) noexcept {
    Body& body = bodies_[body_of_particle_[particle]];
    const std::size_t size = body.particles.end - body.particles.begin;
    Row terms[1 + kLevers] = {row_of_vector(force)};
    if (body.is_free) {
        place(body);
        const Vec3 alpha = body.inverse_inertia * glm::cross(lever(particle, 3), force);
        const Vec3 beta = body.inverse_inertia * (glm::cross(lever(particle, 0), force) - body.turning * alpha);
        const Mat3 by_q = cross_matrix(-alpha);
        const Mat3 by_r = cross_matrix(h_ * h_ * alpha - beta);
        for (int c = 0; c < 3; ++c) {
            terms[1 + c] = row_of_vector(by_q[c]);
            terms[4 + c] = row_of_vector(by_r[c]);
        }
    }
    elastic_->kernels().move({.count = size,
                              .column = body.columns.data() + column(body, particle) * size,
                              .lever = body.is_free ? lever_.data() + kLevers * body.particles.begin : nullptr,
                              .terms = terms,
                              .position = position + body.particles.begin});
}

}  // namespace haptic::sim
