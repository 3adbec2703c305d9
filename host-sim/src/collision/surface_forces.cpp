#include "collision/surface_forces.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

// Rounds of one call, at most: paper that is thrown needs them, cloth that lies takes one or two.
constexpr int kMaxForceRounds = 20;

}  // namespace

SurfaceForces::SurfaceForces(const ParticleModel& model, std::span<const ParticleSurface> sheets,
                             const VertexMasses& masses, FrictionCoefficients friction, double exact, std::size_t room)
    : masses_(masses),
      friction_(friction),
      exact_(exact),
      first_(model.size(), kNone),
      last_(model.size()),
      alone_(model.size()),
      answer_(model.size()) {
    const std::vector<ParticleRange> elastic = elastic_bodies_of(model);
    for (const ParticleSurface& sheet : sheets) {
        const std::uint32_t first = sheet.first_particle;
        const bool is_elastic = has_body_at(elastic, first);
        sheets_.push_back({{first, first + static_cast<std::uint32_t>(sheet.rest.size())}, is_elastic});
        some_are_elastic_ = some_are_elastic_ || is_elastic;
    }
    force_.reserve(room);
    last_force_.reserve(room);
}

void SurfaceForces::begin(ElasticBodies& elastic, double h, bool goes_on) noexcept {
    elastic_ = &elastic;
    h_ = h;
    for (const Force& f : force_) {
        first_[f.of.vertex[0]] = kNone;
    }
    std::swap(force_, last_force_);
    force_.clear();
    if (!some_are_elastic_ || !goes_on) {
        last_force_.clear();
    }
}

/// With the same force, N, turned as the contact is.
void SurfaceForces::push_on(const SurfaceContact& contact, const Force& last, Row* position) {
    const double inverse_mass = masses_.inverse(contact.vertex, contact.weight);
    if (!(inverse_mass > 0.0)) {
        return;  // what is nearest now is pinned
    }
    const double again = h_ * h_ * inverse_mass / (last_h_ * last_h_ * last.inverse_mass);
    const Vec3 across = last.across - glm::dot(contact.normal, last.across) * contact.normal;
    Force& force = force_.emplace_back(
        Force{.of = contact, .inverse_mass = inverse_mass, .along = again * last.along, .across = again * across});
    force.next = std::exchange(first_[contact.vertex[0]], static_cast<std::uint32_t>(force_.size() - 1));
    displace_alone(force, force.along, force.across, position);
}

bool SurfaceForces::pushes_on(PairKind kind, const PairVertices& vertex) const noexcept {
    std::uint32_t k = first_[vertex[0]];
    while (k != kNone && !(force_[k].of.kind == kind && force_[k].of.vertex == vertex)) {
        k = force_[k].next;
    }
    return k != kNone;
}

void SurfaceForces::add(const SurfaceContact& contact) {
    if (const double inverse_mass = masses_.inverse(contact.vertex, contact.weight); inverse_mass > 0.0) {
        force_.push_back({.of = contact, .inverse_mass = inverse_mass});
    }
}

/// Moves vertices, as if each were alone, so that the points part by so much, m.
void SurfaceForces::displace_alone(const Force& force, double along, const Vec3& across, Row* rows) const noexcept {
    masses_.displace(force.of.vertex, force.of.weight, (along * force.of.normal + across) / force.inverse_mass, rows);
}

void SurfaceForces::solve(const Row* start, Row* position) noexcept {
    if (!some_are_elastic_) {
        (void)pass(start, position);
        return;
    }
    double theta = 1.0;
    double last_error = std::numeric_limits<double>::max();
    for (int round = 0; round < kMaxForceRounds && !force_.empty(); ++round) {
        // Go on in the direction of the last round, forces and positions alike; the first has none.
        const double next = 0.5 * (1.0 + std::sqrt(1.0 + 4.0 * theta * theta));
        extrapolate((std::exchange(theta, next) - 1.0) / next, position);
        // What would part the contacts if vertices moved alone, and how the sheets move by that.
        for (const Sheet& sheet : sheets_) {
            const auto [begin, end] = sheet.particles;
            std::copy(position + begin, position + end, alone_.begin() + begin);
        }
        const double error = pass(start, alone_.data());
        elastic_->workers().for_each(sheets_.size(), [&](std::size_t s) { move(sheets_[s], position); });
        if (error <= exact_) {
            break;
        }
        if (std::exchange(last_error, error) < error) {
            theta = 1.0;
        }
    }
}

/// Moves forces and positions on, by a part of what has changed since the last call.
void SurfaceForces::extrapolate(double part, Row* position) noexcept {
    const auto go_on = [part](auto& now, auto& last) {
        const auto from = std::exchange(last, now);
        if (part > 0.0) {
            now += part * (now - from);
        }
    };
    for (Force& f : force_) {
        go_on(f.along, f.last_along);
        go_on(f.across, f.last_across);
    }
    for (const Sheet& sheet : sheets_) {
        for (std::uint32_t v = sheet.particles.begin; v < sheet.particles.end; ++v) {
            Vec3 now = vector_of(position[v]);
            Vec3 last = vector_of(last_[v]);
            go_on(now, last);
            last_[v] = row_of(last);
            set_vector(position[v], now);
        }
    }
}

/// One pass over all contacts, alternately forward and backward. Returns the most that a force has changed, m.
double SurfaceForces::pass(const Row* start, Row* position) noexcept {
    double error = 0.0;
    for (std::size_t k = 0; k < force_.size(); ++k) {
        error = std::max(error, project(force_[forward_ ? k : force_.size() - 1 - k], start, position));
    }
    forward_ = !forward_;
    return error;
}

double SurfaceForces::project(Force& force, const Row* start, Row* position) const noexcept {
    const SurfaceContact& of = force.of;
    const Vec3 apart = weighted(of.weight, of.vertex, position);
    const double clearance = glm::dot(of.normal, apart) - of.min_separation;
    if (clearance >= 0.0 && force.along == 0.0) {
        return 0.0;
    }
    // Push by -C, but take back no more than was pushed in this sub-step. Friction: undo the slip of the whole sub-step
    // within its cone.
    const double change = std::max(-clearance, -force.along);
    force.along += change;
    const Vec3 moved = apart - weighted(of.weight, of.vertex, start);
    const Vec3 slip = moved - glm::dot(of.normal, moved) * of.normal;
    const Vec3 across = clamp_to_cone(force.across - slip, force.along, friction_);
    const Vec3 turned = across - force.across;
    force.across = across;
    displace_alone(force, change, turned, position);
    return std::max(std::abs(change), glm::length(turned));
}

/// Moves a sheet by the forces that would move its vertices alone to `alone_`.
void SurfaceForces::move(const Sheet& sheet, Row* position) noexcept {
    const auto [begin, end] = sheet.particles;
    if (!sheet.is_elastic) {
        std::copy(alone_.begin() + begin, alone_.begin() + end, position + begin);
        return;
    }
    bool moves = false;
    for (std::uint32_t v = begin; v < end; ++v) {
        const double inverse_mass = masses_.inverse(v);
        const Vec3 way = vector_of(alone_[v]) - vector_of(position[v]);
        moves = moves || way != Vec3(0.0);
        answer_[v] = row_of(inverse_mass > 0.0 ? way / (h_ * h_ * inverse_mass) : Vec3(0.0));
    }
    if (!moves) {
        return;
    }
    elastic_->respond(sheet.particles, std::span(answer_).subspan(begin, end - begin));
    for (std::uint32_t v = begin; v < end; ++v) {
        add_vector(position[v], vector_of(answer_[v]));
    }
}

}  // namespace haptic::sim
