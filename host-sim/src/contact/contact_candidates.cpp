#include "contact/contact_candidates.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>

#include "contact/contact_points.hpp"
#include "contact/scratch.hpp"

namespace haptic::sim {

namespace {

constexpr double kMarginRadii = 1.25;      // radii around the path within which contacts are collected
constexpr double kMaxGoalRadii = 1.0;      // radii, distance along each axis beyond which a goal is clamped
constexpr double kMaxFollowedRadii = 3.5;  // radii, size of a query that a list follows: a sphere on half a radius' way
constexpr double kFollowMarginRadii = 0.5;  // radii, around that query

/// Box of all positions that a proxy may reach: around the segment to its goal, also displaced with nearby surfaces.
Aabb region_of(const ProxyReach& at, std::span<const MovingSurface> surfaces) noexcept {
    // A goal farther than a radius is clamped: the rest of its path goes through the trees.
    const Vec3 max_goal(kMaxGoalRadii * at.radius);
    const Vec3 goal = at.position + glm::clamp(at.goal - at.position, -max_goal, max_goal);
    // Reach while the surfaces rest, contacts included.
    const Aabb reach_box = aabb_of_segment(at.position, goal, kMarginRadii * at.radius);
    Aabb region = reach_box;
    for (const MovingSurface& surface : surfaces) {
        // A surface in reach may carry the proxy by any of its displacements.
        if (surface.tree->overlaps(reach_box)) {
            const Aabb& d = surface.tree->displacement();
            region.extend(Aabb{reach_box.min + d.min, reach_box.max + d.max});
        }
    }
    return region;
}

}  // namespace

ContactCandidates::ContactCandidates(std::size_t proxies) {
    if (proxies > kMaxProxies) {
        throw std::invalid_argument("contact candidates for " + std::to_string(proxies) + " proxies: at most " +
                                    std::to_string(kMaxProxies) + " are supported");
    }
    lists_.resize(proxies);
    last_contacts_.resize(proxies);
}

ContactCandidates::ContactCandidates(ContactCandidates&&) noexcept = default;
ContactCandidates& ContactCandidates::operator=(ContactCandidates&&) noexcept = default;
ContactCandidates::~ContactCandidates() = default;

void ContactCandidates::collect(std::span<const MovingSurface> surfaces, std::span<const ProxyReach> proxies) noexcept {
    surfaces_ = surfaces;
    proxy_count_ = std::min(proxies.size(), lists_.size());
    // Region of each proxy, with empty lists.
    Scratch<Aabb, kMaxProxies> region;
    Scratch<BoxLimits, kMaxProxies> limits;
    for (std::size_t p = 0; p < proxy_count_; ++p) {
        List& list = lists_[p];
        list.clear(region_of(proxies[p], surfaces));
        list.radius = proxies[p].radius;
        region[p] = list.region;
        limits[p] = BoxLimits(list.region);
        last_contacts_[p].known = false;
    }
    // One traversal of each tree for all proxies: bit p of `mask` is set if the leaf overlaps region p.
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SweptTree& tree = *surfaces[object].tree;
        tree.query_leaves({region.data(), proxy_count_}, [&](std::uint32_t leaf, std::uint64_t mask) {
            const std::span<const std::uint32_t> triangles = tree.triangles_of(leaf);
            const LeafBoxes boxes(surfaces[object], leaf, QueryTime::WholeStep);
            for (; mask != 0; mask &= mask - 1) {
                const auto p = static_cast<std::size_t>(std::countr_zero(mask));
                add(lists_[p], limits[p], object, triangles, boxes);
            }
        });
    }
}

NearSurfaces ContactCandidates::of(std::size_t proxy) noexcept {
    if (proxy >= proxy_count_) {
        return surfaces_;
    }
    // An overflowed list is incomplete and must not be used.
    return {surfaces_, lists_[proxy].complete ? &lists_[proxy] : nullptr, &last_contacts_[proxy]};
}

std::size_t ContactCandidates::listed(std::size_t proxy) const noexcept {
    std::size_t count = 0;
    if (proxy < proxy_count_) {
        for (std::uint32_t r = 0; r < lists_[proxy].range_count; ++r) {
            count += lists_[proxy].range[r].end - lists_[proxy].range[r].begin;
        }
    }
    return count;
}

std::size_t ContactCandidates::overflows() const noexcept {
    std::size_t count = 0;
    for (std::size_t p = 0; p < proxy_count_; ++p) {
        count += lists_[p].complete ? 0u : 1u;
    }
    return count;
}

void ContactCandidates::follow(List& list, std::span<const MovingSurface> surfaces, const Aabb& box) noexcept {
    // The sweep of a long move is a single query: through the trees. So is any where the surroundings are crowded.
    const Vec3 size = box.size();
    if (!list.complete || std::max({size.x, size.y, size.z}) > kMaxFollowedRadii * list.radius) {
        return;
    }
    // Room for the next moves on all sides.
    const Vec3 margin(kFollowMarginRadii * list.radius);
    list.clear({box.min - margin, box.max + margin});
    const BoxLimits limits(list.region);
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SweptTree& tree = *surfaces[object].tree;
        tree.query_leaves(list.region, [&](std::uint32_t leaf) {
            add(list, limits, object, tree.triangles_of(leaf), LeafBoxes(surfaces[object], leaf, QueryTime::WholeStep));
        });
    }
}

void ContactCandidates::add(List& list, const BoxLimits& limits, std::uint32_t object,
                            std::span<const std::uint32_t> triangles, const LeafBoxes& boxes) noexcept {
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        if (!limits.overlap(boxes.at(QueryTime::WholeStep, k))) {
            continue;
        }
        // The first candidate of a surface opens its range.
        const bool opens = list.range_count == 0 || list.range[list.range_count - 1].object != object;
        // Full: the list is incomplete, so queries use the trees.
        if (list.count == kMaxListed || (opens && list.range_count == kMaxRanges)) {
            list.complete = false;
            return;
        }
        if (opens) {
            list.range[list.range_count++] = {object, list.count, list.count};
        }
        // Append triangle k with its boxes.
        list.triangle[list.count] = triangles[k];
        for (const QueryTime when : {QueryTime::WholeStep, QueryTime::EndOfStep}) {
            list.box[static_cast<std::size_t>(when)][list.count] = boxes.at(when, k);
        }
        list.range[list.range_count - 1].end = ++list.count;
    }
}

}  // namespace haptic::sim
