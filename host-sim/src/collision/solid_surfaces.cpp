#include "collision/solid_surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "dynamics/rows.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Unsafe pairs are pushed to this many least gaps.
constexpr double kPushedGaps = 2.0;
// Rounds: pairs that are unsafe are pushed apart, then bound; after the last their surfaces move as a whole.
constexpr int kPushes = 6;
constexpr int kBindings = 12;
// Searches of an attempt after its first: rounds have moved vertices.
constexpr int kMaxSearches = 12;
// Attempts after which the whole heaps stand still in which surfaces had to be carried.
constexpr int kAttempts = 3;
constexpr std::size_t kMany = std::numeric_limits<std::size_t>::max();  // more than any number of pairs
constexpr std::size_t kUnsafeAtFirst = 1U << 15;                        // pairs for which there is room

}  // namespace

SolidSurfaces::SolidSurfaces(std::vector<SolidSurface> surfaces, std::span<const Vec3> start,
                             SurfacesAtStart left_alone, double catch_up_speed, std::size_t lanes)
    : paths_(std::move(surfaces), start),
      pairs_(paths_, start, std::move(left_alone), lanes),
      patches_(paths_),
      kernels_(*find_kernels(&Kernels::features, lanes)),
      catch_up_speed_(catch_up_speed),
      changes_(paths_.surfaces.size(), 0),
      most_lag_(paths_.surfaces.size(), 0.0),
      lag_(start.size(), Vec3(0.0)) {
    if (!pairs_.is_empty()) {
        unsafe_.reserve(kUnsafeAtFirst);
    }
}

bool SolidSurfaces::may_hold_back() const noexcept {
    return !pairs_.is_empty() || std::ranges::any_of(most_lag_, [](double lag) { return lag > 0.0; });
}

void SolidSurfaces::ask(std::size_t surface, std::span<Vec3> end, double time) noexcept {
    if (!lags(surface)) {
        return;
    }
    const SolidSurface& of = paths_.surfaces[surface];
    const double catch_up = time * catch_up_speed_;
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        const double length = glm::length(lag_[v]);
        if (!(length > catch_up)) {
            lag_[v] = Vec3(0.0);
            continue;
        }
        const Vec3 skin = end[v];
        end[v] -= (1.0 - catch_up / length) * lag_[v];
        end[v].y = std::max(end[v].y, of.floor);
        lag_[v] = skin - end[v];
    }
}

void SolidSurfaces::let_sleep(std::span<const std::uint8_t> asleep) noexcept {
    for (std::size_t s = 0; s < paths_.surfaces.size(); ++s) {
        paths_.yields[s] = paths_.surfaces[s].movable && asleep[s] == 0 ? 1 : 0;
    }
}

void SolidSurfaces::keep_apart(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    std::ranges::fill(paths_.motion_of, kFollows);
    pairs_.begin_step();
    follow(start, end, workers);
}

void SolidSurfaces::forget_lag(std::size_t surface) noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    std::fill_n(lag_.begin() + static_cast<std::ptrdiff_t>(of.first_vertex), of.vertices, Vec3(0.0));
    most_lag_[surface] = 0.0;
}

void SolidSurfaces::carry(std::span<const std::uint32_t> carried_by, std::span<const RigidMotion> motions,
                          std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    for (std::size_t s = 0; s < carried_by.size(); ++s) {
        if (carried_by[s] == kStands) {
            let_stand(s, start, end);
        } else if (carried_by[s] != kFollows) {
            move_as_whole(s, carried_by[s], motions[carried_by[s]], start, end);
        } else {
            paths_.motion_of[s] = kFollows;
        }
    }
    follow(start, end, workers);
}

void SolidSurfaces::jump(std::size_t surface, std::span<const Vec3> to, std::span<Vec3> start, std::span<Vec3> end) {
    paths_.begin_attempt();
    paths_.take_part(static_cast<std::uint32_t>(surface), end, to);
    pairs_.jump(static_cast<std::uint32_t>(surface));
    const SolidSurface& of = paths_.surfaces[surface];
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        lag_[v] += end[v] - to[v];
        start[v] = end[v] = to[v];
    }
    find_most_lag(surface);
    refit(surface, start, end);
}

void SolidSurfaces::write_skin(std::size_t surface, std::span<const Vec3> end, std::span<Vec3> skin) const noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        skin[v] = end[v] + lag_[v];
    }
}

/// Lets all surfaces but those that are carried follow their skins as far as they can.
void SolidSurfaces::follow(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    for (int attempt = 1; !make_safe(start, end, workers); ++attempt) {
        // The surfaces that are left are carried, and everything is tried again.
        ++counts_.stuck;
        carry_unsafe(start, end);
        if (attempt >= kAttempts) {
            let_heap_stand(start, end);
        }
    }
    end_step(start, end, workers);
}

