#include "collision/surface_contacts.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "collision/colliders.hpp"
#include "dynamics/rows.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Of the mean edge.
constexpr double kThickness = 0.1;
constexpr double kThinnest = 1e-6;  // m
// Of the thickness: the gap that is guaranteed, far above rounding and far below what is seen or felt.
constexpr double kLeastGap = 1.0 / 256.0;
// How far rounds may move a vertex before all near pairs are checked again: this part of the thickness, and its way.
constexpr double kRoundSlack = 0.5;
// Rounds over unsafe pairs: these are pushed apart, then zones lose parts of their inner motion, then all of it; after
// the last everything moves alike.
constexpr int kPushRounds = 3;
constexpr int kPartRounds = 2;
constexpr int kMaxRounds = 20;
// What is unsafe is pushed to this part of its distance at the start.
constexpr double kPushedGap = 0.5;
// The part that is used of a safe way to the ground.
constexpr double kPartToGround = 0.9;
// s, in which layers that are too near come apart.
constexpr double kPushOutTime = 0.1;
// Room for contacts, per vertex and at most.
constexpr std::size_t kContactsPerVertex = 128;
constexpr std::size_t kMaxContacts = 1U << 19;
// Pairs whose nearest points are found at once.
constexpr std::size_t kContactsTogether = 256;
// Of the thickness: the largest error of a contact.
constexpr double kExact = 0.01;

/// m, at rest.
double mean_edge(std::span<const ParticleSurface> surfaces) {
    double sum = 0.0;
    std::size_t count = 0;
    for (const ParticleSurface& surface : surfaces) {
        for (const Triangle& t : surface.triangles) {
            for (std::size_t k = 0; k < 3; ++k) {
                sum += glm::length(surface.rest[t[k]] - surface.rest[t[(k + 1) % 3]]);
                ++count;
            }
        }
    }
    return count == 0 ? 1.0 : sum / static_cast<double>(count);
}

/// m: as set, or a part of the mean edge.
double checked_thickness(double thickness, std::span<const ParticleSurface> surfaces) {
    const double edge = mean_edge(surfaces);
    if (!(thickness == 0.0 || (thickness >= kThinnest && thickness <= edge))) {
        throw std::invalid_argument("collisions: thickness must be 0, or 1e-6 m to the mean edge of the sheets, " +
                                    std::to_string(edge) + " m");
    }
    return thickness > 0.0 ? thickness : kThickness * edge;
}

}  // namespace

SurfaceContacts::SurfaceContacts(const ParticleModel& model, std::span<const ParticleSurface> surfaces,
                                 const CollisionSettings& settings, StageClock::Function clock, std::size_t lanes)
    : features_(surfaces, collider_kernels(lanes)),
      thickness_(checked_thickness(settings.thickness, surfaces)),
      least_gap_(kLeastGap * thickness_),
      settings_(settings),
      pairs_(features_, model.size(), surfaces,
             {.thickness = thickness_, .least_gap = least_gap_, .between_bodies = settings.between_bodies}, lanes),
      kernels_(*find_kernels(&Kernels::features, lanes)),
      clock_(clock),
      masses_(model),
      forces_(model, surfaces, masses_, {settings.static_friction, settings.dynamic_friction}, kExact * thickness_,
              std::min(kMaxContacts, kContactsPerVertex * vertices().size())),
      asked_(model.size()),
      wish_(model.size()),
      zones_(vertices(), pairs_.surface_of(), masses_),
      checked_at_(model.size()),
      all_checked_at_(model.size()),
      round_reach_(model.size()),
      is_open_(model.size()) {
    // Room for what usual states need; more allocates.
    for (std::size_t list = 0; list < loose_.size(); ++list) {
        loose_[list].reserve(pairs_.room());
        open_[list].reserve(pairs_.room());
    }
    candidates_.reserve(SurfaceFeatures::kMaxTogether);
    unsafe_.reserve(pairs_.room());
    moved_.reserve(vertices().size());
}

SurfaceContactCounts SurfaceContacts::counts() const noexcept {
    SurfaceContactCounts counts = counts_;
    counts.searches = pairs_.counts().searches;
    counts.pairs = pairs_.counts().pairs;
    return counts;
}

