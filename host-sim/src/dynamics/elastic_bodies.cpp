#include "dynamics/elastic_bodies.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/solver.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kNotElastic = std::numeric_limits<std::uint32_t>::max();
// kappa per largest stress per strain. From 0.75 on the step is stable; 1 never overshoots.
constexpr double kBound = 1.0;
constexpr std::size_t kCorners = 3;
// What a thread takes at once.
constexpr std::size_t kBatchesAtOnce = 12;
constexpr std::size_t kSumsAtOnce = 96;
constexpr std::size_t kKeptFactors = 4;
// Doubles in the widest register: rows of padding for each body.
constexpr std::size_t kPadding = 8;

const ElasticKernels& elastic_kernels(std::size_t lanes) {
    if (const ElasticKernels* const kernels = find_kernels(&Kernels::elastic, lanes)) {
        return *kernels;
    }
    throw std::invalid_argument("elasticity: this machine has no vectors of " + std::to_string(lanes) + " doubles");
}

bool is_triangle(const ElasticElement& element) {
    return element.members.size() == kCorners;
}

/// Those of a triangle in its own axes, along its first gradient and across it; z is 0.
std::vector<Vec3> gradients_of(const ElasticElement& element) {
    std::vector<Vec3> gradients = element.gradient;
    if (is_triangle(element)) {
        const Vec3 along = glm::normalize(gradients[0]);
        const Vec3 across = glm::normalize(gradients[1] - glm::dot(gradients[1], along) * along);
        for (Vec3& g : gradients) {
            g = Vec3(glm::dot(g, along), glm::dot(g, across), 0.0);
        }
    }
    return gradients;
}

std::size_t size_of(const ParticleRange& range) noexcept {
    return range.end - range.begin;
}

/// Starts of consecutive ranges from their lengths, and the end of the last one.
std::vector<std::uint32_t> starts_of(const std::vector<std::uint32_t>& lengths) {
    std::vector<std::uint32_t> starts(lengths.size() + 1, 0);
    std::partial_sum(lengths.begin(), lengths.end(), starts.begin() + 1);
    return starts;
}

}  // namespace

ElasticBodies::ElasticBodies(const ParticleModel& model, std::size_t lanes, Workers* workers)
    : kernels_(elastic_kernels(lanes)),
      workers_(workers == nullptr ? *alone_ : *workers),
      body_of_particle_(model.size(), kNotElastic),
      steps_(kKeptFactors, 0.0),
      place_(model.elasticity.elements.size()) {
    find_bodies(model);
    batch_elements(model);
    list_pairs(model);
    list_shares(model);
    assemble(model);
    if (!empty()) {
        const auto [least, most] = std::ranges::minmax_element(model.elasticity.elements, {}, &ElasticElement::damping);
        least_damping_ = least->damping;
        most_damping_ = most->damping;
    }
    for (LaneArray<Row>* rows : {&at_, &velocity_, &given_, &sides_, &asked_sides_}) {
        rows->resize(empty() ? 0 : model.size() + kPadding * bodies_.size());
    }
    turn_.resize(at_.size(), Row{{1.0, 0.0, 0.0, 0.0}});
    turning_answers_.resize(at_.size());
    for (Body& body : bodies_) {
        body.turning_by_forces.answers = {turning_answers_.data() + body.particles.begin, size_of(body.particles)};
    }
}

void ElasticBodies::find_bodies(const ParticleModel& model) {
    std::vector<std::uint8_t> elastic(model.size(), 0);
    std::vector<std::uint8_t> solid(model.size(), 0);
    for (const ElasticElement& element : model.elasticity.elements) {
        for (const std::uint32_t p : element.members) {
            elastic[p] = 1;
            solid[p] = solid[p] != 0 || !is_triangle(element);
        }
    }
    for (const ParticleRange& range : bodies_of(model)) {
        have_all_ = have_all_ && elastic[range.begin] != 0;
        all_are_solid_ = all_are_solid_ && solid[range.begin] != 0;
        if (elastic[range.begin] == 0) {
            continue;
        }
        Body body{.particles = range};
        body.free.begin = static_cast<std::uint32_t>(free_.size());
        for (std::uint32_t i = range.begin; i < range.end; ++i) {
            body_of_particle_[i] = static_cast<std::uint32_t>(bodies_.size());
            if (model.pinned[i] == 0) {
                free_.push_back(i);
            }
        }
        body.free.end = static_cast<std::uint32_t>(free_.size());
        body.loose = solid[range.begin] != 0 && size_of(body.free) == size_of(range);
        bodies_.push_back(std::move(body));
    }
}

