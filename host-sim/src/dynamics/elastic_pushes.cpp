#include "dynamics/elastic_pushes.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "dynamics/inertia_relief.hpp"
#include "dynamics/model_bodies.hpp"
#include "dynamics/one_lane.hpp"
#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

// Numbers in the columns of one body, at most; those that are not used take no memory.
constexpr std::size_t kMaxNumbers = 16'000'000;
constexpr std::size_t kSideBySide = 4;
// Places for which rows between places have room at first: rows near one another stay in the cache.
constexpr std::size_t kFirstRow = kPlacePadding;

/// a b, in line: as a call it takes most of the time of a place.
[[gnu::always_inline]] inline Mat3 product(const Mat3& a, const Mat3& b) noexcept {
    const auto column = [&](const Vec3& v)
                            __attribute__((always_inline)) { return a[0] * v.x + a[1] * v.y + a[2] * v.z; };
    return {column(b[0]), column(b[1]), column(b[2])};
}

/// v x w = cross_matrix(v) w.
Mat3 cross_matrix(const Vec3& v) noexcept {
    return {Vec3(0.0, v.z, -v.y), Vec3(-v.z, 0.0, v.x), Vec3(v.y, -v.x, 0.0)};
}

// Products with a cross matrix, without what its zeros add.
/// cross_matrix(v) m.
[[gnu::always_inline]] inline Mat3 crossed(const Vec3& v, const Mat3& m) noexcept {
    return {glm::cross(v, m[0]), glm::cross(v, m[1]), glm::cross(v, m[2])};
}
/// m cross_matrix(v).
[[gnu::always_inline]] inline Mat3 crossed(const Mat3& m, const Vec3& v) noexcept {
    return {m[1] * v.z - m[2] * v.y, m[2] * v.x - m[0] * v.z, m[0] * v.y - m[1] * v.x};
}

}  // namespace

ElasticPushes::ElasticPushes(const ParticleModel& model)
    : body_of_particle_(model.size(), kNone), column_(model.size(), kNone), place_(model.size(), kNone) {
    std::size_t places = 0;
    const std::vector<ParticleRange> solids = solids_of(model);
    for (const ParticleRange& range : elastic_bodies_of(model)) {
        const bool is_solid = has_body_at(solids, range.begin);
        const bool is_free = has_no_pinned(model, range);
        Body body{.particles = range, .is_free = is_free, .turns = is_solid && is_free};
        for (std::uint32_t i = range.begin; i < range.end; ++i) {
            body_of_particle_[i] = model.pinned[i] == 0 ? static_cast<std::uint32_t>(bodies_.size()) : kNone;
        }
        const std::size_t size = range.end - range.begin;
        body.room = std::min(size, kMaxNumbers / size);
        body.columns = std::make_unique_for_overwrite<double[]>(body.room * size);
        body.owner.reserve(body.room);
        body.expected.reserve(size);
        body.first_place = places;
        body.row = std::min(kFirstRow, padded(body.room));
        body.among = std::make_unique_for_overwrite<double[]>(body.room * padded(body.room));
        places += padded(body.room);
        bodies_.push_back(std::move(body));
    }
    const std::size_t size = bodies_.empty() ? 0 : model.size();
    scratch_.resize(size);
    lever_.resize(kLevers * size);
    particle_.resize(places);
    row_.resize(places);
    answer_of_.resize(places);
    for (LaneArray<double>& moved : moved_) {
        moved.resize(places);
    }
    force_.resize(places);
    column_of_.resize(places);
    for (const Body& body : bodies_) {
        PushedBody& pushed = pushed_.emplace_back();
        for (std::size_t c = 0; c < 3; ++c) {
            pushed.moved[c] = &moved_[c][body.first_place];
        }
    }
}

