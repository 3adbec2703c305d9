#include "dynamics/elastic_bodies.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/rows.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kNotElastic = std::numeric_limits<std::uint32_t>::max();
// kappa per largest stress per strain. From 0.75 on the step is stable; 1 never overshoots.
constexpr double kBound = 1.0;
constexpr std::size_t kCorners = 3;
constexpr std::size_t kKeptFactors = 4;
// Doubles in the widest register: rows of padding.
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

/// Starts of consecutive ranges from their lengths, and the end of the last one.
std::vector<std::uint32_t> starts_of(const std::vector<std::uint32_t>& lengths) {
    std::vector<std::uint32_t> starts(lengths.size() + 1, 0);
    std::partial_sum(lengths.begin(), lengths.end(), starts.begin() + 1);
    return starts;
}

}  // namespace

ElasticBodies::ElasticBodies(const ParticleModel& model, std::size_t lanes)
    : kernels_(elastic_kernels(lanes)),
      body_of_particle_(model.size(), kNotElastic),
      steps_(kKeptFactors, 0.0),
      place_(model.elasticity.elements.size()) {
    find_bodies(model);
    batch_elements(model, false, solids_);
    batch_elements(model, true, triangles_);
    list_pairs(model);
    list_shares(model);
    assemble(model);
    for (const ElasticElement& element : model.elasticity.elements) {
        if (!is_triangle(element)) {
            turning_.push_back(element.centre);
        }
    }
    if (!empty()) {
        const auto [least, most] = std::ranges::minmax_element(model.elasticity.elements, {}, &ElasticElement::damping);
        least_damping_ = least->damping;
        most_damping_ = most->damping;
    }
    for (LaneArray<Row>* rows : {&at_, &velocity_, &given_, &sides_}) {
        rows->resize(empty() ? 0 : model.size() + kPadding);
    }
    turn_.resize(at_.size(), Row{{1.0, 0.0, 0.0, 0.0}});
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
        have_all_ = have_all_ && solid[range.begin] != 0;
        if (elastic[range.begin] == 0) {
            continue;
        }
        Body body{.particles = range};
        for (std::uint32_t i = range.begin; i < range.end; ++i) {
            body_of_particle_[i] = static_cast<std::uint32_t>(bodies_.size());
            if (model.pinned[i] == 0) {
                body.free.push_back(i);
            }
        }
        bodies_.push_back(std::move(body));
    }
}