void SurfaceContacts::begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) {
    const StageClock::Span timed(clock_);
    asleep_ = start.asleep[pairs_.vertices().front()] != 0;
    if (asleep_) {
        return;
    }
    h_ = h;
    contacts_known_ = false;
    const bool goes_on = pairs_.begin(start);
    forces_.begin(elastic, h, goes_on, now.position, [&](const SurfaceContact& last) { return renewed(last, start); });
}

/// A contact of the last sub-step as it is at the start of this one; nothing if it has ended.
std::optional<SurfaceContact> SurfaceContacts::renewed(const SurfaceContact& last, const ParticleModel& start) const {
    if (last.is_with_ground()) {
        return on_ground(last.vertex[0], start);
    }
    const NearestPoints nearest = nearest_points(last.kind, positions_of(last.vertex, pairs_.start().data()));
    return between(last.kind, last.vertex, nearest.weight, nearest.normal(), nearest.distance);
}

/// Of features that are nearest at these points; nothing where they touch, or where the ends of edges are nearest:
/// these are vertices, which have contacts of their own.
std::optional<SurfaceContact> SurfaceContacts::between(PairKind kind, const PairVertices& vertex,
                                                       const std::array<double, 4>& weight, const Vec3& normal,
                                                       double distance) const {
    if (!(distance > 0.0) || (kind == PairKind::EdgeEdge && std::ranges::find(weight, 0.0) != weight.end())) {
        return std::nullopt;
    }
    return SurfaceContact{.kind = kind,
                          .vertex = vertex,
                          .weight = weight,
                          .normal = normal,
                          .min_separation = distance + push_out(pairs_.thickness_of(vertex) - distance)};
}

/// Of the ground, on which the vertex rests as its particle's ellipsoid does. One that starts lower rises slowly.
SurfaceContact SurfaceContacts::on_ground(std::uint32_t vertex, const ParticleModel& start) const {
    const Mat3 axes = glm::mat3_cast(start.orientation[vertex] * start.axes[vertex]);
    const Vec3 down(axes[0].y, axes[1].y, axes[2].y);
    const double resting = settings_.ground_height + glm::length(down * start.semi_axes[vertex]);
    const double from = pairs_.start()[vertex].number[1];
    return SurfaceContact::with_ground(vertex, from + push_out(resting - from));
}

void SurfaceContacts::find_contacts(const ParticleModel& start, const Row* position) {
    contacts_known_ = true;
    if (!pairs_.know(position)) {
        return;
    }
    for (FeaturePairs& pairs : pairs_.near()) {
        kernels_.find_gaps(pairs.kind, pairs.rows(pairs.end_gap), pairs.size(), position);
        candidates_.clear();
        for (std::size_t k = 0; k < pairs.size(); ++k) {
            if (pairs.end_gap[k] < thickness_) {
                candidates_.append(pairs, k);
                if (candidates_.size() == kContactsTogether) {
                    add_contacts(pairs);
                }
            }
        }
        add_contacts(pairs);
    }
    // Vertices that rest on the ground, or may come to.
    const auto may_touch = [&](std::uint32_t v) {
        const Vec3& axes = start.semi_axes[v];
        return position[v].number[1] < settings_.ground_height + std::max({axes.x, axes.y, axes.z}) + thickness_ &&
               !forces_.pushes_on(SurfaceContact::kGroundKind, {v, v, v, v});
    };
    for (const std::uint32_t v : pairs_.vertices()) {
        if (settings_.ground && may_touch(v)) {
            forces_.add(on_ground(v, start));
        }
    }
    counts_.contacts += forces_.size();
}

