#include "collision/body_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/one_lane.hpp"
#include "dynamics/rows.hpp"
#include "dynamics/united.hpp"

namespace haptic::sim {
namespace {

// Largest error of a contact, of the smallest mean semi-axis. That which pushes counts in both directions: a push that
// came too early leaves a contact open, and its body would leave with what it was pushed too far. With ten times as
// much, what passes leave over drives heaps: a fish rolls on another by up to 10 um/s for ever.
constexpr double kMaxError = 1e-5;
// Contacts that two passes bring to no less than this share of their error conflict: they are left to later sub-steps.
constexpr double kConflict = 0.75;
// Successive over-relaxation: each turn goes so much further than to where its contact alone would be met. Heaps need a
// fifth fewer turns; more than this makes single contacts slower.
constexpr double kRelaxation = 1.1;
// Of the product of the compliances of two contacts, the square of what they share: from the first to the second they
// are solved together. One after the other they would leave so much of an error in each pass. With 0.85 some heaps
// never come to rest; with 0.25 layers that are squeezed burst. Those that share all are one contact.
constexpr double kLeastShared = 0.7;
constexpr double kMostShared = 0.999;
// Sizes of a particle by which a remembered force moves it alone. What presses a fin against the ground moves it by up
// to 17 of them. Where there is no room, more than this is what contacts do to one another: of that, half is forgotten
// in each sub-step, or they would push harder for ever, and sideways at last.
constexpr double kMostMoved = 30.0;
// Contacts that push by more sizes than these may be asked to leave overlaps for which there is no room, and what moves
// aside instead would keep its speed. Each may take this part of the way out that it took, at least so much of the
// whole, and more by so much in each sub-step in which it pushes less.
constexpr double kMostMovedOut = 2.0;
constexpr double kLessOut = 0.25;
constexpr double kLeastOut = 1.0 / 64.0;
constexpr double kMoreOut = 1.01;
constexpr std::uint32_t kNone = 0xffff'ffff;

/// A stride of about the golden section of `count` that visits all of them.
std::uint32_t coprime_stride(std::uint32_t count) noexcept {
    auto stride = static_cast<std::uint32_t>(0.618 * count) + 1;
    while (std::gcd(stride, count) > 1) {
        ++stride;
    }
    return stride % count;
}

/// m, x1 - x2 where the bodies are.
inline Vec3 offset(const ContactCandidate& candidate, const Row* position) noexcept {
    const Vec3 first = vector_of(position[candidate.first]);
    return candidate.second == ContactCandidate::kGround ? first : first - vector_of(position[candidate.second]);
}

}  // namespace

BodyContacts::BodyContacts(const ParticleModel& model, const Colliders& colliders, std::size_t capacity,
                           FrictionCoefficients friction, double min_size)
    : colliders_(colliders), friction_(friction), tolerance_(kMaxError * min_size), pushes_(model) {
    candidate_.reserve(capacity);
    candidate_body_.reserve(capacity);
    order_.resize(capacity);
    has_joined_.resize(capacity);
    active_ = std::make_unique_for_overwrite<ContactMemory[]>(capacity);
    active_particles_ = std::make_unique_for_overwrite<NearPair[]>(capacity);
    permits_ = std::make_unique_for_overwrite<double[]>(capacity);
    previous_at_ = std::make_unique_for_overwrite<NearPair[]>(capacity);
    last_at_.assign(model.size(), kNone);
    remembered_.reserve(capacity);
    first_remembered_.assign(model.size(), kNone);
    for (const ParticleRange& body : bodies_of(model)) {
        std::uint32_t some = body.begin;
        while (some + 1 < body.end && !pushes_.answers(some)) {
            ++some;
        }
        some_particle_.push_back(some);
    }
    parent_.resize(some_particle_.size());
    island_of_.resize(some_particle_.size());
    body_order_.resize(some_particle_.size());
    island_.reserve(some_particle_.size());
}

void BodyContacts::begin(const ParticleModel& start, ElasticBodies& elastic, double h,
                         const PushOut& push_out) noexcept {
    workers_ = &elastic.workers();
    kernels_ = &elastic.kernels();
    remember(start);
    pushes_.begin(start, elastic, h);
    expect_pushes();
    h_ = h;
    push_out_ = push_out;
    candidate_.clear();
    candidate_body_.clear();
    std::iota(parent_.begin(), parent_.end(), 0U);
    island_.clear();
    islands_known_ = false;
}

/// A candidate unites its bodies; what cannot move does not pass forces on.
void BodyContacts::unite(std::uint32_t first, std::uint32_t second) noexcept {
    const bool is_pair = second != ContactCandidate::kGround;
    const Collider& one = colliders_[first];
    const Collider& other = colliders_[is_pair ? second : first];
    candidate_body_.push_back(one.inverse_mass > 0.0 ? one.body : other.body);
    if (is_pair && one.inverse_mass > 0.0 && other.inverse_mass > 0.0) {
        const auto [low, high] = std::minmax({root_of(parent_, one.body), root_of(parent_, other.body)});
        parent_[high] = low;
    }
}

/// The contacts of the sub-step that has ended, for the next one, unless they sleep in it.
void BodyContacts::remember(const ParticleModel& start) noexcept {
    for (const Remembered& r : remembered_) {
        first_remembered_[r.first] = kNone;
    }
    remembered_.clear();
    for (const Island& island : island_) {
        for (std::uint32_t k = island.begin; k < island.begin + island.active; ++k) {
            const PushedContact& c = *active(k);
            const auto [first, second] = active_particles_[k];
            const bool sleeps =
                start.asleep[first] != 0 || (second != ContactCandidate::kGround && start.asleep[second] != 0);
            if (c.push > 0.0 && !sleeps) {
                const double sizes = c.push / colliders_[first].size;
                const double kept = sizes > kMostMoved ? 0.5 : 1.0;
                const double permits = sizes > kMostMovedOut ? std::max(kLeastOut, kLessOut * permits_[k])
                                                             : std::min(1.0, kMoreOut * permits_[k]);
                remembered_.push_back({first, second, kept * c.push * c.along, kept * vector_of(c.friction), permits});
            }
        }
    }
    std::ranges::sort(remembered_, {}, [](const Remembered& r) { return std::pair(r.first, r.second); });
    for (std::size_t k = remembered_.size(); k-- > 0;) {
        first_remembered_[remembered_[k].first] = static_cast<std::uint32_t>(k);
    }
}

/// Particles that were pushed in the last sub-step will be again.
void BodyContacts::expect_pushes() noexcept {
    for (const Remembered& r : remembered_) {
        pushes_.expect(r.first);
        if (r.second != ContactCandidate::kGround) {
            pushes_.expect(r.second);
        }
    }
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

void BodyContacts::form_islands() noexcept {
    // Islands in the order of their candidates, and how many each has.
    std::fill(island_of_.begin(), island_of_.end(), kNone);
    for (std::uint32_t c = 0; c < candidate_.size(); ++c) {
        std::uint32_t& island = island_of_[root_of(parent_, candidate_body_[c])];
        if (island == kNone) {
            island = static_cast<std::uint32_t>(island_.size());
            island_.push_back({});
        }
        ++island_[island].end;
    }
    for (std::uint32_t b = 0; b < parent_.size(); ++b) {
        island_of_[b] = island_of_[root_of(parent_, b)];
        if (island_of_[b] != kNone) {
            ++island_[island_of_[b]].end_body;
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
        order_[island_[island_of_[candidate_body_[c]]].end++] = c;
    }
    for (std::uint32_t b = 0; b < parent_.size(); ++b) {
        if (island_of_[b] != kNone) {
            body_order_[island_[island_of_[b]].end_body++] = some_particle_[b];
        }
    }
    std::fill_n(has_joined_.begin(), candidate_.size(), std::uint8_t{0});
}

/// Forms the islands, once in a sub-step.
void BodyContacts::know_islands() noexcept {
    if (!std::exchange(islands_known_, true)) {
        form_islands();
    }
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
        match(island);
        double before_last = never;
        double last = never;
        while (pass++ < max_passes) {
            const double error = project_all(island);
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
        PushedContact& joined = join(island, k, plane, last->permits, position);
        joined.push = last->along / joined.along;
        joined.friction = row_of(last->across - glm::dot(plane.normal, last->across) * plane.normal);
    }
    // All forces at once: those that join move with each.
    for (std::uint32_t k = island.begin; k < island.begin + island.active; ++k) {
        push_apart(*active(k));
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
            join(island, k, plane, 1.0, position);
        }
    }
    return island.active != before;
}

/// The plane for two particles on their way to this offset, m; that of the ground is final.
SeparatingPlane BodyContacts::fitted_plane(const ContactCandidate& candidate, const Vec3& apart) const noexcept {
    return candidate.second == ContactCandidate::kGround
               ? candidate.plane
               : colliders_.fit_plane(candidate.first, candidate.second, candidate.from, apart, push_out_);
}

/// The candidate at a place of order_ joins, without a force. `permits`: see Remembered.
PushedContact& BodyContacts::join(Island& island, std::uint32_t at, const SeparatingPlane& plane, double permits,
                                  Row* position) noexcept {
    const ContactCandidate& c = candidate_[order_[at]];
    has_joined_[at] = 1;
    const bool is_pair = c.second != ContactCandidate::kGround;
    const std::array<ElasticPushes::Place, 2> place{pushes_.take_part(c.first),
                                                    is_pair ? pushes_.take_part(c.second) : ElasticPushes::Place{}};
    const std::array<Vec3, 2> surface = touching_points(c, plane.normal, place);
    const std::array<Vec3, 2> arm = arms(c, surface, place);
    ElasticPushes::Compliance both;
    Vec3 from = c.from;
    double min_separation = plane.min_separation;
    if (permits < 1.0) {
        const double at_start = glm::dot(plane.normal, c.from);
        min_separation = std::min(min_separation, at_start + permits * (min_separation - at_start));
    }
    const auto side_of = [&](std::uint32_t particle, std::size_t which) -> PushedContact::Side {
        if (!place[which].has_body()) {
            const double alone = compliance_alone(particle);
            both.along += alone;
            both.across += alone;
            return {nullptr, position + particle, alone};
        }
        const ElasticPushes::Compliance own = pushes_.compliance(place[which], arm[which], plane.normal);
        both.along += own.along;
        both.across += own.across;
        if (pushes_.turns(place[which])) {
            // What has turned the arm before pushes counts as its motion: of slip all, along the normal what goes
            // beyond the motion of the ellipsoid, whose rotation the plane knows.
            const Vec3 turned = (which == 0 ? 1.0 : -1.0) * pushes_.turned_before(place[which], position);
            from -= glm::cross(turned, arm[which]);
            min_separation -= glm::dot(plane.normal, glm::cross(turned, arm[which] - surface[which]));
        }
        return {&pushes_.kernel_place(place[which]), position + particle, 0.0, lane(arm[which])};
    };
    const PushedContact::Side first = side_of(c.first, 0);
    const PushedContact::Side second = is_pair ? side_of(c.second, 1) : PushedContact::Side{};
    const std::uint32_t joins = island.begin + island.active++;
    active_particles_[joins] = {c.first, c.second};
    permits_[joins] = permits;
    // In place: a copy of the whole would wait until all of it had been stored.
    PushedContact& joined = *std::construct_at(active(joins));
    joined.normal = row_of(plane.normal);
    joined.from = row_of(from);
    joined.from_along = glm::dot(plane.normal, from);
    joined.min_separation = min_separation;
    joined.along = 1.0 / both.along;
    joined.across = 1.0 / both.across;
    joined.first = first;
    joined.second = second;
    return joined;
}

/// m: from each particle of a contact that turns with its body to where it reaches farthest towards the other.
std::array<Vec3, 2> BodyContacts::touching_points(const ContactCandidate& candidate, const Vec3& normal,
                                                  const std::array<ElasticPushes::Place, 2>& place) const noexcept {
    const auto reach = [&](std::size_t which, std::uint32_t particle, const Vec3& towards) {
        return pushes_.turns(place[which]) ? colliders_.farthest(particle, towards) : Vec3(0.0);
    };
    return {reach(0, candidate.first, -normal), reach(1, candidate.second, normal)};
}

/// m: from each particle of a contact to where its force acts. Between two bodies that move freely that is one point of
/// the start of the sub-step, or they would get angular momentum from nothing: midway between where they touch, or the
/// middle of the particle that does not turn.
std::array<Vec3, 2> BodyContacts::arms(const ContactCandidate& candidate, const std::array<Vec3, 2>& surface,
                                       const std::array<ElasticPushes::Place, 2>& place) const noexcept {
    if (candidate.second == ContactCandidate::kGround) {
        return surface;
    }
    const auto turns = [&](std::size_t which) { return pushes_.turns(place[which]); };
    const auto moves_only = [&](std::size_t which, std::uint32_t particle) {
        return place[which].has_body() ? pushes_.is_free(place[which]) && !turns(which)
                                       : colliders_[particle].inverse_mass > 0.0;
    };
    const Vec3 none(0.0);
    if (turns(0) && turns(1)) {
        const Vec3 half = 0.5 * (candidate.from + surface[0] - surface[1]);
        return {surface[0] - half, surface[1] + half};
    }
    if (turns(0) && moves_only(1, candidate.second)) {
        return {-candidate.from, none};
    }
    if (turns(1) && moves_only(0, candidate.first)) {
        return {none, candidate.from};
    }
    return surface;
}

/// m/N: how far a force of one contact opens the other.
double BodyContacts::coupling(const PushedContact& one, const PushedContact& other) const noexcept {
    double sum = 0.0;
    for (const auto* a : {&one.first, &one.second}) {
        for (const auto* b : {&other.first, &other.second}) {
            if (a->place != nullptr && b->place != nullptr) {
                const double sign = (a == &one.first) == (b == &other.first) ? 1.0 : -1.0;
                sum += sign * pushes_.response(*a, vector_of(one.normal), *b, vector_of(other.normal));
            }
        }
    }
    return sum;
}

/// Calls visit(particle, previous, normal) for each particle of an active contact that moves its body: the contact that
/// had it before, and the way in which this one pushes it.
template <class Visit>
void BodyContacts::each_side(std::uint32_t contact, const Visit& visit) noexcept {
    const auto [first, second] = active_particles_[contact];
    const Vec3 normal = vector_of(active(contact)->normal);
    if (answers(first)) {
        visit(first, previous_at_[contact].first, normal);
    }
    if (second != ContactCandidate::kGround && answers(second)) {
        visit(second, previous_at_[contact].second, -normal);
    }
}

/// Joins contacts to pairs that push the same particle in opposite ways, as where a fin lies between a body and the
/// ground. Of a force that is large for what is between, each would hand on little when its turn comes.
void BodyContacts::match(Island& island) noexcept {
    const std::uint32_t end = island.begin + island.active;
    for (std::uint32_t k = island.begin; k < end; ++k) {
        active(k)->partner = 0;
        each_side(k, [&](std::uint32_t particle, std::uint32_t& previous, const Vec3& /*way*/) {
            previous = std::exchange(last_at_[particle], k);
        });
    }
    for (std::uint32_t k = island.begin; k < end; ++k) {
        if (active(k)->partner == 0) {
            match_one(k);
        }
    }
    for (std::uint32_t k = island.begin; k < end; ++k) {
        each_side(k, [&](std::uint32_t particle, std::uint32_t& /*previous*/, const Vec3& /*way*/) {
            last_at_[particle] = kNone;
        });
    }
}

/// Gives an active contact the partner, of those behind it that have none, with which it shares most. The ones before
/// share too little with it, or would have taken it. Between two that cannot move nothing is handed on, and forces that
/// meet both would drive the particle out sideways.
void BodyContacts::match_one(std::uint32_t contact) noexcept {
    PushedContact& one = *active(contact);
    double most = kLeastShared;
    std::uint32_t partner = kNone;
    const auto is_fixed = [&](std::uint32_t k, std::uint32_t beside) {
        const PushedContact::Side& other = active_particles_[k].first == beside ? active(k)->second : active(k)->first;
        return other.place == nullptr && other.alone == 0.0;
    };
    each_side(contact, [&](std::uint32_t particle, std::uint32_t& /*previous*/, const Vec3& way) {
        for (std::uint32_t k = last_at_[particle]; k != kNone && k > contact;) {
            const PushedContact& other = *active(k);
            const bool is_first = active_particles_[k].first == particle;
            const double alike = (is_first ? 1.0 : -1.0) * glm::dot(way, vector_of(other.normal));
            if (alike < 0.0 && other.partner == 0 && !(is_fixed(contact, particle) && is_fixed(k, particle))) {
                const double between = coupling(one, other);
                const double shared = between * between * one.along * other.along;
                if (between < 0.0 && shared > most && shared < kMostShared) {
                    most = shared;
                    partner = k;
                    one.coupling = static_cast<float>(between);
                }
            }
            k = is_first ? previous_at_[k].first : previous_at_[k].second;
        }
    });
    if (partner != kNone) {
        one.partner = static_cast<std::int32_t>(partner - contact);
        active(partner)->partner = -one.partner;
    }
}

/// One pass over the contacts that have joined, alternately forward and backward, so that the order has no preferred
/// direction. Returns the largest error that one of them had before its turn, m.
double BodyContacts::project_all(Island& island) noexcept {
    if (island.active == 0) {
        return 0.0;
    }
    // In long strides: neighbours in the list push the same bodies, and would wait for one another in the processor.
    const double error = kernels_->pass({.count = island.active,
                                         .contact = active(island.begin),
                                         .stride = coprime_stride(island.active),
                                         .forward = island.forward,
                                         .relaxation = kRelaxation,
                                         .sticking = friction_.sticking,
                                         .sliding = friction_.sliding});
    island.forward = !island.forward;
    return error;
}

/// N, on the first.
Vec3 BodyContacts::force_of(const PushedContact& c) noexcept {
    return c.push * c.along * vector_of(c.normal) + vector_of(c.friction);
}

/// Pushes both with the contact's whole force.
void BodyContacts::push_apart(const PushedContact& contact) noexcept {
    const Vec3 force = force_of(contact);
    kernels_->push(contact.first, row_of(force));
    kernels_->push(contact.second, row_of(-force));
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
            const PushedContact& contact = *active(k);
            if (!(contact.push > 0.0)) {
                continue;
            }
            ++pushing;
            const auto [first, second] = active_particles_[k];
            const Vec3 force = force_of(contact);
            push_alone(first, force, pushed);
            if (second != ContactCandidate::kGround) {
                push_alone(second, -force, pushed);
            }
        }
    }
    return pushing;
}

}  // namespace haptic::sim