/// Moves the surfaces of unsafe pairs as a whole by their mean ways, which closes none of their own gaps. Those that
/// are carried already stand still, with all that make the same motion, and so do those that lead others.
void SolidSurfaces::carry_unsafe(std::span<const Vec3> start, std::span<Vec3> end) noexcept {
    std::ranges::fill(changes_, std::uint8_t{0});
    for (const UnsafePair& pair : unsafe_) {
        const PairVertices vertex = pair.vertices();
        for (const std::uint32_t v : {vertex[0], vertex[3]}) {
            let_change(paths_.surface_of[v]);
        }
    }
    pairs_.for_each_given_up([&](std::uint32_t surface) { let_change(surface); });
    for (std::uint32_t s = 0; s < changes_.size(); ++s) {
        if (changes_[s] != 0 && !is_carried(s) && !paths_.surfaces[s].exact) {
            move_as_whole(s, SurfacePaths::kMeanWays + s, mean_way(s, start, end), start, end);
        } else if (changes_[s] != 0) {
            let_stand(s, start, end);
        }
    }
}

/// Carries a surface: ends its step where this motion leads all of it.
void SolidSurfaces::move_as_whole(std::size_t surface, std::uint32_t motion_of, const RigidMotion& motion,
                                  std::span<const Vec3> start, std::span<Vec3> end) noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    paths_.motion_of[surface] = motion_of;
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        const Vec3 asked = end[v];
        end[v] = motion(start[v]);
        end[v].y = std::max(end[v].y, std::min(start[v].y, of.floor));
        lag_[v] += asked - end[v];
    }
    find_most_lag(surface);
    refit(surface, start, end);
}

void SolidSurfaces::let_stand(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end) noexcept {
    move_as_whole(surface, kStands, {}, start, end);
}

/// The mean way of a surface. It does not lead below the floor.
RigidMotion SolidSurfaces::mean_way(std::size_t surface, std::span<const Vec3> start,
                                    std::span<const Vec3> end) const noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    Vec3 sum(0.0);
    double lowest = std::numeric_limits<double>::max();
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        sum += end[v] - start[v];
        lowest = std::min(lowest, start[v].y);
    }
    Vec3 way = sum / static_cast<double>(of.vertices);
    way.y = std::max(way.y, std::min(of.floor - lowest, 0.0));
    return RigidMotion::by(way);
}

/// Marks a surface, and all that make the same motion; not what stands already.
void SolidSurfaces::let_change(std::uint32_t surface) noexcept {
    if (changes_[surface] != 0 || stands(surface)) {
        return;
    }
    for (std::uint32_t s = 0; s < changes_.size(); ++s) {
        if (s == surface || paths_.move_alike(s, surface)) {
            changes_[s] = 1;
        }
    }
}

/// The surfaces that carry_unsafe() has just changed stand still, and so does all that is near them, and near those of
/// it that can be pushed.
void SolidSurfaces::let_heap_stand(std::span<const Vec3> start, std::span<Vec3> end) noexcept {
    for (bool grows = true; grows;) {
        grows = false;
        const auto spread = [&](std::uint32_t from, std::uint32_t to) {
            if (changes_[from] != 0 && changes_[to] == 0 && paths_.yields[from] != 0) {
                let_change(to);
                grows = grows || changes_[to] != 0;
            }
        };
        for (const auto& [first, second] : pairs_.meetings()) {
            spread(first, second);
            spread(second, first);
        }
    }
    for (std::size_t s = 0; s < paths_.surfaces.size(); ++s) {
        if (changes_[s] != 0) {
            let_stand(s, start, end);
        }
    }
}

/// Moves ends until nothing crosses on the way to them. False: pairs are left, those of the last round, or some
/// surfaces were given up.
bool SolidSurfaces::make_safe(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    paths_.begin_attempt();
    patches_.begin_attempt();
    pairs_.search(start, end, workers);
    unsafe_.clear();
    int round = 0;
    std::size_t unsafe_before = kMany;
    bool is_first = true;
    for (int searches = 0; pairs_.knows_all();) {
        if (!find_unsafe()) {
            // Pairs are known where vertices have ended since they were searched.
            if (!pairs_.search_again(start, end, workers)) {
                return true;
            }
            if (++searches == kMaxSearches) {
                // The planes of these pairs are not known yet.
                return pairs_.knows_all() && !find_unsafe(false);
            }
            patches_.move(pairs_);
            unsafe_before = kMany;
            continue;
        }
        counts_.unsafe += std::exchange(is_first, false) ? unsafe_.size() : 0;
        if (round == kPushes + kBindings) {
            return false;
        }
        // Pushes that do not help any more are given up.
        if (round < kPushes && unsafe_.size() < unsafe_before) {
            push_unsafe();
        } else {
            round = std::max(round, kPushes);
            if (!patches_.bind(unsafe_)) {
                return false;  // nothing would change
            }
            patches_.move(pairs_);
        }
        ++round;
        unsafe_before = unsafe_.size();
    }
    return false;
}