/// Adds contacts of the candidates from `pairs`, at the points that are nearest at the start. Leaves no candidates.
void SurfaceContacts::add_contacts(FeaturePairs& pairs) {
    FeaturePairs& some = candidates_;
    std::array<double, kContactsTogether> distance;  // NOLINT(cppcoreguidelines-pro-type-member-init): the kernel's
    std::array<std::array<double, kContactsTogether>, 4> weight;  // NOLINT(cppcoreguidelines-pro-type-member-init)
    kernels_.find_nearest(pairs.kind, some.rows(some.gap), some.size(), pairs_.start().data(),
                          {{weight[0].data(), weight[1].data(), weight[2].data(), weight[3].data()}, distance.data()});
    for (std::size_t c = 0; c < some.size(); ++c) {
        const Vec3 normal = some.normal_of(c);
        if (distance[c] > 0.0) {
            pairs.set_normal(some.origin[c], normal);
            pairs.gap[some.origin[c]] = some.gap[c];
        }
        const std::array<double, 4> w{weight[0][c], weight[1][c], weight[2][c], weight[3][c]};
        if (const auto contact = between(pairs.kind, some.vertices(c), w, normal, distance[c])) {
            if (!forces_.pushes_on(pairs.kind, contact->vertex)) {
                forces_.add(*contact);
            }
        }
    }
    some.clear();
}

/// m: what a contact lacks of the thickness returns slowly, or piles of layers would spring apart.
double SurfaceContacts::push_out(double missing) const noexcept {
    return std::min(missing, h_ * std::min(settings_.push_out_speed, missing / kPushOutTime));
}

void SurfaceContacts::project(const ParticleModel& start, const MovingParticles& now, double /*h*/) {
    if (asleep_) {
        return;
    }
    const StageClock::Span timed(clock_);
    if (!contacts_known_) {
        find_contacts(start, now.position);
    }
    forces_.solve(pairs_.start().data(), now.position);
}

void SurfaceContacts::finish(const ParticleModel& start, const MovingParticles& now, double h) {
    if (asleep_) {
        return;
    }
    if (!contacts_known_) {
        project(start, now, h);
    }
    // Pushes within a surface change none of its momenta: what friction turns it by, because it acts at two points, is
    // an error. It returns with the rest that is lost.
    const StageClock::Span timed(clock_);
    forces_.add_pushes(now.pushed, [&](const SurfaceContact& contact) {
        return contact.is_with_ground() || !pairs_.are_of_one_surface(contact.vertex);
    });
}

/// Lists the pair unless it is proved apart all the way.
void SurfaceContacts::prove(std::uint32_t list, std::uint32_t at, const Row* position) {
    FeaturePairs& pairs = pairs_.near()[list];
    const NearestPoints first = nearest_points(pairs.kind, pairs.positions(at, pairs_.start().data()));
    const double part = pairs.safe_part(at, first, pairs_.start().data(), position, least_gap_);
    pairs.end_gap[at] = pairs.gap_along(at, position);
    if (part < 1.0) {
        unsafe_.push_back({list, at, part});
    }
}

/// Lists the open pairs that are not proved apart all the way, and what sinks into the ground. Whether there are any.
bool SurfaceContacts::find_unsafe(const Row* position) {
    unsafe_.clear();
    for (std::uint32_t list = 0; list < pairs_.near().size(); ++list) {
        FeaturePairs& pairs = pairs_.near()[list];
        const auto check = [&](std::uint32_t k) {
            // Most are apart at both ends along their normals. A zone that moves a pair brings it no nearer.
            if (!(pairs.gap[k] > 0.0 && pairs.end_gap[k] >= least_gap_) && !zones_.are_rigid(pairs.vertices(k))) {
                prove(list, k, position);
            }
        };
        if (all_are_open_) {
            kernels_.find_gaps(pairs.kind, pairs.rows(pairs.end_gap), pairs.size(), position);
            for (std::uint32_t k = 0; k < pairs.size(); ++k) {
                check(k);
            }
        } else {
            for (const std::uint32_t k : open_[list]) {
                pairs.end_gap[k] = pairs.gap_along(k, position);
                check(k);
            }
        }
    }
    if (settings_.ground) {
        find_sinking(position);
    }
    if (unsafe_.empty()) {
        return false;
    }
    for (const std::uint32_t v : vertices()) {
        checked_at_[v] = position[v];
    }
    if (all_are_open_) {
        choose_loose(position);
    }
    return true;
}

