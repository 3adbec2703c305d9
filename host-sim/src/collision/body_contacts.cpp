#include "collision/body_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

// Largest error of a contact, of the smallest mean semi-axis. That which pushes counts in both directions: a push that
// came too early leaves a contact open, and its body would leave with what it was pushed too far.
constexpr double kMaxError = 1e-4;
// Contacts that two passes bring to no less than this share of their error conflict: they are left to later sub-steps.
constexpr double kConflict = 0.75;
// Successive over-relaxation: each turn goes so much further than to where its contact alone would be met. Heaps need a
// fifth fewer turns; more than this makes single contacts slower.
constexpr double kRelaxation = 1.1;
constexpr std::uint32_t kNone = 0xffff'ffff;

}  // namespace

BodyContacts::BodyContacts(const ParticleModel& model, const Colliders& colliders, std::size_t capacity,
                           FrictionCoefficients friction, double min_size)
    : colliders_(colliders), friction_(friction), tolerance_(kMaxError * min_size), pushes_(model) {
    candidate_.reserve(capacity);
    order_.resize(capacity);
    has_joined_.resize(capacity);
    active_ = std::make_unique_for_overwrite<Active[]>(capacity);
    remembered_.reserve(capacity);
    first_remembered_.assign(model.size(), kNone);
    for (const ParticleRange& body : bodies_of(model)) {
        first_particle_.push_back(body.begin);
    }
    parent_.resize(first_particle_.size());
    island_of_.resize(first_particle_.size());
    body_order_.resize(first_particle_.size());
    pushed_bodies_.reserve(first_particle_.size());
    is_pushed_.resize(first_particle_.size());
    island_.reserve(first_particle_.size());
}

void BodyContacts::begin(const ParticleModel& start, ElasticBodies& elastic, double h, double push_out) noexcept {
    workers_ = &elastic.workers();
    remember();
    pushes_.begin(start, elastic, h);
    expect_pushes();
    h_ = h;
    push_out_ = push_out;
    candidate_.clear();
    island_.clear();
    islands_known_ = false;
}

bool BodyContacts::add(const ContactCandidate& candidate) noexcept {
    if (candidate_.size() == candidate_.capacity()) {
        return false;
    }
    candidate_.push_back(candidate);
    return true;
}

/// The contacts of the sub-step that has ended, for the next one.
void BodyContacts::remember() noexcept {
    for (const Remembered& r : remembered_) {
        first_remembered_[r.first] = kNone;
    }
    remembered_.clear();
    for (const Island& island : island_) {
        for (std::uint32_t k = island.begin; k < island.begin + island.active; ++k) {
            const Active& c = active_[k];
            if (c.push > 0.0) {
                remembered_.push_back(
                    {c.of.first, c.of.second, c.push / c.compliance.along, c.friction / c.compliance.across});
            }
        }
    }
    std::ranges::sort(remembered_, {}, [](const Remembered& r) { return std::pair(r.first, r.second); });
    for (std::size_t k = remembered_.size(); k-- > 0;) {
        first_remembered_[remembered_[k].first] = static_cast<std::uint32_t>(k);
    }
}

/// Bodies that were pushed in the last sub-step will be again.
void BodyContacts::expect_pushes() noexcept {
    pushed_bodies_.clear();
    const auto add = [&](std::uint32_t particle) {
        if (particle != ContactCandidate::kGround &&
            std::exchange(is_pushed_[colliders_[particle].body], std::uint8_t{1}) == 0) {
            pushed_bodies_.push_back(particle);
        }
    };
    for (const Remembered& r : remembered_) {
        add(r.first);
        add(r.second);
    }
    for (const std::uint32_t particle : pushed_bodies_) {
        is_pushed_[colliders_[particle].body] = 0;
    }
    // In the order of the bodies, so that each thread has those that it moves otherwise too.
    std::ranges::sort(pushed_bodies_);
    workers_->for_each(pushed_bodies_.size(), [&](std::size_t k) { pushes_.expect(pushed_bodies_[k]); });
}