/// Gives each body batches of its own, in even sizes: the largest elements first.
void ElasticBodies::batch_elements(const ParticleModel& model) {
    const std::vector<ElasticElement>& all = model.elasticity.elements;
    struct Kinds {
        std::vector<std::uint32_t> solids;
        std::vector<std::uint32_t> triangles;
    };
    std::vector<Kinds> of_body(bodies_.size());
    for (std::uint32_t e = 0; e < all.size(); ++e) {
        Kinds& kinds = of_body[body_of_particle_[all[e].centre]];
        (is_triangle(all[e]) ? kinds.triangles : kinds.solids).push_back(e);
    }
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        for (std::vector<std::uint32_t>* const kind : {&of_body[b].solids, &of_body[b].triangles}) {
            std::sort(kind->begin(), kind->end(), [&](std::uint32_t k, std::uint32_t l) {
                return std::pair(all[l].members.size(), k) < std::pair(all[k].members.size(), l);
            });
        }
        bodies_[b].solids = add_batches(model, b, of_body[b].solids, solids_);
        bodies_[b].turning.begin = static_cast<std::uint32_t>(turning_.size());
        for (const std::uint32_t e : of_body[b].solids) {
            turning_.push_back(all[e].centre);
        }
        bodies_[b].turning.end = static_cast<std::uint32_t>(turning_.size());
    }
    // Triangles after all solids, so that each kind has one range of places.
    triangles_.first = pull_.size();
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        bodies_[b].triangles = add_batches(model, b, of_body[b].triangles, triangles_);
    }
}

/// Appends batches of a body's elements of one kind. Returns their range.
ParticleRange ElasticBodies::add_batches(const ParticleModel& model, std::size_t body,
                                         std::span<const std::uint32_t> order, Elements& to) {
    const std::vector<ElasticElement>& all = model.elasticity.elements;
    const std::size_t n = kernels_.lanes;
    const bool triangles = !order.empty() && is_triangle(all[order[0]]);
    const std::size_t directions = triangles ? 2 : 3;
    const std::size_t first_batch = to.batch.size();
    // Each body has padding of its own: lanes without an element write to it.
    const std::size_t padding = model.size() + kPadding * body;
    for (std::size_t first = 0; first < order.size(); first += n) {
        const std::size_t slots = all[order[first]].members.size();
        const std::size_t first_slot = to.member.size() / n;
        const std::size_t batch = to.batch.size();
        to.batch.push_back({static_cast<std::uint32_t>(first_slot), static_cast<std::uint32_t>(slots)});
        // Padding in every lane and slot, replaced by what there is.
        for (std::size_t lane = 0; lane < n; ++lane) {
            to.centre.push_back(static_cast<std::uint32_t>(padding + lane));
        }
        for (LaneArray<double>* values : {&to.shear, &to.lame, &to.bound, &to.damping}) {
            values->resize(n * (batch + 1), 0.0);
        }
        to.spread.resize(triangles ? 0 : 6 * n * (batch + 1), 0.0);
        for (std::size_t k = 0; k < slots * n; ++k) {
            to.member.push_back(static_cast<std::uint32_t>(padding + k % n));
        }
        to.gradient.resize(directions * to.member.size(), 0.0);
        for (std::size_t lane = 0; lane < n && first + lane < order.size(); ++lane) {
            const ElasticElement& e = all[order[first + lane]];
            const std::size_t at = batch * n + lane;
            to.centre[at] = e.centre;
            to.shear[at] = 2.0 * e.shear_modulus * e.volume;
            to.lame[at] = e.lame_modulus * e.volume;
            to.bound[at] = kBound * e.max_modulus * e.volume;
            to.damping[at] = e.damping;
            place_[order[first + lane]] = static_cast<std::uint32_t>(to.first + first_slot * n + lane);
            if (!triangles) {
                const Mat3& s = e.spread;
                const double symmetric[6] = {s[0][0], s[1][1], s[2][2], s[0][1], s[0][2], s[1][2]};
                for (std::size_t k = 0; k < 6; ++k) {
                    to.spread[(6 * batch + k) * n + lane] = symmetric[k];
                }
            }
            const std::vector<Vec3> gradient = gradients_of(e);
            for (std::size_t k = 0; k < e.members.size(); ++k) {
                const std::size_t slot = first_slot + k;
                to.member[slot * n + lane] = e.members[k];
                for (std::size_t c = 0; c < directions; ++c) {
                    to.gradient[(directions * slot + c) * n + lane] = gradient[k][static_cast<int>(c)];
                }
            }
        }
    }
    pull_.resize(to.first + to.member.size());
    return {static_cast<std::uint32_t>(first_batch), static_cast<std::uint32_t>(to.batch.size())};
}

