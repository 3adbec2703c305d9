#include "collision/surface_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
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
// Of the thickness: how far a vertex may leave the path expected of it before pairs are searched again.
constexpr double kSlack = 1.5;
// Most sub-steps for which a search looks ahead.
constexpr int kMostAhead = 6;
// Vertices by which the mean motion is estimated, roughly.
constexpr std::size_t kSample = 512;
// How far a vertex may move before the near pairs are chosen again: this part of the thickness, or so many of its ways
// in a sub-step.
constexpr double kNearSlack = 1.0;
constexpr double kNearAhead = 3.0;
// How far rounds may move a vertex before all near pairs are checked again: this part of the thickness, and its way.
constexpr double kRoundSlack = 0.5;
// Above the rounding of gaps.
constexpr double kRounding = 1e-6;
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
// Room per vertex, for pairs of each kind and for contacts, and at most.
constexpr std::size_t kPairsPerVertex = 256;
constexpr std::size_t kContactsPerVertex = 128;
constexpr std::size_t kMaxRoom = 1U << 19;
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

/// Per particle; 0 of those that are of none.
std::vector<std::uint32_t> surface_of_particles(std::size_t particles, std::span<const ParticleSurface> surfaces) {
    std::vector<std::uint32_t> surface_of(particles, 0);
    for (std::uint32_t s = 0; s < surfaces.size(); ++s) {
        std::fill_n(surface_of.begin() + surfaces[s].first_particle, surfaces[s].rest.size(), s);
    }
    return surface_of;
}

/// m, the most that two points of the features can come nearer if each vertex comes so far.
double reach_of(PairKind kind, const std::array<std::uint32_t, 4>& vertex, const std::vector<double>& reach) noexcept {
    const double first = reach[vertex[0]];
    const double second = reach[vertex[1]];
    const double last = std::max(reach[vertex[2]], reach[vertex[3]]);
    return kind == PairKind::VertexTriangle ? first + std::max(second, last) : std::max(first, second) + last;
}

/// m, how far the vertices of a surface may come, and the most of them.
struct Reaches {
    const std::vector<double>& of;
    double most;
    /// Whether features that are a gap apart may come within a distance.
    [[nodiscard]] bool may_close(double gap, double distance, PairKind kind,
                                 const std::array<std::uint32_t, 4>& vertex) const noexcept {
        const double spare = gap - (1.0 + kRounding) * distance;
        return !(spare >= 2.0 * most) && !(spare >= (1.0 + kRounding) * reach_of(kind, vertex, of));
    }
};

}  // namespace

SurfaceContacts::SurfaceContacts(const ParticleModel& model, std::span<const ParticleSurface> surfaces,
                                 const CollisionSettings& settings, StageClock::Function clock, std::size_t lanes)
    : features_(surfaces, collider_kernels(lanes)),
      kernels_(*find_kernels(&Kernels::features, lanes)),
      thickness_(checked_thickness(settings.thickness, surfaces)),
      least_gap_(kLeastGap * thickness_),
      settings_(settings),
      clock_(clock),
      masses_(model),
      forces_(model, surfaces, masses_, {settings.static_friction, settings.dynamic_friction}, kExact * thickness_,
              std::min(kMaxRoom, kContactsPerVertex * features_.vertices().size())),
      surface_of_(surface_of_particles(model.size(), surfaces)),
      path_(model.size()),
      path_end_(model.size()),
      reach_(model.size()),
      chosen_at_(model.size()),
      near_reach_(model.size()),
      start_(model.size()),
      asked_(model.size()),
      wish_(model.size()),
      zones_(features_.vertices(), surface_of_, masses_),
      ended_(model.size(), Row{}),
      checked_at_(model.size()),
      all_checked_at_(model.size()),
      round_reach_(model.size()),
      is_open_(model.size()) {
    // Room for what usual states need; more allocates.
    by_number_.assign(features_.vertices().begin(), features_.vertices().end());
    std::ranges::sort(by_number_);
    const std::size_t vertices = by_number_.size();
    const std::size_t room = std::min(kMaxRoom, kPairsPerVertex * vertices);
    for (std::size_t list = 0; list < pairs_.size(); ++list) {
        found_[list].reserve(room);
        pairs_[list].reserve(room);
        loose_[list].reserve(room);
        open_[list].reserve(room);
    }
    candidates_.reserve(SurfaceFeatures::kMaxTogether);
    in_doubt_.reserve(SurfaceFeatures::kMaxTogether);
    unsafe_.reserve(room);
    moved_.reserve(vertices);
    left_alone_.resize(model.size());
    room_.resize(model.size(), thickness_);
    for (const ParticleSurface& surface : surfaces) {
        std::ranges::copy(surface.left_alone, left_alone_.begin() + surface.first_particle);
        for (std::size_t v = 0; v < surface.rest.size(); ++v) {
            start_[surface.first_particle + v] = row_of(surface.rest[v]);
        }
    }
    find_room();
}