/// Chooses, after all pairs have been checked, those that rounds may bring too near.
void SurfaceContacts::choose_loose(const Row* position) {
    VertexReaches reaches{round_reach_, 0.0};
    for (const std::uint32_t v : vertices()) {
        all_checked_at_[v] = position[v];
        round_reach_[v] = kRoundSlack * thickness_ + glm::length(vector_of(position[v]) - vector_of(pairs_.start()[v]));
        reaches.most = std::max(reaches.most, round_reach_[v]);
    }
    for (std::size_t list = 0; list < pairs_.near().size(); ++list) {
        const FeaturePairs& pairs = pairs_.near()[list];
        loose_[list].clear();
        for (std::uint32_t k = 0; k < pairs.size(); ++k) {
            if (!(pairs.gap[k] > 0.0) ||
                reaches.may_close(pairs.end_gap[k], least_gap_, pairs.kind, pairs.vertices(k))) {
                loose_[list].push_back(k);
            }
        }
    }
}

/// After a round, opens the pairs whose proof may no longer hold: those with a vertex that it moved, and those that
/// were unsafe. Not those that move with one zone from now on. All of them if a vertex has come too far.
void SurfaceContacts::open_moved(const Row* position) {
    all_are_open_ = false;
    for (const std::uint32_t v : vertices()) {
        const Vec3 moved = vector_of(position[v]) - vector_of(all_checked_at_[v]);
        all_are_open_ |= !(glm::dot(moved, moved) <= round_reach_[v] * round_reach_[v]);
        is_open_[v] = vector_of(position[v]) != vector_of(checked_at_[v]) ? 1 : 0;
    }
    for (const Unsafe& u : unsafe_) {
        for (std::size_t k = 0; k < 4 && u.list != kGround; ++k) {
            is_open_[pairs_.near()[u.list].vertex[k][u.pair]] = 1;
        }
    }
    for (std::size_t list = 0; list < pairs_.near().size() && !all_are_open_; ++list) {
        const auto& vertex = pairs_.near()[list].vertex;
        std::vector<std::uint32_t>& loose = loose_[list];
        std::erase_if(loose, [&](std::uint32_t k) { return zones_.are_rigid(pairs_.near()[list].vertices(k)); });
        open_[list].clear();
        for (const std::uint32_t k : loose) {
            if ((is_open_[vertex[0][k]] | is_open_[vertex[1][k]] | is_open_[vertex[2][k]] | is_open_[vertex[3][k]]) !=
                0) {
                open_[list].push_back(k);
            }
        }
    }
}

/// Lists the vertices that come below the ground, or deeper below it.
void SurfaceContacts::find_sinking(const Row* position) {
    for (const std::uint32_t v : vertices()) {
        const double from = pairs_.start()[v].number[1];
        const double to = position[v].number[1];
        if (to < settings_.ground_height && to < from && masses_.inverse(v) > 0.0) {
            unsafe_.push_back(
                {kGround, v, std::max(0.0, kPartToGround * (from - settings_.ground_height) / (from - to))});
        }
    }
}

void SurfaceContacts::push_from_ground(std::uint32_t vertex, const MovingParticles& now) noexcept {
    const double height = std::min(pairs_.start()[vertex].number[1], settings_.ground_height);
    const Vec3 rise(0.0, height - now.position[vertex].number[1], 0.0);
    add_vector(now.position[vertex], rise);
    add_vector(now.pushed[vertex], rise);
}