void ElasticBodies::list_pairs(const ParticleModel& model) {
    std::vector<std::uint32_t> count(model.size(), 0);
    for (const ElasticPair& pair : model.elasticity.pairs) {
        ++count[pair.first];
        ++count[pair.second];
    }
    first_pair_ = starts_of(count);
    std::vector<std::uint32_t> next(first_pair_.begin(), first_pair_.end() - 1);
    for (std::vector<double>* values : {&pair_stiffness_, &pair_damping_}) {
        values->resize(first_pair_.back());
    }
    other_.resize(first_pair_.back());
    const auto add = [&](std::uint32_t particle, std::uint32_t other, const ElasticPair& pair) {
        const std::uint32_t k = next[particle]++;
        other_[k] = other;
        pair_stiffness_[k] = pair.stiffness;
        pair_damping_[k] = pair.damping;
    };
    for (const ElasticPair& pair : model.elasticity.pairs) {
        add(pair.first, pair.second, pair);
        add(pair.second, pair.first, pair);
    }
}

/// Which pulls of elements act on a particle.
void ElasticBodies::list_shares(const ParticleModel& model) {
    std::vector<std::uint32_t> count(model.size(), 0);
    for (const ElasticElement& e : model.elasticity.elements) {
        for (const std::uint32_t p : e.members) {
            ++count[p];
        }
    }
    first_share_ = starts_of(count);
    share_.resize(first_share_.back());
    std::vector<std::uint32_t> next(first_share_.begin(), first_share_.end() - 1);
    for (std::size_t e = 0; e < place_.size(); ++e) {
        const std::vector<std::uint32_t>& members = model.elasticity.elements[e].members;
        for (std::size_t k = 0; k < members.size(); ++k) {
            share_[next[members[k]]++] = place_[e] + static_cast<std::uint32_t>(k * kernels_.lanes);
        }
    }
}

/// A of each body, over its free particles.
void ElasticBodies::assemble(const ParticleModel& model) {
    std::vector<std::uint32_t> row(model.size(), kNotElastic);
    for (const Body& body : bodies_) {
        for (std::uint32_t f = body.free.begin; f < body.free.end; ++f) {
            row[free_[f]] = f - body.free.begin;
        }
    }
    std::vector<std::vector<MatrixElement>> lower(bodies_.size());
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        for (std::uint32_t f = bodies_[b].free.begin; f < bodies_[b].free.end; ++f) {
            const std::uint32_t r = f - bodies_[b].free.begin;
            lower[b].push_back({.row = r, .column = r, .mass = model.mass[free_[f]]});
        }
    }
    const auto add = [&](std::uint32_t p, std::uint32_t q, double stiffness, double damping) {
        if (row[p] != kNotElastic && row[q] != kNotElastic && row[p] >= row[q]) {
            const std::uint32_t body = body_of_particle_[p];
            lower[body].push_back(
                {.row = row[p], .column = row[q], .stiffness = stiffness, .viscosity = damping * stiffness});
        }
    };
    for (const ElasticElement& e : model.elasticity.elements) {
        const double kappa = kBound * e.max_modulus * e.volume;
        for (std::size_t k = 0; k < e.members.size(); ++k) {
            for (std::size_t l = 0; l < e.members.size(); ++l) {
                add(e.members[k], e.members[l], kappa * glm::dot(e.gradient[k], e.gradient[l]), e.damping);
            }
        }
    }
    for (const ElasticPair& pair : model.elasticity.pairs) {
        add(pair.first, pair.first, pair.stiffness, pair.damping);
        add(pair.second, pair.second, pair.stiffness, pair.damping);
        add(std::max(pair.first, pair.second), std::min(pair.first, pair.second), -pair.stiffness, pair.damping);
    }
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        bodies_[b].factor = std::make_unique<StiffnessFactor>(size_of(bodies_[b].free), lower[b], kKeptFactors);
    }
}