/// Features of a surface that are nearer at rest than the thickness keep that distance; those that touch are left
/// alone, because nothing tells their sides apart.
void SurfaceContacts::find_room() {
    for (const std::uint32_t v : features_.vertices()) {
        const Vec3 x = vector_of(start_[v]);
        path_[v] = {.start = x, .margin = Vec3(0.5 * thickness_)};
    }
    features_.search(path_, [&](PairKind kind, const auto& vertex) {
        for (std::size_t k = 0; k < vertex[0].size(); ++k) {
            const PairVertices pair{vertex[0][k], vertex[1][k], vertex[2][k], vertex[3][k]};
            if (!are_of_one_surface(pair)) {
                continue;
            }
            const double distance = nearest_points(kind, positions_of(pair, start_.data())).distance;
            for (const std::uint32_t v : pair) {
                room_[v] = std::min(room_[v], distance);
                left_alone_[v] |= distance < least_gap_ ? 1U : 0U;
            }
        }
    });
}

double SurfaceContacts::thickness_of(const PairVertices& vertex) const noexcept {
    return std::min({room_[vertex[0]], room_[vertex[1]], room_[vertex[2]], room_[vertex[3]]});
}

bool SurfaceContacts::are_of_one_surface(const PairVertices& vertex) const noexcept {
    return surface_of_[vertex[0]] == surface_of_[vertex[3]];
}

bool SurfaceContacts::are_left_alone(const PairVertices& vertex) const noexcept {
    return std::ranges::all_of(vertex, [&](std::uint32_t v) { return left_alone_[v] != 0; });
}

void SurfaceContacts::begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) {
    const StageClock::Span timed(clock_);
    asleep_ = start.asleep[by_number_[0]] != 0;
    if (asleep_) {
        return;
    }
    h_ = h;
    contacts_known_ = false;
    // What was proved at the end of the last sub-step holds at the start of this one, unless someone moved a vertex.
    bool moved = !searched_;
    for (const std::uint32_t v : by_number_) {
        moved |= vector_of(ended_[v]) != start.position[v];
    }
    goes_on_ = !moved;
    if (goes_on_) {
        std::swap(start_, ended_);
    } else {
        searched_ = false;
        for (const std::uint32_t v : by_number_) {
            start_[v] = row_of(start.position[v]);
        }
    }
    forces_.begin(elastic, h, goes_on_, now.position, [&](const SurfaceContact& last) { return renewed(last, start); });
}

/// Whether the state has diverged: rounding exceeds the least gap, and nothing tells sides apart. All pairs would be
/// near, and take minutes.
bool SurfaceContacts::are_lost(const Row* position) const noexcept {
    const Vec3 farthest(least_gap_ / std::numeric_limits<double>::epsilon());
    bool within = true;
    for (const std::uint32_t v : features_.vertices()) {
        within &= glm::all(glm::lessThan(glm::abs(vector_of(position[v])), farthest));
    }
    return !within;
}

