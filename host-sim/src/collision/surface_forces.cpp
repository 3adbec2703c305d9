#include "collision/surface_forces.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <tuple>
#include <utility>

#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

constexpr int kMaxForceRounds = 20;

constexpr auto kByVertices = [](const auto& contact) { return std::tie(contact.of.kind, contact.of.vertex); };

}  // namespace

SurfaceForces::SurfaceForces(std::size_t particles, std::span<const ParticleSurface> sheets, const VertexMasses& masses,
                             FrictionCoefficients friction, double exact, std::size_t room)
    : masses_(masses), friction_(friction), exact_(exact), last_(particles), alone_(particles), answer_(particles) {
    for (const ParticleSurface& sheet : sheets) {
        sheets_.push_back({sheet.first_particle, sheet.first_particle + static_cast<std::uint32_t>(sheet.rest.size())});
    }
    pushing_.reserve(room);
    remembered_.reserve(room);
}

void SurfaceForces::forget() noexcept {
    pushing_.clear();
}

void SurfaceForces::begin(ElasticBodies& elastic, double h, Row* position) {
    elastic_ = &elastic;
    some_are_elastic_ = std::ranges::any_of(sheets_, [&](const ParticleRange& sheet) { return is_elastic(sheet); });
    remembered_.clear();
    if (some_are_elastic_) {
        remember(h, position);
    }
    pushing_.clear();
    h_ = h;
}

/// The forces of the last sub-step, which lead the particles on in this one, of length h.
void SurfaceForces::remember(double h, Row* position) {
    for (const Pushing& p : pushing_) {
        if (p.push > 0.0) {
            const double force = 1.0 / (h_ * h_ * p.inverse_mass);
            remembered_.push_back({p.of, force * p.push, force * p.friction, false});
            const double again = h * h / (h_ * h_);
            push(p, again * p.push, again * p.friction, position);
        }
    }
    std::ranges::sort(remembered_, {}, kByVertices);
}

SurfaceForces::Remembered* SurfaceForces::remembered(const SurfaceContact& contact) noexcept {
    const auto key = std::tie(contact.kind, contact.vertex);
    const auto found = std::ranges::lower_bound(remembered_, key, {}, kByVertices);
    return found != remembered_.end() && kByVertices(*found) == key ? &*found : nullptr;
}

void SurfaceForces::add(const SurfaceContact& contact, const Row* position) {
    const double inverse_mass = masses_.inverse(contact.vertex, contact.weight);
    if (!(inverse_mass > 0.0)) {
        return;
    }
    if (Remembered* const last = remembered(contact)) {
        add(contact, *last);
    } else if (glm::dot(contact.normal, weighted(contact.weight, contact.vertex, position)) < contact.min_separation) {
        pushing_.push_back({.of = contact, .inverse_mass = inverse_mass});
    }
}

/// With the force that it had.
void SurfaceForces::add(const SurfaceContact& contact, Remembered& last) {
    last.found = true;
    const double inverse_mass = masses_.inverse(contact.vertex, contact.weight);
    const double by_force = h_ * h_ * inverse_mass;
    const Vec3 across = last.across - glm::dot(contact.normal, last.across) * contact.normal;
    pushing_.push_back(
        {.of = contact, .inverse_mass = inverse_mass, .push = by_force * last.along, .friction = by_force * across});
}

void SurfaceForces::add_others() {
    for (Remembered& r : remembered_) {
        if (!r.found) {
            add(r.of, r);
        }
    }
}

/// Displaces vertices, as if they moved alone, so that the points part by so much, m.
void SurfaceForces::push(const Pushing& contact, double along, const Vec3& across, Row* rows) const noexcept {
    masses_.displace(contact.of.vertex, contact.of.weight, (along * contact.of.normal + across) / contact.inverse_mass,
                     rows);
}