/// Writes the ends that have changed.
void SolidSurfaces::end_step(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    std::ranges::fill(changes_, std::uint8_t{0});
    for (const std::uint32_t v : paths_.moved) {
        if (vector_of(paths_.end[v]) != vector_of(paths_.asked[v])) {
            changes_[paths_.surface_of[v]] = 1;
        }
    }
    workers.for_each(paths_.surfaces.size(), [&](std::size_t s) {
        if (changes_[s] != 0 || lags(s)) {
            take_ends(s, start, end);
        }
    });
}

/// Writes the ends of a surface, and how far they are from where its skin would be.
void SolidSurfaces::take_ends(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end) noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        const Vec3 asked = end[v];
        if (paths_.is_moved[v] != 0) {
            end[v] = vector_of(paths_.end[v]);
        }
        // Besides what ask() has left of it.
        lag_[v] += asked - end[v];
    }
    find_most_lag(surface);
    if (changes_[surface] != 0) {
        refit(surface, start, end);
    }
}

void SolidSurfaces::find_most_lag(std::size_t surface) noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    double most = 0.0;
    for (const Vec3& lag : std::span<const Vec3>(lag_).subspan(of.first_vertex, of.vertices)) {
        most = std::max(most, glm::dot(lag, lag));
    }
    most_lag_[surface] = std::sqrt(most);
}

void SolidSurfaces::refit(std::size_t surface, std::span<const Vec3> start, std::span<const Vec3> end) noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    of.tree->refit(
        {start.subspan(of.first_vertex, of.vertices), end.subspan(of.first_vertex, of.vertices), of.triangles});
}

/// Lists the pairs that are not proved apart all the way. Whether there are any. Those of one patch need no proof once
/// their vertices keep to the sides of their planes.
bool SolidSurfaces::find_unsafe(bool patches_are_apart) {
    ++paths_.round;
    unsafe_.clear();
    const double least = (1.0 - kRoundingOfGap) * paths_.least_gap;
    pairs_.for_each_list([&](ListedPairs& pairs) {
        kernels_.find_gaps(pairs.kind, pairs.rows(pairs.end_gap), pairs.size(), paths_.end.data());
        for (std::size_t k = 0; k < pairs.size(); ++k) {
            const bool apart = pairs.gap[k] > 0.0 && pairs.end_gap[k] >= least;
            if (apart || stands_proved(pairs, k) ||
                (patches_are_apart && patches_.is_kept_by_planes(pairs.vertices(k)))) {
                continue;
            }
            const NearestPoints& first = pairs.nearest_at_start(k, paths_.start.data());
            if (pairs.safe_part(k, first, paths_.start.data(), paths_.end.data(), least) < 1.0) {
                unsafe_.push_back({&pairs, k});
            } else {
                pairs.known[k].proved = paths_.round;
            }
        }
    });
    return !unsafe_.empty();
}

/// Whether a pair was proved apart and no vertex of it has changed its end since.
bool SolidSurfaces::stands_proved(const ListedPairs& pairs, std::size_t at) const noexcept {
    return std::ranges::all_of(pairs.vertices(at),
                               [&](std::uint32_t v) { return pairs.known[at].proved > paths_.moved_in[v]; });
}

/// Pushes unsafe pairs apart at the ends of their paths, between points at which they were, and are, nearest.
void SolidSurfaces::push_unsafe() {
    const double keep = kPushedGaps * paths_.least_gap;
    for (const auto& [list, at] : unsafe_) {
        ListedPairs& pairs = *list;
        const PairVertices vertex = pairs.vertices(at);
        const NearestPoints& first = pairs.nearest_at_start(at, paths_.start.data());
        const auto push = [&](const NearestPoints& nearest) {
            const Vec3 normal = nearest.normal();
            const double clearance = glm::dot(normal, weighted(nearest.weight, vertex, paths_.end.data())) - keep;
            double mobility = 0.0;
            for (std::size_t k = 0; k < 4; ++k) {
                mobility += paths_.can_move(vertex[k]) ? nearest.weight[k] * nearest.weight[k] : 0.0;
            }
            if (!(clearance < 0.0 && mobility > 0.0 && glm::dot(normal, first.normal()) > 0.0)) {
                return;
            }
            for (std::size_t k = 0; k < 4; ++k) {
                if (paths_.can_move(vertex[k])) {
                    paths_.note_move(vertex[k]);
                    Vec3 end = vector_of(paths_.end[vertex[k]]) + (-clearance / mobility * nearest.weight[k] * normal);
                    end.y = std::max(end.y, paths_.surfaces[paths_.surface_of[vertex[k]]].floor);
                    paths_.move_end(vertex[k], end);
                }
            }
        };
        push(first);
        push(nearest_points(pairs.kind, pairs.positions(at, paths_.end.data())));
    }
}

}  // namespace haptic::sim