/// m, the mean of a vector that each vertex has, estimated by some of them.
template <class Of>
Vec3 SurfaceContacts::mean_of(const Of& of) const noexcept {
    const std::span<const std::uint32_t> vertices = by_number_;
    const std::size_t stride = std::max<std::size_t>(1, vertices.size() / kSample);
    Vec3 sum(0.0);
    double count = 0.0;
    for (std::size_t k = 0; k < vertices.size(); k += stride) {
        sum += of(vertices[k]);
        count += 1.0;
    }
    return sum / std::max(1.0, count);
}

/// Whether a vertex is off its path by more than its slack, at the end of the sub-step.
bool SurfaceContacts::have_left_paths(const Row* position) const noexcept {
    const double part = static_cast<double>(std::min(elapsed_ + 1, ahead_)) / std::max(1, ahead_);
    const auto deviation = [&](std::uint32_t v) {
        return vector_of(position[v]) - path_[v].start - part * path_[v].way;
    };
    // What moves all vertices alike brings none nearer to another: gravity, of a sheet that falls.
    const Vec3 common = mean_of(deviation);
    // Half a thickness of each margin is not for its vertex: features whose boxes part are a thickness apart.
    const Vec3 not_its_own(0.5 * thickness_);
    bool left = false;
    for (const std::uint32_t v : by_number_) {
        const Vec3 off = deviation(v) - common;
        left |= !(ahead_ > 0 ? glm::dot(off, off) <= reach_[v] * reach_[v]
                             : glm::all(glm::lessThanEqual(glm::abs(off), path_[v].margin - not_its_own)));
    }
    return left;
}

/// Whether pairs that are not near may be nearer than the thickness by now.
bool SurfaceContacts::have_come_near(const Row* position) const noexcept {
    if (all_are_near_) {
        return false;
    }
    const auto moved_by = [&](std::uint32_t v) { return vector_of(position[v]) - vector_of(chosen_at_[v]); };
    const Vec3 common = mean_of(moved_by);
    bool near = false;
    for (const std::uint32_t v : by_number_) {
        const Vec3 moved = moved_by(v) - common;
        near |= !(glm::dot(moved, moved) <= near_reach_[v] * near_reach_[v]);
    }
    return near;
}

/// Finds the pairs again if a vertex has left its path, and chooses the near ones if one has come too far. Returns
/// false, and knows none, if the state has diverged.
bool SurfaceContacts::know_pairs(const Row* position) {
    if (!searched_ || have_left_paths(position)) {
        searched_ = !are_lost(position);
        if (!searched_) {
            return false;
        }
        find_pairs(position, steady_substeps(position));
    } else if (have_come_near(position)) {
        choose_again(position);
    }
    return true;
}

/// For how many sub-steps straight paths will do, if velocities go on changing as since the last sub-step; 0 if for
/// less than two.
int SurfaceContacts::steady_substeps(const Row* position) const noexcept {
    if (!goes_on_) {
        return 0;
    }
    const auto change = [&](std::uint32_t v) {
        return (vector_of(position[v]) - vector_of(start_[v])) - (vector_of(start_[v]) - vector_of(ended_[v]));
    };
    const Vec3 common = mean_of(change);
    double most = 0.0;
    for (const std::uint32_t v : by_number_) {
        const Vec3 off = change(v) - common;
        most = std::max(most, glm::dot(off, off));
    }
    // With a constant change d of the way, a vertex is off by k (k - 1) / 2 d after k sub-steps.
    const double slack = kSlack * thickness_;
    int ahead = 1;
    while (ahead < kMostAhead && 0.5 * ahead * (ahead + 1) * std::sqrt(most) <= slack) {
        ++ahead;
    }
    return ahead >= 2 ? ahead : 0;
}

