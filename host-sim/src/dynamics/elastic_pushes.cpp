#include "dynamics/elastic_pushes.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/rotation.hpp"
#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

// Numbers in the columns of one body, at most; those that are not used take no memory.
constexpr std::size_t kMaxNumbers = 16'000'000;
constexpr std::size_t kSideBySide = 4;

/// v x w = cross_matrix(v) w.
Mat3 cross_matrix(const Vec3& v) noexcept {
    return {Vec3(0.0, v.z, -v.y), Vec3(-v.z, 0.0, v.x), Vec3(v.y, -v.x, 0.0)};
}

}  // namespace

ElasticPushes::ElasticPushes(const ParticleModel& model)
    : body_of_particle_(model.size(), kNone), column_(model.size(), kNone), place_(model.size(), kNone) {
    std::vector<std::uint8_t> solid(model.size(), 0);
    for (const ElasticElement& element : model.elasticity.elements) {
        solid[element.centre] = solid[element.centre] != 0 || element.members.size() != 3;
    }
    for (const ParticleRange& range : bodies_of(model)) {
        if (solid[range.begin] == 0) {
            continue;
        }
        Body body{.particles = range, .is_free = has_no_pinned(model, range)};
        for (std::uint32_t i = range.begin; i < range.end; ++i) {
            body_of_particle_[i] = model.pinned[i] == 0 ? static_cast<std::uint32_t>(bodies_.size()) : kNone;
        }
        const std::size_t size = range.end - range.begin;
        body.room = std::min(size, kMaxNumbers / size);
        body.columns = std::make_unique_for_overwrite<double[]>(body.room * size);
        body.owner.reserve(body.room);
        bodies_.push_back(std::move(body));
    }
    const std::size_t size = bodies_.empty() ? 0 : model.size();
    scratch_.resize(size);
    answer_.resize(size);
    lever_.resize(kLevers * size);
    particle_.resize(size);
    turning_.resize(size);
    moved_.resize(size);
    force_.resize(size);
    column_of_.resize(size);
}

void ElasticPushes::begin(const ParticleModel& start, ElasticBodies& elastic, double h) noexcept {
    start_ = &start;
    elastic_ = &elastic;
    h_ = h;
    for (Body& body : bodies_) {
        body.placed = body.turns = body.pushed = false;
        for (std::size_t k = 0; k < body.places; ++k) {
            place_[body.particles.begin + particle_[body.particles.begin + k]] = kNone;
        }
        body.places = 0;
        // Columns of another length of the sub-step, or none left for other particles: start over.
        const std::size_t size = body.particles.end - body.particles.begin;
        if (body.h != h || (body.owner.size() == body.room && body.room < size)) {
            for (const std::uint32_t owner : body.owner) {
                column_[owner] = kNone;
            }
            body.owner.clear();
            body.h = h;
        }
    }
}

const double* ElasticPushes::column(const Body& body, std::uint32_t particle) const noexcept {
    const std::size_t size = body.particles.end - body.particles.begin;
    return body.columns.get() + column_[particle] * size;
}

/// One of Q's coordinates, s^2 m, then of r, m.
double& ElasticPushes::lever(std::size_t k, std::size_t particle) noexcept {
    return lever_[k * body_of_particle_.size() + particle];
}

/// Finds the particle's column of W, and those of the next particles that have none yet. False: there is no room.
bool ElasticPushes::find_column(Body& body, std::uint32_t particle) noexcept {
    if (column_[particle] != kNone) {
        return true;
    }
    const std::size_t first = body.owner.size();
    const std::size_t end = std::min(first + kSideBySide, body.room);
    if (first == end) {
        return false;
    }
    const std::size_t size = body.particles.end - body.particles.begin;
    const auto rows = std::span(scratch_).subspan(body.particles.begin, size);
    std::fill(rows.begin(), rows.end(), Row{});
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
    return true;
}

std::span<Row> ElasticPushes::answers_of(const Body& body) noexcept {
    return std::span(answer_).subspan(body.particles.begin, body.particles.end - body.particles.begin);
}

/// Inertia and moment arms of a body at the start of the sub-step, once in it, and what Q answers.
void ElasticPushes::place(Body& body) noexcept {
    if (std::exchange(body.placed, true)) {
        return;
    }
    const ParticleRange& range = body.particles;
    const Vec3 centre = centre_of_mass(*start_, range);
    const std::span<Row> heavy = answers_of(body);
    Mat3 scatter(0.0);
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        const Vec3 arm = start_->position[i] - centre;
        add_outer(scatter, start_->mass[i], arm, arm);
        heavy[i - range.begin] = row_of(start_->mass[i] * arm);
        for (int c = 0; c < 3; ++c) {
            lever(3 + static_cast<std::size_t>(c), i) = arm[c];
        }
    }
    for (int c = 0; c < 3; ++c) {
        Vec3 axis(0.0);
        axis[c] = 1.0;
        body.inverse_inertia[c] = solve_inertia(scatter, axis);
    }
}