const BodyContacts::Remembered* BodyContacts::remembered(const ContactCandidate& candidate) const noexcept {
    for (std::size_t k = first_remembered_[candidate.first];
         k < remembered_.size() && remembered_[k].first == candidate.first; ++k) {
        if (remembered_[k].second == candidate.second) {
            return &remembered_[k];
        }
    }
    return nullptr;
}

/// The body that stands for all that this one may touch.
std::uint32_t BodyContacts::root(std::uint32_t body) noexcept {
    while (parent_[body] != body) {
        body = parent_[body] = parent_[parent_[body]];
    }
    return body;
}

void BodyContacts::form_islands() noexcept {
    // Candidates unite their bodies; what cannot move does not pass forces on.
    std::iota(parent_.begin(), parent_.end(), 0U);
    const auto movable = [&](std::uint32_t particle) {
        return particle != ContactCandidate::kGround && colliders_[particle].inverse_mass > 0.0;
    };
    for (const ContactCandidate& c : candidate_) {
        if (movable(c.first) && movable(c.second)) {
            const auto [low, high] = std::minmax({root(colliders_[c.first].body), root(colliders_[c.second].body)});
            parent_[high] = low;
        }
    }
    // Islands in the order of their candidates, and how many each has.
    std::fill(island_of_.begin(), island_of_.end(), kNone);
    const auto island_of = [&](const ContactCandidate& c) -> std::uint32_t& {
        return island_of_[root(colliders_[movable(c.first) ? c.first : c.second].body)];
    };
    for (const ContactCandidate& c : candidate_) {
        std::uint32_t& island = island_of(c);
        if (island == kNone) {
            island = static_cast<std::uint32_t>(island_.size());
            island_.push_back({});
        }
        ++island_[island].end;
    }
    for (std::uint32_t b = 0; b < parent_.size(); ++b) {
        if (const std::uint32_t island = island_of_[root(b)]; island != kNone) {
            ++island_[island].end_body;
        }
    }
    // Their ranges, filled in order.
    std::uint32_t end = 0;
    std::uint32_t end_body = 0;
    for (Island& island : island_) {
        island.begin = std::exchange(end, end + island.end);
        island.first_body = std::exchange(end_body, end_body + island.end_body);
        island.end = island.begin;
        island.end_body = island.first_body;
    }
    for (std::uint32_t c = 0; c < candidate_.size(); ++c) {
        order_[island_[island_of(candidate_[c])].end++] = c;
    }
    for (std::uint32_t b = 0; b < parent_.size(); ++b) {
        if (const std::uint32_t island = island_of_[root(b)]; island != kNone) {
            body_order_[island_[island].end_body++] = first_particle_[b];
        }
    }
    std::fill_n(has_joined_.begin(), candidate_.size(), std::uint8_t{0});
}

void BodyContacts::solve(Row* position, int max_passes) noexcept {
    if (!std::exchange(islands_known_, true)) {
        form_islands();
    }
    workers_->for_each(island_.size(), [&](std::size_t k) { solve_island(island_[k], position, max_passes); });
}

void BodyContacts::solve_island(Island& island, Row* position, int max_passes) noexcept {
    constexpr double never = std::numeric_limits<double>::max();
    const auto move_bodies = [&] {
        for (std::uint32_t b = island.first_body; b < island.end_body; ++b) {
            pushes_.move_body(body_order_[b], position);
        }
    };
    // Where the last forces lead shows best which others join.
    if (join_remembered(island, position)) {
        move_bodies();
    }
    // Rounds: contacts join, push until they agree, and move their bodies.
    bool open = join_violated(island, position) || island.active > 0;
    for (int pass = 0; open && pass < max_passes; open = join_violated(island, position)) {
        double before_last = never;
        double last = never;
        while (pass++ < max_passes) {
            const double error = project_all(island, position);
            if (error <= tolerance_ || error > kConflict * before_last) {
                break;
            }
            before_last = std::exchange(last, error);
        }
        move_bodies();
    }
}