/// Finds the pairs that may come within the thickness while vertices go on as from `start_` to `position` for `ahead`
/// sub-steps, and then stay. For 0: wherever they are from `start_` to twice as far as `position`.
void SurfaceContacts::find_pairs(const Row* position, int ahead) {
    ++counts_.searches;
    searched_ = true;
    ahead_ = ahead;
    elapsed_ = 0;
    most_reach_ = 0.0;
    const auto way_of = [&](std::uint32_t v) { return vector_of(position[v]) - vector_of(start_[v]); };
    const Vec3 common = mean_of(way_of);
    const double slack = kSlack * thickness_;
    const Vec3 margin(slack + 0.5 * thickness_);
    for (const std::uint32_t v : by_number_) {
        const Vec3 from = vector_of(start_[v]);
        if (ahead > 0) {
            const Vec3 way = static_cast<double>(ahead) * way_of(v);
            path_[v] = {from, way, margin};
            path_end_[v] = row_of(from + way);
            reach_[v] = slack;
        } else {
            const Vec3 way = way_of(v) - common;
            path_[v] = {from + way, Vec3(0.0), margin + glm::abs(way)};
            path_end_[v] = start_[v];
            reach_[v] = std::sqrt(3.0) * slack + 2.0 * glm::length(way);
        }
        most_reach_ = std::max(most_reach_, reach_[v]);
    }
    for (FeaturePairs& found : found_) {
        found.clear();
    }
    features_.search(path_, [&](PairKind kind, const auto& vertex) { keep_near(kind, vertex); });
    for (const FeaturePairs& found : found_) {
        counts_.pairs += found.size();
    }
    choose_near(position);
}

/// Chooses near pairs again, some sub-steps after the search.
void SurfaceContacts::choose_again(const Row* position) {
    for (std::size_t list = 0; list < pairs_.size(); ++list) {
        FeaturePairs& found = found_[list];
        const FeaturePairs& near = pairs_[list];
        // Better normals stay.
        for (std::size_t k = 0; k < near.size(); ++k) {
            found.set_normal(near.origin[k], near.normal_of(k));
        }
        kernels_.find_gaps(found.kind, found.rows(found.gap), found.size(), start_.data());
    }
    choose_near(position);
}

/// Chooses those of the pairs that may come within the thickness while no vertex moves farther than now, to `position`;
/// all of them where they are few.
void SurfaceContacts::choose_near(const Row* position) {
    all_are_open_ = true;
    all_are_near_ = found_[0].size() + found_[1].size() <= features_.vertices().size();
    Reaches reaches{near_reach_, 0.0};
    if (!all_are_near_) {
        const auto way_of = [&](std::uint32_t v) { return vector_of(position[v]) - vector_of(start_[v]); };
        const Vec3 common = mean_of(way_of);
        for (const std::uint32_t v : by_number_) {
            chosen_at_[v] = start_[v];
            near_reach_[v] = std::max(kNearSlack * thickness_, kNearAhead * glm::length(way_of(v) - common));
            reaches.most = std::max(reaches.most, near_reach_[v]);
        }
    }
    for (std::size_t list = 0; list < pairs_.size(); ++list) {
        const FeaturePairs& found = found_[list];
        FeaturePairs& near = pairs_[list];
        near.clear();
        for (std::size_t k = 0; k < found.size(); ++k) {
            if (all_are_near_ || reaches.may_close(found.gap[k], thickness_, found.kind, found.vertices(k))) {
                near.append(found, k);
            }
        }
        near.end_gap.resize(near.size());
    }
}

/// Keeps those of the pairs that are not proved to stay a thickness apart while their vertices keep to their paths.
void SurfaceContacts::keep_near(PairKind kind, const PairCandidates::Vertices& vertex) {
    const Reaches reaches{reach_, most_reach_};
    const auto may_close = [&](const FeaturePairs& pairs, std::size_t k) {
        return reaches.may_close(std::min(pairs.gap[k], pairs.end_gap[k]), thickness_, kind, pairs.vertices(k));
    };
    in_doubt_.find(kernels_, kind, vertex, start_.data(), path_end_.data(), may_close);
    const FeaturePairs& some = in_doubt_.some;
    const FeaturePairs& doubtful = in_doubt_.pairs;
    FeaturePairs& found = found_[kind == PairKind::VertexTriangle ? 0 : 1];
    for (std::size_t k = 0; k < doubtful.size(); ++k) {
        const PairVertices pair = doubtful.vertices(k);
        if (!may_close(doubtful, k) || are_left_alone(pair) ||
            !(settings_.between_bodies || are_of_one_surface(pair))) {
            continue;
        }
        const std::uint32_t quick = doubtful.origin[k];
        if (some.gap[quick] > least_gap_) {
            found.append(some, quick);
        } else {
            found.append(doubtful, k);
        }
    }
}

