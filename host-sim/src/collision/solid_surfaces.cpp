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

// Of the mean edge of the finest surface: a lag that only bodies have that passed through one another.
constexpr double kTornOfEdge = 6.0;
constexpr double kWayIfTornOfEdge = 1.0;  // that a vertex then goes in a step at most
// A surface that had to stand still is asked for less of its way, then for more again in each step.
constexpr double kLeastEase = 1.0 / 64.0;
constexpr double kEasesBy = 1.25;
// Unsafe pairs are pushed to this many least gaps.
constexpr double kPushedGaps = 2.0;
// The least gap counts as kept down to this share below it: more than rounding takes.
constexpr double kRoundingOfGap = 1e-6;
// Rounds: pairs that are unsafe are pushed apart, then bound; after the last their surfaces stand still.
constexpr int kPushes = 6;
constexpr int kBindings = 12;
// Searches of an attempt after its first: rounds have moved vertices.
constexpr int kMaxSearches = 12;
// Attempts after which all surfaces that are near one that stands still do so too.
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
      torn_(kTornOfEdge * paths_.finest_edge),
      way_if_torn_(kWayIfTornOfEdge * paths_.finest_edge),
      changes_(paths_.surfaces.size(), 0),
      most_lag_(paths_.surfaces.size(), 0.0),
      ease_(paths_.surfaces.size(), 1.0),
      lag_(start.size(), Vec3(0.0)) {
    if (!pairs_.is_empty()) {
        unsafe_.reserve(kUnsafeAtFirst);
    }
}

bool SolidSurfaces::may_hold_back() const noexcept {
    return !pairs_.is_empty() || std::ranges::any_of(most_lag_, [](double lag) { return lag > 0.0; });
}

void SolidSurfaces::ask(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end, double step) noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    const auto each_vertex = [&](const auto& visit) {
        for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
            visit(v);
        }
    };
    const auto go_to = [&](std::size_t v, const Vec3& place) {
        const Vec3 skin = end[v];
        end[v] = place;
        end[v].y = std::max(end[v].y, of.floor);
        lag_[v] = skin - end[v];
    };
    if (most_lag_[surface] > torn_) {
        // What is elsewhere than its skin cannot share the skin's motion, but the mean of it: it goes straight there.
        Vec3 mean(0.0);
        each_vertex([&](std::size_t v) { mean += (end[v] - (start[v] + lag_[v])) / static_cast<double>(of.vertices); });
        double part = 1.0;
        each_vertex([&](std::size_t v) {
            part = std::min(part, ease_[surface] * way_if_torn_ / glm::length(end[v] - (start[v] + mean)));
        });
        each_vertex([&](std::size_t v) {
            const Vec3 shared = start[v] + mean;
            go_to(v, shared + part * (end[v] - shared));
        });
    } else if (lags(surface)) {
        const double catch_up = step * catch_up_speed_;
        each_vertex([&](std::size_t v) {
            if (const double length = glm::length(lag_[v]); length > catch_up) {
                go_to(v, end[v] - (1.0 - catch_up / length) * lag_[v]);
            } else {
                lag_[v] = Vec3(0.0);
            }
        });
    }
    ease_[surface] = std::min(1.0, kEasesBy * ease_[surface]);
}

void SolidSurfaces::let_sleep(std::span<const std::uint8_t> asleep) noexcept {
    for (std::size_t s = 0; s < paths_.surfaces.size(); ++s) {
        paths_.yields[s] = paths_.surfaces[s].movable && asleep[s] == 0 ? 1 : 0;
    }
}

void SolidSurfaces::keep_apart(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    std::ranges::fill(paths_.stands, std::uint8_t{0});
    pairs_.begin_step();
    follow(start, end, workers);
}

void SolidSurfaces::forget_lag(std::size_t surface) noexcept {
    const SolidSurface& of = paths_.surfaces[surface];
    std::fill_n(lag_.begin() + static_cast<std::ptrdiff_t>(of.first_vertex), of.vertices, Vec3(0.0));
    most_lag_[surface] = 0.0;
}

void SolidSurfaces::let_stand(std::span<const std::uint8_t> stands, std::span<const Vec3> start, std::span<Vec3> end,
                              Workers& workers) {
    std::ranges::copy(stands, paths_.stands.begin());
    follow(start, end, workers);
}

/// Lets all surfaces but those that stand still follow their skins as far as they can.
void SolidSurfaces::follow(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    for (int attempt = 1; !make_safe(start, end, workers); ++attempt) {
        // The surfaces that are left stand still, and everything is tried again.
        ++counts_.stood;
        bool some_meet = false;
        for (const UnsafePair& pair : unsafe_) {
            const PairVertices vertex = pair.vertices();
            some_meet = some_meet || paths_.surface_of[vertex[0]] != paths_.surface_of[vertex[3]];
            for (const std::uint32_t v : vertex) {
                const std::uint32_t surface = paths_.surface_of[v];
                if (std::exchange(paths_.stands[surface], std::uint8_t{1}) == 0) {
                    ease_[surface] = std::max(kLeastEase, 0.5 * ease_[surface]);
                }
            }
        }
        if (attempt >= kAttempts || (some_meet && some_are_torn())) {
            let_heap_stand();
        }
    }
    end_step(start, end, workers);
}

/// Whether bodies have passed through one another, so that a surface that may meet others is stretched between them.
/// Pushes will not help it.
bool SolidSurfaces::some_are_torn() const noexcept {
    return std::ranges::any_of(pairs_.meetings(), [&](const BodyPair& pair) {
        return most_lag_[pair.first] > torn_ || most_lag_[pair.second] > torn_;
    });
}

/// What is near a surface that stands still stands still too.
void SolidSurfaces::let_heap_stand() noexcept {
    for (bool grows = true; grows;) {
        grows = false;
        for (const auto& [first, second] : pairs_.meetings()) {
            grows = grows || paths_.stands[first] != paths_.stands[second];
            paths_.stands[first] = paths_.stands[second] = paths_.stands[first] | paths_.stands[second];
        }
    }
}

/// Moves ends until nothing crosses on the way to them. False: pairs are left, those of the last round.
bool SolidSurfaces::make_safe(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers) {
    paths_.begin_attempt();
    patches_.begin_attempt();
    pairs_.search(start, end, workers);
    int round = some_are_torn() ? kPushes : 0;
    std::size_t unsafe_before = kMany;
    bool is_first = true;
    for (int searches = 0;;) {
        if (!find_unsafe()) {
            // Pairs are known where vertices have ended since they were searched.
            if (!pairs_.search_again(start, end, workers)) {
                return true;
            }
            if (++searches == kMaxSearches) {
                // The planes of these pairs are not known yet.
                return !find_unsafe(false);
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
}

/// Writes the ends that have changed.
void SolidSurfaces::end_step(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers) {
    changes_ = paths_.stands;
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
    double most = 0.0;
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        const Vec3 asked = end[v];
        if (paths_.stands[surface] != 0) {
            end[v] = start[v];
        } else if (paths_.is_moved[v] != 0) {
            end[v] = vector_of(paths_.end[v]);
        }
        // Besides what ask() has left of it.
        lag_[v] += asked - end[v];
        most = std::max(most, glm::dot(lag_[v], lag_[v]));
    }
    most_lag_[surface] = std::sqrt(most);
    if (changes_[surface] != 0) {
        of.tree->refit(
            {start.subspan(of.first_vertex, of.vertices), end.subspan(of.first_vertex, of.vertices), of.triangles});
    }
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