void SurfaceForces::solve(const Row* start, Row* position) noexcept {
    if (pushing_.empty()) {
        return;
    }
    const int rounds = some_are_elastic_ ? kMaxForceRounds : 1;
    double momentum = 1.0;
    double last_error = std::numeric_limits<double>::max();
    for (int round = 0; round < rounds; ++round) {
        // Go on in the direction of the last round, forces and positions alike; the first has none.
        const double next = 0.5 * (1.0 + std::sqrt(1.0 + 4.0 * momentum * momentum));
        extrapolate((std::exchange(momentum, next) - 1.0) / next, position);
        // What would part the contacts if vertices moved alone, and how the sheets move by that.
        for (const ParticleRange& sheet : sheets_) {
            std::copy(position + sheet.begin, position + sheet.end, alone_.begin() + sheet.begin);
        }
        const double error = pass(start, alone_.data());
        elastic_->workers().for_each(sheets_.size(), [&](std::size_t s) { move(sheets_[s], position); });
        if (error <= exact_) {
            break;
        }
        if (std::exchange(last_error, error) < error) {
            momentum = 1.0;
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
    for (Pushing& p : pushing_) {
        go_on(p.push, p.last_push);
        go_on(p.friction, p.last_friction);
    }
    for (const ParticleRange& sheet : sheets_) {
        for (std::uint32_t v = sheet.begin; v < sheet.end; ++v) {
            Vec3 now = vector_of(position[v]);
            Vec3 last = vector_of(last_[v]);
            go_on(now, last);
            last_[v] = row_of(last);
            set_vector(position[v], now);
        }
    }
}

/// One pass over all contacts, alternately forward and backward. Returns the largest error that one of them had before
/// its turn, m.
double SurfaceForces::pass(const Row* start, Row* position) noexcept {
    double error = 0.0;
    for (std::size_t k = 0; k < pushing_.size(); ++k) {
        error = std::max(error, project(pushing_[forward_ ? k : pushing_.size() - 1 - k], start, position));
    }
    forward_ = !forward_;
    return error;
}

double SurfaceForces::project(Pushing& contact, const Row* start, Row* position) const noexcept {
    const SurfaceContact& of = contact.of;
    const Vec3 apart = weighted(of.weight, of.vertex, position);
    const double clearance = glm::dot(of.normal, apart) - of.min_separation;
    if (clearance >= 0.0 && contact.push == 0.0) {
        return 0.0;
    }
    // Push by -C, but take back no more than was pushed in this sub-step. Friction: undo the slip of the whole sub-step
    // within its cone.
    const double change = std::max(-clearance, -contact.push);
    contact.push += change;
    const Vec3 moved = apart - weighted(of.weight, of.vertex, start);
    const Vec3 slip = moved - glm::dot(of.normal, moved) * of.normal;
    const Vec3 friction = clamp_to_cone(contact.friction - slip, contact.push, friction_);
    push(contact, change, friction - contact.friction, position);
    contact.friction = friction;
    return std::abs(change);
}

bool SurfaceForces::is_elastic(const ParticleRange& sheet) const noexcept {
    const ParticleRange body = elastic_->body_of(sheet.begin);
    return body.begin != body.end;
}

/// Moves a sheet by the forces that would move its vertices alone to `alone_`.
void SurfaceForces::move(const ParticleRange& sheet, Row* position) noexcept {
    if (!is_elastic(sheet)) {
        std::copy(alone_.begin() + sheet.begin, alone_.begin() + sheet.end, position + sheet.begin);
        return;
    }
    bool moves = false;
    for (std::uint32_t v = sheet.begin; v < sheet.end; ++v) {
        const double inverse_mass = masses_.inverse(v);
        const Vec3 way = vector_of(alone_[v]) - vector_of(position[v]);
        moves = moves || way != Vec3(0.0);
        answer_[v] = row_of(inverse_mass > 0.0 ? way / (h_ * h_ * inverse_mass) : Vec3(0.0));
    }
    if (!moves) {
        return;
    }
    elastic_->respond(sheet, std::span(answer_).subspan(sheet.begin, sheet.end - sheet.begin));
    for (std::uint32_t v = sheet.begin; v < sheet.end; ++v) {
        add_vector(position[v], vector_of(answer_[v]));
    }
}

}  // namespace haptic::sim