/// A contact of the last sub-step as it is at the start of this one; nothing if it has ended.
std::optional<SurfaceContact> SurfaceContacts::renewed(const SurfaceContact& last, const ParticleModel& start) const {
    if (last.is_with_ground()) {
        return on_ground(last.vertex[0], start);
    }
    const NearestPoints nearest = nearest_points(last.kind, positions_of(last.vertex, start_.data()));
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
                          .min_separation = distance + push_out(thickness_of(vertex) - distance)};
}

/// Of the ground, on which the vertex rests as its particle's ellipsoid does. One that starts lower rises slowly.
SurfaceContact SurfaceContacts::on_ground(std::uint32_t vertex, const ParticleModel& start) const {
    const Mat3 axes = glm::mat3_cast(start.orientation[vertex] * start.axes[vertex]);
    const Vec3 down(axes[0].y, axes[1].y, axes[2].y);
    const double resting = settings_.ground_height + glm::length(down * start.semi_axes[vertex]);
    const double from = start_[vertex].number[1];
    return SurfaceContact::with_ground(vertex, from + push_out(resting - from));
}

void SurfaceContacts::find_contacts(const ParticleModel& start, const Row* position) {
    contacts_known_ = true;
    if (!know_pairs(position)) {
        return;
    }
    for (FeaturePairs& pairs : pairs_) {
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
    for (const std::uint32_t v : by_number_) {
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
    kernels_.find_nearest(pairs.kind, some.rows(some.gap), some.size(), start_.data(),
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
    forces_.solve(start_.data(), now.position);
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
        return contact.is_with_ground() || !are_of_one_surface(contact.vertex);
    });
}

/// Lists the pair unless it is proved apart all the way.
void SurfaceContacts::prove(std::uint32_t list, std::uint32_t at, const Row* position) {
    FeaturePairs& pairs = pairs_[list];
    const NearestPoints first = nearest_points(pairs.kind, pairs.positions(at, start_.data()));
    const double part = pairs.safe_part(at, first, start_.data(), position, least_gap_);
    pairs.end_gap[at] = pairs.gap_along(at, position);
    if (part < 1.0) {
        unsafe_.push_back({list, at, part});
    }
}

/// Lists the open pairs that are not proved apart all the way, and what sinks into the ground. Whether there are any.
bool SurfaceContacts::find_unsafe(const Row* position) {
    unsafe_.clear();
    for (std::uint32_t list = 0; list < pairs_.size(); ++list) {
        FeaturePairs& pairs = pairs_[list];
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
    for (const std::uint32_t v : features_.vertices()) {
        checked_at_[v] = position[v];
    }
    if (all_are_open_) {
        choose_loose(position);
    }
    return true;
}

/// Chooses, after all pairs have been checked, those that rounds may bring too near.
void SurfaceContacts::choose_loose(const Row* position) {
    Reaches reaches{round_reach_, 0.0};
    for (const std::uint32_t v : features_.vertices()) {
        all_checked_at_[v] = position[v];
        round_reach_[v] = kRoundSlack * thickness_ + glm::length(vector_of(position[v]) - vector_of(start_[v]));
        reaches.most = std::max(reaches.most, round_reach_[v]);
    }
    for (std::size_t list = 0; list < pairs_.size(); ++list) {
        const FeaturePairs& pairs = pairs_[list];
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
    for (const std::uint32_t v : features_.vertices()) {
        const Vec3 moved = vector_of(position[v]) - vector_of(all_checked_at_[v]);
        all_are_open_ |= !(glm::dot(moved, moved) <= round_reach_[v] * round_reach_[v]);
        is_open_[v] = vector_of(position[v]) != vector_of(checked_at_[v]) ? 1 : 0;
    }
    for (const Unsafe& u : unsafe_) {
        for (std::size_t k = 0; k < 4 && u.list != kGround; ++k) {
            is_open_[pairs_[u.list].vertex[k][u.pair]] = 1;
        }
    }
    for (std::size_t list = 0; list < pairs_.size() && !all_are_open_; ++list) {
        const auto& vertex = pairs_[list].vertex;
        std::vector<std::uint32_t>& loose = loose_[list];
        std::erase_if(loose, [&](std::uint32_t k) { return zones_.are_rigid(pairs_[list].vertices(k)); });
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
    for (const std::uint32_t v : features_.vertices()) {
        const double from = start_[v].number[1];
        const double to = position[v].number[1];
        if (to < settings_.ground_height && to < from && masses_.inverse(v) > 0.0) {
            unsafe_.push_back(
                {kGround, v, std::max(0.0, kPartToGround * (from - settings_.ground_height) / (from - to))});
        }
    }
}

void SurfaceContacts::push_from_ground(std::uint32_t vertex, const MovingParticles& now) noexcept {
    const double height = std::min(start_[vertex].number[1], settings_.ground_height);
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
        const FeaturePairs& pairs = pairs_[u.list];
        const PairVertices vertex = pairs.vertices(u.pair);
        const NearestPoints first = nearest_points(pairs.kind, pairs.positions(u.pair, start_.data()));
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
                if (!are_of_one_surface(vertex)) {
                    masses_.displace(vertex, nearest.weight, impulse, now.pushed);
                }
            }
        };
        push(first);
        push(nearest_points(pairs.kind, pairs.positions(u.pair, position)));
    }
    for (const std::uint32_t v : features_.vertices()) {
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
            zones_.unite(pairs_[u.list].vertices(u.pair), part);
        }
    }
}