void ElasticPushes::expect(std::uint32_t particle) noexcept {
    if (!answers(particle)) {
        return;
    }
    Body& body = bodies_[body_of_particle_[particle]];
    if (body.is_free && !body.placed) {
        place(body);
        elastic_->respond_in_step(body.particles, answers_of(body));
    }
}

/// Q and J of a free body, once in a sub-step.
void ElasticPushes::find_turning(Body& body) noexcept {
    if (!body.is_free || std::exchange(body.turns, true)) {
        return;
    }
    const ParticleRange& range = body.particles;
    const std::span<Row> answers = answers_of(body);
    if (!body.placed || elastic_->will_respond(range)) {
        place(body);
        elastic_->respond(range, answers);
    }
    Mat3 product(0.0);
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        const Row& q = answers[i - range.begin];
        for (std::size_t c = 0; c < 3; ++c) {
            lever(c, i) = q.number[c];
        }
        add_outer(product, start_->mass[i], Vec3(lever(3, i), lever(4, i), lever(5, i)), vector_of(q));
    }
    body.turning = Mat3(product[0][0] + product[1][1] + product[2][2]) - product;
}

ElasticPushes::Place ElasticPushes::take_part(std::uint32_t particle) noexcept {
    const std::uint32_t of = body_of_particle_[particle];
    if (of == kNone) {
        return {};
    }
    if (place_[particle] != kNone) {
        return {of, place_[particle]};
    }
    Body& body = bodies_[of];
    if (!find_column(body, particle)) {
        return {};
    }
    find_turning(body);
    const std::uint32_t within = particle - body.particles.begin;
    const std::size_t at = body.particles.begin + body.places;
    particle_[at] = within;
    column_of_[at] = column(body, particle);
    force_[at] = Row{};
    // What the pushes so far have moved it.
    moved_[at] = Row{};
    for (std::size_t k = 0; k < body.places; ++k) {
        add_scaled(moved_[at], column_of_[body.particles.begin + k][within], force_[body.particles.begin + k]);
    }
    Turning& turning = turning_[at] = {.own = column_of_[at][within]};
    if (body.is_free) {
        turning.q = Vec3(lever(0, particle), lever(1, particle), lever(2, particle));
        turning.r = Vec3(lever(3, particle), lever(4, particle), lever(5, particle));
        turning.alpha = body.inverse_inertia * cross_matrix(turning.r);
        turning.gamma =
            h_ * h_ * turning.alpha - body.inverse_inertia * (cross_matrix(turning.q) - body.turning * turning.alpha);
    }
    place_[particle] = static_cast<std::uint32_t>(at);
    ++body.places;
    return {of, place_[particle]};
}

ElasticPushes::Compliance ElasticPushes::compliance(const Place& place, const Vec3& normal) const noexcept {
    // The particle's own answer, a symmetric matrix.
    const Turning& t = turning_[place.index];
    const Mat3 answer = Mat3(t.own) + cross_matrix(t.q) * t.alpha - cross_matrix(t.r) * t.gamma;
    const double along = glm::dot(normal, answer * normal);
    return {along, 0.5 * (answer[0][0] + answer[1][1] + answer[2][2] - along)};
}

void ElasticPushes::move_body(std::uint32_t particle, Row* position) noexcept {
    const std::uint32_t of = body_of_particle_[particle];
    if (of == kNone || !std::exchange(bodies_[of].pushed, false)) {
        return;
    }
    Body& body = bodies_[of];
    const std::size_t first = body.particles.begin;
    Row terms[kLevers];
    const Mat3 by_q = cross_matrix(-body.sum_alpha);
    const Mat3 by_r = cross_matrix(body.sum_gamma);
    for (int c = 0; c < 3; ++c) {
        terms[c] = row_of(by_q[c]);
        terms[3 + c] = row_of(by_r[c]);
    }
    elastic_->kernels().move({.count = body.particles.end - first,
                              .pushes = body.places,
                              .column = column_of_.data() + first,
                              .force = force_.data() + first,
                              .lever = body.is_free ? &lever(0, first) : nullptr,
                              .lever_length = body_of_particle_.size(),
                              .terms = terms,
                              .position = position + first});
    body.sum_alpha = body.sum_gamma = Vec3(0.0);
    std::fill_n(force_.begin() + static_cast<std::ptrdiff_t>(first), body.places, Row{});
    std::fill_n(moved_.begin() + static_cast<std::ptrdiff_t>(first), body.places, Row{});
}

}  // namespace haptic::sim