ParticleRange ElasticBodies::body_of(std::uint32_t particle) const noexcept {
    const std::uint32_t body = body_of_particle_[particle];
    return body == kNotElastic ? ParticleRange{} : bodies_[body].particles;
}

bool ElasticBodies::is_of_free_solid(std::uint32_t particle) const noexcept {
    const std::uint32_t body = body_of_particle_[particle];
    return body != kNotElastic && bodies_[body].loose;
}

void ElasticBodies::prepare(double h) {
    if (empty() || h == h_) {
        return;
    }
    h_ = 0.0;  // prepared for none, until all factors are found
    own_damping_ = std::min(h, least_damping_);
    damped_ = most_damping_ > own_damping_;
    const auto known = std::find(steps_.begin(), steps_.end(), h);
    slot_ = static_cast<std::size_t>(known - steps_.begin());
    if (known == steps_.end()) {
        slot_ = oldest_;
        oldest_ = (oldest_ + 1) % kKeptFactors;
        steps_[slot_] = 0.0;
        workers_.for_each(bodies_.size(), [&](std::size_t b) {
            bodies_[b].solvable = bodies_[b].factor->factorise(slot_, h, own_damping_);
        });
        if (const auto stiff = std::ranges::find(bodies_, false, &Body::solvable); stiff != bodies_.end()) {
            throw TooStiff(stiff->particles.begin, h);
        }
        steps_[slot_] = h;
    }
    h_ = h;
}

/// Batches [begin, end) of them, all of the body.
ElasticBatches ElasticBodies::batches_of(const Elements& e, const Body& body, std::size_t begin,
                                         std::size_t end) noexcept {
    const std::size_t lane = begin * kernels_.lanes;
    return {.batches = end - begin,
            .batch = e.batch.data() + begin,
            .centre = e.centre.data() + lane,
            .shear = e.shear.data() + lane,
            .lame = e.lame.data() + lane,
            .bound = solves_positions(body) ? e.bound.data() + lane : nullptr,
            .damping = e.damping.data() + lane,
            .own_damping = own_damping_,
            .damped = damped_,
            .spread = e.spread.empty() ? nullptr : e.spread.data() + 6 * lane,
            .member = e.member.data(),
            .gradient = e.gradient.data(),
            .pull = pull_.data() + e.first};
}

/// x0, and M (y - x0) / h^2: the forces that led to the position y given. For a body whose positions are solved for,
/// the right-hand side contains their inertia too, M (y - origin) / h^2.
void ElasticBodies::begin_step(const Body& body, const Motion& motion) noexcept {
    const ParticleModel& start = motion.start;
    const double inverse_square = 1.0 / (h_ * h_);
    const bool positions = solves_positions(body);
    for (std::uint32_t i = body.particles.begin; i < body.particles.end; ++i) {
        const Vec3 given = vector_of(motion.position[i]);
        const bool pinned = start.pinned[i] != 0;
        const Vec3 velocity = pinned ? start.velocity[i] : motion.drag_factor * start.velocity[i];
        const Vec3 at = pinned ? given : start.position[i] + h_ * velocity;
        if (damped_) {
            velocity_[i] = row_of(velocity);
        }
        at_[i] = row_of(at);
        given_[i] = row_of(inverse_square * start.mass[i] * (given - (positions ? origin_of(body, motion) : at)));
    }
    for (std::uint32_t t = body.turning.begin; t < body.turning.end; ++t) {
        turn_[turning_[t]] = motion.orientation[turning_[t]];
    }
}

/// The right-hand side of elements [begin, end) of free_, all of the body: f - grad E(x0), or that of its positions.
void ElasticBodies::sum_forces(const Body& body, std::size_t begin, std::size_t end) noexcept {
    kernels_.sum({.count = end - begin,
                  .particle = free_.data() + begin,
                  .first_share = first_share_.data(),
                  .share = share_.data(),
                  .pull = pull_.data(),
                  .first_pair = solves_positions(body) ? nullptr : first_pair_.data(),
                  .other = other_.data(),
                  .stiffness = pair_stiffness_.data(),
                  .damping = pair_damping_.data(),
                  .own_damping = own_damping_,
                  .damped = damped_,
                  .position = at_.data(),
                  .velocity = velocity_.data(),
                  .given = given_.data(),
                  .sum = sides_.data() + begin});
}