/// Everything moves alike, or stands still on the ground: every pair keeps its gap.
void SurfaceContacts::let_stand(const MovingParticles& now) noexcept {
    ++counts_.united;
    zones_.unite_all(settings_.ground);
    zones_.move(start_.data(), wish_.data(), false, now.position);
    for (FeaturePairs& pairs : pairs_) {
        pairs.end_gap = pairs.gap;
    }
    all_are_open_ = true;
    searched_ = false;  // it may have led out of the boxes
}

/// Before anything is moved: where the sub-step would lead.
void SurfaceContacts::begin_rounds(const MovingParticles& now) noexcept {
    for (const std::uint32_t v : features_.vertices()) {
        asked_[v] = wish_[v] = now.position[v];
    }
}

/// Lists what was moved, with its displacements by what does not belong to its body. Leaves no zones.
void SurfaceContacts::end_rounds(const MovingParticles& now) {
    const Row* const position = now.position;
    for (const std::uint32_t v : features_.vertices()) {
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
    if (asleep_ || !know_pairs(position)) {
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
            let_stand(now);
            break;
        }
        if (round < kPushRounds) {
            push_unsafe(now);
        } else {
            unite_unsafe(round >= kPushRounds + kPartRounds);
            zones_.move(start_.data(), wish_.data(), true, position);
        }
        zones_.find_rigid();
        if (have_left_paths(position)) {
            find_pairs(position, 0);
        } else if (have_come_near(position)) {
            choose_again(position);
        } else {
            open_moved(position);
        }
    }
    for (FeaturePairs& pairs : pairs_) {
        if (!all_are_open_) {
            kernels_.find_gaps(pairs.kind, pairs.rows(pairs.end_gap), pairs.size(), position);
        }
        std::swap(pairs.gap, pairs.end_gap);
    }
    if (round > 0) {
        end_rounds(now);
    }
    ++elapsed_;
    for (const std::uint32_t v : by_number_) {
        ended_[v] = position[v];
    }
    return moved_;
}

}  // namespace haptic::sim