/// Pushes unsafe pairs apart at the ends of their ways, with equal and opposite forces between points at which they
/// were, and are, nearest.
void SurfaceContacts::push_unsafe(const MovingParticles& now) noexcept {
    Row* const position = now.position;
    for (const Unsafe& u : unsafe_) {
        if (u.list == kGround) {
            push_from_ground(u.pair, now);
            continue;
        }
        const FeaturePairs& pairs = pairs_.near()[u.list];
        const PairVertices vertex = pairs.vertices(u.pair);
        const NearestPoints first = nearest_points(pairs.kind, pairs.positions(u.pair, pairs_.start().data()));
        const double keep = std::max(2.0 * least_gap_, kPushedGap * std::min(first.distance, thickness_));
        const auto push = [&](const NearestPoints& nearest) {
            const Vec3 normal = nearest.normal();
            if (!(glm::dot(normal, first.normal()) > 0.0)) {
                return;
            }
            const double inverse_mass = masses_.inverse(vertex, nearest.weight);
            const double clearance = glm::dot(normal, weighted(nearest.weight, vertex, position)) - keep;
            if (clearance < 0.0 && inverse_mass > 0.0) {
                const Vec3 impulse = -clearance / inverse_mass * normal;
                masses_.displace(vertex, nearest.weight, impulse, position);
                if (!pairs_.are_of_one_surface(vertex)) {
                    masses_.displace(vertex, nearest.weight, impulse, now.pushed);
                }
            }
        };
        push(first);
        push(nearest_points(pairs.kind, pairs.positions(u.pair, position)));
    }
    for (const std::uint32_t v : vertices()) {
        wish_[v] = position[v];
    }
}

/// Makes zones of the vertices of unsafe pairs, which keep the safe part of their motion within the zone.
void SurfaceContacts::unite_unsafe(bool at_once) noexcept {
    for (const Unsafe& u : unsafe_) {
        const double part = at_once ? 0.0 : u.part;
        if (u.list == kGround) {
            zones_.ground(u.pair, part);
        } else {
            zones_.unite(pairs_.near()[u.list].vertices(u.pair), part);
        }
    }
}

/// Everything moves alike, or stands still on the ground: every pair keeps its gap.
void SurfaceContacts::unite_all(const MovingParticles& now) noexcept {
    ++counts_.united;
    zones_.unite_all(settings_.ground);
    zones_.move(pairs_.start().data(), wish_.data(), false, now.position);
    for (FeaturePairs& pairs : pairs_.near()) {
        pairs.end_gap = pairs.gap;
    }
    all_are_open_ = true;
    pairs_.forget();  // it may have led out of the boxes
}

/// Before anything is moved: where the sub-step would lead.
void SurfaceContacts::begin_rounds(const MovingParticles& now) noexcept {
    for (const std::uint32_t v : vertices()) {
        asked_[v] = wish_[v] = now.position[v];
    }
}

/// Lists what was moved, with its displacements by what does not belong to its body. Leaves no zones.
void SurfaceContacts::end_rounds(const MovingParticles& now) {
    const Row* const position = now.position;
    for (const std::uint32_t v : vertices()) {
        if (vector_of(position[v]) == vector_of(asked_[v])) {
            now.pushed[v] = Row{};
            continue;
        }
        moved_.push_back(v);
        if (zones_.contain(v)) {
            ++counts_.held;
            if (zones_.are_mixed(v)) {
                add_vector(now.pushed[v], vector_of(position[v]) - vector_of(wish_[v]));
            }
        }
    }
    zones_.clear();
}

std::span<const std::uint32_t> SurfaceContacts::secure(const ParticleModel& /*start*/, const MovingParticles& now,
                                                       double /*h*/) {
    const StageClock::Span timed(clock_);
    Row* const position = now.position;
    moved_.clear();
    if (asleep_ || !pairs_.know(position)) {
        return moved_;
    }
    all_are_open_ = true;
    int round = 0;
    for (; find_unsafe(position); ++round) {
        if (round == 0) {
            counts_.unsafe += unsafe_.size();
            begin_rounds(now);
        }
        ++counts_.rounds;
        if (round == kMaxRounds) {
            unite_all(now);
            break;
        }
        if (round < kPushRounds) {
            push_unsafe(now);
        } else {
            unite_unsafe(round >= kPushRounds + kPartRounds);
            zones_.move(pairs_.start().data(), wish_.data(), true, position);
        }
        zones_.find_rigid();
        if (pairs_.know_again(position)) {
            all_are_open_ = true;
        } else {
            open_moved(position);
        }
    }
    for (FeaturePairs& pairs : pairs_.near()) {
        if (!all_are_open_) {
            kernels_.find_gaps(pairs.kind, pairs.rows(pairs.end_gap), pairs.size(), position);
        }
    }
    if (round > 0) {
        end_rounds(now);
    }
    pairs_.end(position);
    return moved_;
}

}  // namespace haptic::sim