void ElasticBodies::batch_elements(const ParticleModel& model, bool triangles, Elements& to) {
    const std::vector<ElasticElement>& all = model.elasticity.elements;
    // Even batches: the largest elements first.
    std::vector<std::uint32_t> order;
    for (std::uint32_t e = 0; e < all.size(); ++e) {
        if (is_triangle(all[e]) == triangles) {
            order.push_back(e);
        }
    }
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return std::pair(all[b].members.size(), a) < std::pair(all[a].members.size(), b);
    });
    const std::size_t n = kernels_.lanes;
    const std::size_t directions = triangles ? 2 : 3;
    to.first = stress_.size() / 3;
    for (std::size_t first = 0; first < order.size(); first += n) {
        const std::size_t slots = all[order[first]].members.size();
        const std::size_t first_slot = to.member.size() / n;
        const std::size_t batch = to.batch.size();
        to.batch.push_back({static_cast<std::uint32_t>(first_slot), static_cast<std::uint32_t>(slots)});
        // Padding in every lane and slot, replaced by what there is.
        for (std::size_t lane = 0; lane < n; ++lane) {
            to.centre.push_back(static_cast<std::uint32_t>(model.size() + lane));
        }
        for (LaneArray<double>* values : {&to.shear, &to.lame, &to.damping}) {
            values->resize(n * (batch + 1), 0.0);
        }
        to.spread.resize(triangles ? 0 : 6 * n * (batch + 1), 0.0);
        for (std::size_t k = 0; k < slots * n; ++k) {
            to.member.push_back(static_cast<std::uint32_t>(model.size() + k % n));
        }
        to.gradient.resize(directions * to.member.size(), 0.0);
        for (std::size_t lane = 0; lane < n && first + lane < order.size(); ++lane) {
            const ElasticElement& e = all[order[first + lane]];
            const std::size_t at = batch * n + lane;
            to.centre[at] = e.centre;
            to.shear[at] = 2.0 * e.shear_modulus * e.volume;
            to.lame[at] = e.lame_modulus * e.volume;
            to.damping[at] = e.damping;
            place_[order[first + lane]] = static_cast<std::uint32_t>(to.first + at);
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
    stress_.resize(stress_.size() + 3 * n * to.batch.size());
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

/// What each element pulls at a particle: its stress times the particle's gradient.
void ElasticBodies::list_shares(const ParticleModel& model) {
    std::vector<std::uint32_t> count(model.size(), 0);
    for (const ElasticElement& e : model.elasticity.elements) {
        for (const std::uint32_t p : e.members) {
            ++count[p];
        }
    }
    first_share_ = starts_of(count);
    share_element_.resize(first_share_.back());
    share_gradient_.resize(3 * static_cast<std::size_t>(first_share_.back()));
    std::vector<std::uint32_t> next(first_share_.begin(), first_share_.end() - 1);
    for (std::size_t e = 0; e < place_.size(); ++e) {
        const ElasticElement& element = model.elasticity.elements[e];
        const std::vector<Vec3> gradient = gradients_of(element);
        for (std::size_t k = 0; k < element.members.size(); ++k) {
            const std::uint32_t share = next[element.members[k]]++;
            share_element_[share] = 3 * place_[e];
            for (int c = 0; c < 3; ++c) {
                share_gradient_[3 * static_cast<std::size_t>(share) + static_cast<std::size_t>(c)] = gradient[k][c];
            }
        }
    }
}

/// A of each body, over its free particles.
void ElasticBodies::assemble(const ParticleModel& model) {
    std::vector<std::uint32_t> row(model.size(), kNotElastic);
    for (const Body& body : bodies_) {
        for (std::uint32_t r = 0; r < body.free.size(); ++r) {
            row[body.free[r]] = r;
        }
    }
    std::vector<std::vector<MatrixElement>> lower(bodies_.size());
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        for (std::uint32_t r = 0; r < bodies_[b].free.size(); ++r) {
            lower[b].push_back({.row = r, .column = r, .mass = model.mass[bodies_[b].free[r]]});
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
        bodies_[b].factor = std::make_unique<StiffnessFactor>(bodies_[b].free.size(), lower[b], kKeptFactors);
    }
}

ParticleRange ElasticBodies::body_of(std::uint32_t particle) const noexcept {
    const std::uint32_t body = body_of_particle_[particle];
    return body == kNotElastic ? ParticleRange{} : bodies_[body].particles;
}

void ElasticBodies::prepare(double h) {
    if (empty() || h == h_) {
        return;
    }
    own_damping_ = std::min(h, least_damping_);
    damped_ = most_damping_ > own_damping_;
    const auto known = std::find(steps_.begin(), steps_.end(), h);
    slot_ = static_cast<std::size_t>(known - steps_.begin());
    if (known == steps_.end()) {
        slot_ = oldest_;
        oldest_ = (oldest_ + 1) % kKeptFactors;
        for (const Body& body : bodies_) {
            body.factor->factorise(slot_, h, own_damping_);
        }
        steps_[slot_] = h;
    }
    h_ = h;
}

ElasticBatches ElasticBodies::batches_of(const Elements& e) noexcept {
    return {.batches = e.batch.size(),
            .batch = e.batch.data(),
            .centre = e.centre.data(),
            .shear = e.shear.data(),
            .lame = e.lame.data(),
            .damping = e.damping.data(),
            .own_damping = own_damping_,
            .damped = damped_,
            .spread = e.spread.data(),
            .member = e.member.data(),
            .gradient = e.gradient.data(),
            .stress = stress_.data() + 3 * e.first};
}

void ElasticBodies::step(const ParticleModel& start, double drag_factor, Row* position, Row* orientation) noexcept {
    // x0, and M (y - x0) / h^2: the forces that led to the position y given.
    for (const Body& body : bodies_) {
        for (std::uint32_t i = body.particles.begin; i < body.particles.end; ++i) {
            const Vec3 given(position[i].number[0], position[i].number[1], position[i].number[2]);
            const bool pinned = start.pinned[i] != 0;
            const Vec3 velocity = pinned ? start.velocity[i] : drag_factor * start.velocity[i];
            const Vec3 at = pinned ? given : start.position[i] + h_ * velocity;
            velocity_[i] = row_of(velocity);
            at_[i] = row_of(at);
            given_[i] = row_of(start.mass[i] / (h_ * h_) * (given - at));
        }
    }
    for (const std::uint32_t i : turning_) {
        turn_[i] = orientation[i];
    }
    // Stresses of the elements at x0, and the rotations that belong to it.
    const ElasticParticles particles{at_.data(), velocity_.data(), turn_.data()};
    kernels_.solids(batches_of(solids_), particles);
    kernels_.triangles(batches_of(triangles_), particles);
    for (const std::uint32_t i : turning_) {
        orientation[i] = turn_[i];
    }
    for (Body& body : bodies_) {
        // f - grad E(x0), then x0 + A^-1 of it.
        kernels_.sum({.count = body.free.size(),
                      .particle = body.free.data(),
                      .first_share = first_share_.data(),
                      .element = share_element_.data(),
                      .gradient = share_gradient_.data(),
                      .stress = stress_.data(),
                      .first_pair = first_pair_.data(),
                      .other = other_.data(),
                      .stiffness = pair_stiffness_.data(),
                      .damping = pair_damping_.data(),
                      .own_damping = own_damping_,
                      .damped = damped_,
                      .position = at_.data(),
                      .velocity = velocity_.data(),
                      .given = given_.data(),
                      .sum = sides_.data()});
        body.factor->solve(kernels_, slot_, {sides_.data(), body.free.size()});
        for (std::size_t r = 0; r < body.free.size(); ++r) {
            const std::uint32_t i = body.free[r];
            for (std::size_t k = 0; k < 3; ++k) {
                position[i].number[k] = at_[i].number[k] + sides_[r].number[k];
            }
        }
    }
}

void ElasticBodies::respond(const ParticleRange& body, std::span<Row> columns) noexcept {
    Body& of = bodies_[body_of_particle_[body.begin]];
    for (std::size_t r = 0; r < of.free.size(); ++r) {
        sides_[r] = columns[of.free[r] - body.begin];
    }
    of.factor->solve(kernels_, slot_, {sides_.data(), of.free.size()});
    std::fill(columns.begin(), columns.end(), Row{});
    for (std::size_t r = 0; r < of.free.size(); ++r) {
        columns[of.free[r] - body.begin] = sides_[r];
    }
}

}  // namespace haptic::sim