/// Lets those candidates push that did in the last sub-step, with the same forces. Whether there were any; once in a
/// sub-step.
bool BodyContacts::join_remembered(Island& island, Row* position) noexcept {
    if (std::exchange(island.begun, true) || remembered_.empty()) {
        return false;
    }
    for (std::uint32_t k = island.begin; k < island.end; ++k) {
        const ContactCandidate& c = candidate_[order_[k]];
        const Remembered* const last = remembered(c);
        if (last == nullptr) {
            continue;
        }
        const SeparatingPlane plane = fitted_plane(c, offset(c, position));
        Active& joined = join(island, k, plane);
        joined.push = last->along * joined.compliance.along;
        joined.friction =
            joined.compliance.across * (last->across - glm::dot(plane.normal, last->across) * plane.normal);
    }
    // All forces at once: those that join move with each.
    for (std::uint32_t k = island.begin; k < island.begin + island.active; ++k) {
        push_apart(active_[k], force_of(active_[k], active_[k].push, active_[k].friction), position);
    }
    return island.active > 0;
}

/// Lets those candidates push that are violated where the bodies are. Whether there were any.
bool BodyContacts::join_violated(Island& island, Row* position) noexcept {
    const std::uint32_t before = island.active;
    for (std::uint32_t k = island.begin; k < island.end; ++k) {
        if (has_joined_[k] != 0) {
            continue;
        }
        const ContactCandidate& c = candidate_[order_[k]];
        const Vec3 apart = offset(c, position);
        if (glm::dot(c.plane.normal, apart) >= c.plane.min_separation) {
            continue;
        }
        // First violation: fit the plane to where the pair is now.
        const SeparatingPlane plane = fitted_plane(c, apart);
        if (glm::dot(plane.normal, apart) < plane.min_separation) {
            join(island, k, plane);
        }
    }
    return island.active != before;
}

/// m, x1 - x2 where the bodies are.
Vec3 BodyContacts::offset(const ContactCandidate& candidate, const Row* position) noexcept {
    const Vec3 first = vector_of(position[candidate.first]);
    return candidate.second == ContactCandidate::kGround ? first : first - vector_of(position[candidate.second]);
}

/// The plane for two particles on their way to this offset, m; that of the ground is final.
SeparatingPlane BodyContacts::fitted_plane(const ContactCandidate& candidate, const Vec3& apart) const noexcept {
    return candidate.second == ContactCandidate::kGround
               ? candidate.plane
               : colliders_.fit_plane(candidate.first, candidate.second, candidate.from, apart, push_out_);
}

/// The candidate at a place of order_ joins, without a force.
BodyContacts::Active& BodyContacts::join(Island& island, std::uint32_t at, const SeparatingPlane& plane) noexcept {
    const ContactCandidate& c = candidate_[order_[at]];
    const bool is_pair = c.second != ContactCandidate::kGround;
    has_joined_[at] = 1;
    Active& joined = active_[island.begin + island.active++];
    joined = {.of = {c.first, c.second, plane, c.from},
              .first = pushes_.take_part(c.first),
              .second = is_pair ? pushes_.take_part(c.second) : ElasticPushes::Place{},
              .compliance = {},
              .push = 0.0,
              .friction = Vec3(0.0)};
    const auto add_compliance = [&](std::uint32_t particle, const ElasticPushes::Place& place) {
        const double alone = compliance_alone(particle);
        const ElasticPushes::Compliance own =
            place.has_body() ? pushes_.compliance(place, plane.normal) : ElasticPushes::Compliance{alone, alone};
        joined.compliance.along += own.along;
        joined.compliance.across += own.across;
    };
    add_compliance(c.first, joined.first);
    if (is_pair) {
        add_compliance(c.second, joined.second);
    }
    return joined;
}