void ElasticPushes::begin(const ParticleModel& start, ElasticBodies& elastic, double h) noexcept {
    start_ = &start;
    elastic_ = &elastic;
    h_ = h;
    for (Body& body : bodies_) {
        PushedBody& pushed = pushed_[static_cast<std::size_t>(&body - bodies_.data())];
        pushed.alpha = pushed.gamma = pushed.turned_by_pushes = Row{};
        pushed.h_squared = h * h;
        pushed.places = 0;
        pushed.pushed = false;
        elastic.forget_turning(body.particles);
        body.turning = nullptr;
        body.has_turned = false;
        body.expected.clear();
        for (std::size_t k = 0; k < body.places; ++k) {
            place_[body.particles.begin + particle_[body.first_place + k]] = kNone;
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

void ElasticPushes::expect(std::uint32_t particle) noexcept {
    if (!answers(particle)) {
        return;
    }
    const std::uint32_t of = body_of_particle_[particle];
    Body& body = bodies_[of];
    if (!body.turns) {
        return;
    }
    if (body.expected.empty()) {
        elastic_->find_turning_in_step(body.particles, *this, of);
    }
    if (body.expected.size() < body.expected.capacity()) {
        body.expected.push_back(particle);
    }
}

void ElasticPushes::answered(std::size_t which) noexcept {
    for (const std::uint32_t particle : bodies_[which].expected) {
        (void)take_part(particle);
    }
}

/// How a free body turns, and the levers of its particles, once in a sub-step.
void ElasticPushes::find_turning(Body& body) noexcept {
    if (!body.turns || body.turning != nullptr) {
        return;
    }
    const ParticleRange& range = body.particles;
    body.turning = &elastic_->turning(range, *start_);
    const InertiaRelief& relief = body.turning->relief;
    PushedBody& pushed = pushed_[static_cast<std::size_t>(&body - bodies_.data())];
    for (int c = 0; c < 3; ++c) {
        pushed.by_torque[c] = row_of(h_ * h_ * relief.inverse_inertia()[c]);
    }
    double* row[kLevers];
    for (std::size_t k = 0; k < kLevers; ++k) {
        row[k] = &lever(k, 0);
    }
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        const Row& q = body.turning->answers[i - range.begin];
        const Row r = row_of(relief.arm(start_->position[i]));
        for (std::size_t c = 0; c < 3; ++c) {
            row[c][i] = q.number[c];
            row[c + 3][i] = r.number[c];
        }
    }
}

/// Makes room for twice as many places in each row.
void ElasticPushes::widen_rows(Body& body) noexcept {
    const std::size_t wider = std::min(2 * body.row, padded(body.room));
    for (std::size_t k = body.places; k-- > 0;) {
        const double* const row = &body.among[k * body.row];
        std::copy_backward(row, row + body.row, &body.among[k * wider] + body.row);
        row_[body.first_place + k].response = &body.among[k * wider];
    }
    body.row = wider;
}

/// The body's next place, for a particle that has a column: W between it and those that take part, and what the pushes
/// so far have moved it by W.
void ElasticPushes::begin_place(Body& body, std::uint32_t particle) noexcept {
    const std::size_t first = body.first_place;
    const std::size_t next = body.places;
    const std::uint32_t within = particle - body.particles.begin;
    const double* const own = column(body, particle);
    particle_[first + next] = within;
    column_of_[first + next] = own;
    force_[first + next] = Row{};
    if (next == body.row) {
        widen_rows(body);
    }
    double* const row = &body.among[next * body.row];
    // W is symmetric. Its columns differ by rounding; those of the others would come from far in memory.
    for (std::size_t k = 0; k <= next; ++k) {
        row[k] = body.among[k * body.row + next] = own[particle_[first + k]];
    }
    const bool has_moved = pushed_[body_of_particle_[particle]].pushed;
    // Vectors read and write the padding.
    std::fill(row + next + 1, row + padded(next + 1), 0.0);
    for (std::size_t k = 0; k < next && next % kPlacePadding == 0; ++k) {
        double* const end = &body.among[k * body.row + next];
        std::fill(end + 1, end + kPlacePadding, 0.0);
    }
    for (std::size_t c = 0; c < 3; ++c) {
        double& moved = moved_[c][first + next];
        moved = 0.0;
        for (std::size_t k = 0; has_moved && k < next; ++k) {
            moved += body.among[k * body.row + next] * force_[first + k].number[c];
        }
    }
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
    const std::size_t at = body.first_place + body.places;
    begin_place(body, particle);
    PushedPlace& row = row_[at];
    row.response = &body.among[body.places * body.row];
    row.force = &force_[at];
    row.body = &pushed_[of];
    row.index = body.places;
    answer_of_[at] = Mat3(column_of_[at][particle_[at]]);
    if (body.turns) {  // else what turning does stays 0
        const Vec3 q(lever(0, particle), lever(1, particle), lever(2, particle));
        const Vec3 r(lever(3, particle), lever(4, particle), lever(5, particle));
        const Mat3 by_q = cross_matrix(q);
        const Mat3 by_r = cross_matrix(-r);
        const InertiaRelief& relief = body.turning->relief;
        const Mat3& inverse_inertia = relief.inverse_inertia();
        const Mat3 alpha = crossed(inverse_inertia, r);
        const Mat3 gamma = h_ * h_ * alpha - product(inverse_inertia, by_q - product(relief.turning(), alpha));
        answer_of_[at] += crossed(q, alpha) - crossed(r, gamma);
        for (int c = 0; c < 3; ++c) {
            row.by_alpha[c] = row_of(by_q[c]);
            row.by_gamma[c] = row_of(by_r[c]);
            row.alpha[c] = row_of(alpha[c]);
            row.gamma[c] = row_of(gamma[c]);
        }
    }
    place_[particle] = static_cast<std::uint32_t>(at);
    pushed_[of].places = padded(++body.places);
    return {of, place_[particle]};
}

const Vec3& ElasticPushes::turned_before(const Place& place, const Row* position) noexcept {
    Body& body = bodies_[place.body];
    if (!std::exchange(body.has_turned, true)) {
        const InertiaRelief& relief = body.turning->relief;
        Vec3 moment(0.0);
        for (std::uint32_t i = body.particles.begin; i < body.particles.end; ++i) {
            const Vec3 moved = vector_of(position[i]) - start_->position[i];
            moment += start_->mass[i] * glm::cross(relief.arm(start_->position[i]), moved);
        }
        body.turned_before = relief.inverse_inertia() * moment;
    }
    return body.turned_before;
}

ElasticPushes::Compliance ElasticPushes::compliance(const Place& place, const Vec3& arm,
                                                    const Vec3& normal) const noexcept {
    Mat3 answer = answer_of_[place.index];  // symmetric
    if (turns(place)) {
        const Vec3& start = start_->position[bodies_[place.body].particles.begin + particle_[place.index]];
        const InertiaRelief& relief = bodies_[place.body].turning->relief;
        const Vec3 r = relief.arm(start);
        const Mat3 inverse = h_ * h_ * relief.inverse_inertia();
        answer -= crossed(r, crossed(inverse, arm)) + crossed(arm, crossed(inverse, r + arm));
    }
    const double along = glm::dot(normal, answer * normal);
    return {along, 0.5 * (answer[0][0] + answer[1][1] + answer[2][2] - along)};
}

double ElasticPushes::response(const PushedContact::Side& moved, const Vec3& along, const PushedContact::Side& pushed,
                               const Vec3& force) const noexcept {
    const PushedPlace& one = *moved.place;
    const PushedPlace& other = *pushed.place;
    if (one.body != other.body) {
        return 0.0;
    }
    const PushedPlace& later = one.index > other.index ? one : other;
    Vec3 way = later.response[std::min(one.index, other.index)] * force;
    const auto sum = [](const Row(&row)[3], const Vec3& by) {
        return by.x * vector_of(row[0]) + by.y * vector_of(row[1]) + by.z * vector_of(row[2]);
    };
    const Vec3 alpha = sum(other.alpha, force);
    const Vec3 by_torque = sum(other.body->by_torque, glm::cross(plain(pushed.arm), force));
    way += sum(one.by_alpha, alpha) + sum(one.by_gamma, sum(other.gamma, force) + by_torque) +
           glm::cross(other.body->h_squared * alpha + by_torque, plain(moved.arm));
    return glm::dot(along, way);
}

void ElasticPushes::push(const Place& place, const Vec3& arm, const Vec3& force) noexcept {
    elastic_->kernels().push({.place = &row_[place.index], .arm = lane(arm)}, row_of(force));
}

Vec3 ElasticPushes::displacement(const Place& place, const Vec3& arm) const noexcept {
    const PushedPlace& row = row_[place.index];
    const PushedBody& body = *row.body;
    Vec3 moved(body.moved[0][row.index], body.moved[1][row.index], body.moved[2][row.index]);
    for (std::size_t c = 0; c < 3; ++c) {
        moved += body.alpha.number[c] * vector_of(row.by_alpha[c]) + body.gamma.number[c] * vector_of(row.by_gamma[c]);
    }
    return moved + glm::cross(vector_of(body.turned_by_pushes), arm);
}

void ElasticPushes::move_body(std::uint32_t particle, Row* position) noexcept {
    const std::uint32_t of = body_of_particle_[particle];
    if (of == kNone || !std::exchange(pushed_[of].pushed, false)) {
        return;
    }
    const Body& body = bodies_[of];
    PushedBody& pushed = pushed_[of];
    const std::size_t first = body.particles.begin;
    const std::size_t first_place = body.first_place;
    Row terms[kLevers];
    const Mat3 by_q = cross_matrix(-vector_of(pushed.alpha));
    const Mat3 by_r = cross_matrix(vector_of(pushed.gamma));
    for (int c = 0; c < 3; ++c) {
        terms[c] = row_of(by_q[c]);
        terms[3 + c] = row_of(by_r[c]);
    }
    elastic_->kernels().move({.count = body.particles.end - first,
                              .pushes = body.places,
                              .column = column_of_.data() + first_place,
                              .force = force_.data() + first_place,
                              .lever = body.turns ? &lever(0, first) : nullptr,
                              .lever_length = body_of_particle_.size(),
                              .terms = terms,
                              .position = position + first});
    pushed.alpha = pushed.gamma = Row{};
    std::fill_n(force_.begin() + static_cast<std::ptrdiff_t>(first_place), body.places, Row{});
    for (LaneArray<double>& moved : moved_) {
        std::fill_n(moved.begin() + static_cast<std::ptrdiff_t>(first_place), body.places, 0.0);
    }
}

}  // namespace haptic::sim