/// The right-hand side of the body's equation, and the rotations of its elements.
void ElasticBodies::find_forces(const Body& body, const Motion& motion, Workers& workers) noexcept {
    begin_step(body, motion);
    // Stresses of the elements at x0, and the rotations that belong to it.
    const ElasticParticles particles{at_.data(), velocity_.data(), turn_.data()};
    workers.for_ranges(body.solids, kBatchesAtOnce, [&](std::size_t begin, std::size_t end) {
        kernels_.solids(batches_of(solids_, body, begin, end), particles);
    });
    workers.for_ranges(body.triangles, kBatchesAtOnce, [&](std::size_t begin, std::size_t end) {
        kernels_.triangles(batches_of(triangles_, body, begin, end), particles);
    });
    for (std::uint32_t t = body.turning.begin; t < body.turning.end; ++t) {
        motion.orientation[turning_[t]] = turn_[turning_[t]];
    }
    // Sum up what they pull at each particle.
    workers.for_ranges(body.free, kSumsAtOnce,
                       [&](std::size_t begin, std::size_t end) { sum_forces(body, begin, end); });
}

/// Solves for a correction of x0, or for positions from the origin, and finds how the body turns if that was asked.
void ElasticBodies::move_body(Body& body, const Motion& motion) noexcept {
    const bool asked = std::exchange(body.turning_is_asked, false);
    Turning& turning = body.turning_by_forces;
    std::span<Row> asked_sides;
    if (asked) {
        turning.relief.place(motion.start, body.particles, turning.answers);
        asked_sides = take_forces(body, turning.answers);
    }
    body.factor->solve(kernels_, slot_, {sides_.data() + body.free.begin, size_of(body.free)}, asked_sides);
    const bool positions = solves_positions(body);
    for (std::uint32_t f = body.free.begin; f < body.free.end; ++f) {
        const Vec3 from = positions ? origin_of(body, motion) : vector_of(at_[free_[f]]);
        set_vector(motion.position[free_[f]], from + vector_of(sides_[f]));
    }
    if (asked) {
        give_displacements(body, turning.answers);
        turning.relief.take_answers(motion.start, body.particles, turning.answers);
        body.turning_is_known = true;
        if (Asker* const asker = std::exchange(body.asker, nullptr)) {
            asker->answered(body.which);
        }
    }
}

/// Forces on the free particles of a body, in the order of its factors.
std::span<Row> ElasticBodies::take_forces(const Body& body, std::span<const Row> columns) noexcept {
    for (std::uint32_t f = body.free.begin; f < body.free.end; ++f) {
        asked_sides_[f] = columns[free_[f] - body.particles.begin];
    }
    return {asked_sides_.data() + body.free.begin, size_of(body.free)};
}

/// What they have become; a pinned particle stays.
void ElasticBodies::give_displacements(const Body& body, std::span<Row> columns) const noexcept {
    std::fill(columns.begin(), columns.end(), Row{});
    for (std::uint32_t f = body.free.begin; f < body.free.end; ++f) {
        columns[free_[f] - body.particles.begin] = asked_sides_[f];
    }
}

void ElasticBodies::respond(const ParticleRange& body, std::span<Row> columns) noexcept {
    Body& of = bodies_[body_of_particle_[body.begin]];
    of.factor->solve(kernels_, slot_, take_forces(of, columns));
    give_displacements(of, columns);
}

void ElasticBodies::forget_turning(const ParticleRange& body) noexcept {
    bodies_[body_of_particle_[body.begin]].turning_is_known = false;
}

void ElasticBodies::find_turning_in_step(const ParticleRange& body) noexcept {
    bodies_[body_of_particle_[body.begin]].turning_is_asked = true;
}

void ElasticBodies::find_turning_in_step(const ParticleRange& body, Asker& asker, std::size_t which) noexcept {
    Body& of = bodies_[body_of_particle_[body.begin]];
    of.turning_is_asked = true;
    of.asker = &asker;
    of.which = which;
}

const ElasticBodies::Turning& ElasticBodies::turning(const ParticleRange& body, const ParticleModel& start) noexcept {
    Body& of = bodies_[body_of_particle_[body.begin]];
    Turning& turning = of.turning_by_forces;
    if (!std::exchange(of.turning_is_known, true)) {
        turning.relief.place(start, of.particles, turning.answers);
        respond(of.particles, turning.answers);
        turning.relief.take_answers(start, of.particles, turning.answers);
    }
    return turning;
}

}  // namespace haptic::sim