/// One pass over the contacts that have joined, alternately forward and backward, so that the order has no preferred
/// direction. Returns the largest error that one of them had before its turn, m.
double BodyContacts::project_all(Island& island, Row* position) noexcept {
    double error = 0.0;
    for (std::uint32_t k = 0; k < island.active; ++k) {
        const std::uint32_t at = island.forward ? k : island.active - 1 - k;
        error = std::max(error, project(active_[island.begin + at], position));
    }
    island.forward = !island.forward;
    return error;
}

Vec3 BodyContacts::offset(const Active& contact, const Row* position) const noexcept {
    const auto at = [&](std::uint32_t particle, const ElasticPushes::Place& place) {
        const Vec3 moved = place.has_body() ? pushes_.displacement(place) : Vec3(0.0);
        return vector_of(position[particle]) + moved;
    };
    const Vec3 first = at(contact.of.first, contact.first);
    return contact.of.second == ContactCandidate::kGround ? first : first - at(contact.of.second, contact.second);
}

double BodyContacts::project(Active& contact, Row* position) noexcept {
    const Vec3 apart = offset(contact, position);
    const double clearance = glm::dot(contact.of.plane.normal, apart) - contact.of.plane.min_separation;
    if (clearance >= 0.0 && contact.push == 0.0) {
        return 0.0;
    }
    // Push by -C and a little more, but take back no more than was pushed in this sub-step.
    const double change = std::max(-kRelaxation * clearance, -contact.push);
    contact.push += change;
    // Friction: undo the slip of the whole sub-step along the plane, within the friction cone. Apply the change since
    // the last pass.
    const Vec3 moved = apart - contact.of.from;
    const Vec3 slip = moved - glm::dot(contact.of.plane.normal, moved) * contact.of.plane.normal;
    const Vec3 friction = clamp_to_cone(contact.friction - kRelaxation * slip, contact.push, friction_);
    const Vec3 across = friction - contact.friction;
    contact.friction = friction;
    push_apart(contact, force_of(contact, change, across), position);
    return std::abs(change);
}

/// N, for these displacements along and across the normal.
Vec3 BodyContacts::force_of(const Active& contact, double along, const Vec3& across) noexcept {
    return along / contact.compliance.along * contact.of.plane.normal + across / contact.compliance.across;
}

/// Pushes the first with a force, N, and the second with its opposite.
void BodyContacts::push_apart(const Active& contact, const Vec3& force, Row* position) noexcept {
    push(contact.of.first, contact.first, force, position);
    if (contact.of.second != ContactCandidate::kGround) {
        push(contact.of.second, contact.second, -force, position);
    }
}

/// Moves a particle by a force, and its body along with it if it has a place there.
void BodyContacts::push(std::uint32_t particle, const ElasticPushes::Place& place, const Vec3& force,
                        Row* position) noexcept {
    if (place.has_body()) {
        pushes_.push(place, force);
    } else {
        push_alone(particle, force, position);
    }
}

void BodyContacts::push_alone(std::uint32_t particle, const Vec3& force, Row* displaced) const noexcept {
    add_vector(displaced[particle], compliance_alone(particle) * force);
}

/// m/N, in the sub-step.
double BodyContacts::compliance_alone(std::uint32_t particle) const noexcept {
    return h_ * h_ * colliders_[particle].inverse_mass;
}

std::size_t BodyContacts::add_pushes(Row* pushed) const noexcept {
    std::size_t pushing = 0;
    for (const Island& island : island_) {
        for (std::uint32_t k = island.begin; k < island.begin + island.active; ++k) {
            const Active& contact = active_[k];
            if (!(contact.push > 0.0)) {
                continue;
            }
            ++pushing;
            const Vec3 force = force_of(contact, contact.push, contact.friction);
            push_alone(contact.of.first, force, pushed);
            if (contact.of.second != ContactCandidate::kGround) {
                push_alone(contact.of.second, -force, pushed);
            }
        }
    }
    return pushing;
}

}  // namespace haptic::sim
