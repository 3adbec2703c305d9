#include "collision/bound_patches.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "collision/surface_pairs.hpp"
#include "dynamics/rows.hpp"
#include "dynamics/united.hpp"

namespace haptic::sim {

BoundPatches::BoundPatches(SurfacePaths& paths)
    : paths_(paths),
      some_are_exact_(std::ranges::any_of(paths.surfaces, [](const SolidSurface& of) { return of.exact; })),
      part_(paths.surface_of.size()),
      patch_(paths.surface_of.size()),
      led_(paths.surface_of.size()),
      led_sum_(paths.surface_of.size()) {
    bound_.reserve(paths.surface_of.size());
}

void BoundPatches::begin_attempt() noexcept {
    for (const std::uint32_t v : bound_) {
        paths_.parent[v] = SurfacePaths::kFree;
    }
    bound_.clear();
}

bool BoundPatches::is_kept_by_planes(const PairVertices& vertex) const noexcept {
    return paths_.is_of_one_patch(vertex) && std::ranges::all_of(vertex, [&](std::uint32_t v) {
               return !paths_.is_exact(v) && led_[v] == patch_[paths_.parent[v]].motion;
           });
}

bool BoundPatches::bind(std::span<const UnsafePair> unsafe) {
    bool binds = false;
    for (const UnsafePair& pair : unsafe) {
        const PairVertices vertex = pair.vertices();
        binds = binds || !paths_.is_of_one_patch(vertex);
        for (const std::uint32_t v : vertex) {
            if (paths_.parent[v] == SurfacePaths::kFree) {
                paths_.parent[v] = v;
                bound_.push_back(v);
                paths_.note_move(v);
            }
            paths_.parent[root_of(paths_.parent, v)] = root_of(paths_.parent, vertex[0]);
        }
    }
    for (const std::uint32_t v : bound_) {
        paths_.parent[v] = root_of(paths_.parent, v);
    }
    return binds;
}

/// The common motion of each patch: the mean of what is asked of its vertices, or of those that cannot be pushed where
/// it has some; and not below the floor.
void BoundPatches::find_common_motions() {
    for (const std::uint32_t v : bound_) {
        patch_[v] = {};
    }
    for (const std::uint32_t v : bound_) {
        Patch& patch = patch_[paths_.parent[v]];
        Patch::Sum& sum = paths_.is_exact(v) ? patch.exact : paths_.can_move(v) ? patch.yielding : patch.led;
        sum.motion += vector_of(paths_.asked[v]) - vector_of(paths_.start[v]);
        sum.vertices += 1.0;
        patch.lowest = std::max(patch.lowest, paths_.surfaces[paths_.surface_of[v]].floor - paths_.start[v].number[1]);
    }
    for (const std::uint32_t v : bound_) {
        if (paths_.parent[v] == v) {
            Patch& patch = patch_[v];
            const Patch::Sum& sum = patch.led.vertices > 0.0     ? patch.led
                                    : patch.exact.vertices > 0.0 ? patch.exact
                                                                 : patch.yielding;
            patch.motion = sum.motion / sum.vertices;
            patch.motion.y = std::max(patch.motion.y, std::min(patch.lowest, 0.0));
        }
    }
}

/// Calls visit(list, index) for the pairs of one patch.
template <class Visit>
void BoundPatches::for_each_bound_pair(SurfacePairs& pairs, const Visit& visit) const {
    pairs.for_each_list([&](ListedPairs& list) {
        for (std::size_t k = 0; k < list.size(); ++k) {
            if (paths_.is_of_one_patch(list.vertices(k))) {
                visit(list, k);
            }
        }
    });
}

/// Leads vertices as their patch goes, or as the features of exact surfaces go that they meet, and behind these; but
/// those that go as they are asked, by that, unless it is as their patch goes, to rounding.
void BoundPatches::find_led(SurfacePairs& pairs) {
    for (const std::uint32_t v : bound_) {
        led_[v] = patch_[paths_.parent[v]].motion;
        if (paths_.goes_as_asked(v)) {
            const Vec3 own = vector_of(paths_.asked[v]) - vector_of(paths_.start[v]);
            led_[v] = glm::distance(own, led_[v]) > kRoundingOfGap * paths_.least_gap ? own : led_[v];
        }
    }
    if (!some_are_exact_) {
        return;
    }
    for (const std::uint32_t v : bound_) {
        led_sum_[v] = {};
    }
    const auto for_each_exact_pair = [&](const auto& visit) {
        for_each_bound_pair(pairs, [&](ListedPairs& list, std::size_t at) {
            if (const PairVertices vertex = list.vertices(at); meets_exact(vertex)) {
                visit(vertex, sides_of(list, at));
            }
        });
    };
    for_each_exact_pair([&](const PairVertices& vertex, const Sides& sides) {
        for (const std::uint32_t v : vertex) {
            if (!paths_.goes_as_asked(v)) {
                led_sum_[v].motion += sides.common;
                led_sum_[v].vertices += 1.0;
            }
        }
    });
    for (const std::uint32_t v : bound_) {
        if (led_sum_[v].vertices > 0.0) {
            led_[v] = led_sum_[v].motion / led_sum_[v].vertices;
        }
    }
    for_each_exact_pair([&](const PairVertices& vertex, const Sides& sides) {
        for (std::size_t k = 0; k < 4; ++k) {
            const double height =
                glm::dot(sides.normal, vector_of(paths_.start[vertex[k]]) + led_[vertex[k]] - sides.common);
            const double missing = sides.half - sides.sign[k] * (height - sides.middle);
            if (missing > 0.0 && !paths_.is_exact(vertex[k]) && !paths_.goes_as_asked(vertex[k])) {
                led_[vertex[k]] += missing * sides.sign[k] * sides.normal;
            }
        }
    });
    for (const std::uint32_t v : bound_) {
        if (led_sum_[v].vertices > 0.0) {
            led_[v].y = std::max(
                led_[v].y, std::min(paths_.surfaces[paths_.surface_of[v]].floor - paths_.start[v].number[1], 0.0));
        }
    }
}

void BoundPatches::move(SurfacePairs& pairs) {
    if (bound_.empty()) {
        return;
    }
    find_common_motions();
    find_led(pairs);
    for (const std::uint32_t v : bound_) {
        part_[v] = 1.0;
    }
    for_each_bound_pair(pairs, [&](ListedPairs& list, std::size_t at) { keep_to_sides(list, at); });
    for (const std::uint32_t v : bound_) {
        if (paths_.goes_as_asked(v) || paths_.is_exact(v)) {
            continue;
        }
        const Vec3 led = vector_of(paths_.start[v]) + led_[v];
        paths_.move_end(v, led + part_[v] * (vector_of(paths_.asked[v]) - led));
    }
}

/// The plane in the middle of the gap in which a pair of one patch is at the start. It moves as the patch does, or as
/// the nearest point of an exact feature, and farther where it must for the others of that.
BoundPatches::Sides BoundPatches::sides_of(ListedPairs& list, std::size_t at) const noexcept {
    const PairVertices vertex = list.vertices(at);
    const FeatureVertices from = list.positions(at, paths_.start.data());
    const NearestPoints& nearest = list.nearest_at_start(at, paths_.start.data());
    const auto in_first = static_cast<std::size_t>(list.kind);
    Sides sides;
    // Along other normals that part them they may be apart by less than the gap.
    sides.normal = nearest.normal();
    double first = std::numeric_limits<double>::max();
    double second = std::numeric_limits<double>::lowest();
    for (std::size_t k = 0; k < 4; ++k) {
        const double height = glm::dot(sides.normal, from[k]);
        (k < in_first ? first : second) = k < in_first ? std::min(first, height) : std::max(second, height);
        sides.sign[k] = k < in_first ? 1.0 : -1.0;
    }
    sides.half = 0.5 * std::min(first - second, paths_.least_gap);
    sides.middle = 0.5 * (first + second);
    if (!meets_exact(vertex)) {
        sides.common = patch_[paths_.parent[vertex[0]]].motion;
        return sides;
    }
    for (std::size_t k = 0; k < 4; ++k) {
        if (paths_.is_exact(vertex[k])) {
            sides.common += std::abs(nearest.weight[k]) * (vector_of(paths_.asked[vertex[k]]) - from[k]);
        }
    }
    for (std::size_t k = 0; k < 4; ++k) {
        if (paths_.is_exact(vertex[k])) {
            const double asked = glm::dot(sides.normal, vector_of(paths_.asked[vertex[k]]) - sides.common);
            sides.middle =
                k < in_first ? std::min(sides.middle, asked - sides.half) : std::max(sides.middle, asked + sides.half);
        }
    }
    return sides;
}

/// Shortens the paths of a pair's vertices so that each stays on its side of their plane.
void BoundPatches::keep_to_sides(ListedPairs& list, std::size_t at) noexcept {
    const PairVertices vertex = list.vertices(at);
    const Sides sides = sides_of(list, at);
    for (std::size_t k = 0; k < 4; ++k) {
        const Vec3 from = vector_of(paths_.start[vertex[k]]);
        const double room = sides.sign[k] * (glm::dot(sides.normal, from) - sides.middle) - sides.half;
        // Where it is led, and where it is asked to go, toward its side.
        const double led = sides.sign[k] * glm::dot(sides.normal, led_[vertex[k]] - sides.common);
        const double asked =
            sides.sign[k] * glm::dot(sides.normal, vector_of(paths_.asked[vertex[k]]) - from - sides.common);
        if (-asked > room) {
            part_[vertex[k]] =
                std::min(part_[vertex[k]], led > asked ? std::max(0.0, room + led) / (led - asked) : 0.0);
        }
    }
}

}  // namespace haptic::sim
