#include "contact/contact_candidates.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>

#include "contact/scratch.hpp"

namespace haptic::sim {

namespace {

constexpr double kMarginRadii = 1.25;  // radii around the path within which contacts are collected
constexpr double kMaxGoalRadii = 1.0;  // radii, distance along each axis beyond which a goal is clamped
// Relative margins. Single precision rounds by 6e-8 of a number; the double-precision tests of the contact code err by
// about a billionth of that, so every triangle that they accept is inside its rounded box.
constexpr double kRoundOutward = 1e-6;
constexpr double kSphereRoundOutward = 1e-5;

/// Conversions to single precision that never shrink a box.
float round_down(double x) noexcept {
    return static_cast<float>(x - std::abs(x) * kRoundOutward);
}

float round_up(double x) noexcept {
    return static_cast<float>(x + std::abs(x) * kRoundOutward);
}

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

template <std::size_t Count>
void ContactCandidates::PackedBoxes<Count>::set(std::size_t at, const Aabb& box) noexcept {
    // [min | -max], both rounded down.
    for (int axis = 0; axis < 3; ++axis) {
        bound[static_cast<std::size_t>(axis)][at] = round_down(box.min[axis]);
        bound[static_cast<std::size_t>(axis) + 3][at] = round_down(-box.max[axis]);
    }
}

ContactCandidates::BoxLimits ContactCandidates::limits_of(const Aabb& box) noexcept {
    const auto all = [](float x) { return Lanes{x, x, x, x}; };
    // [max | -min], both rounded up.
    return {all(round_up(box.max.x)),  all(round_up(box.max.y)),  all(round_up(box.max.z)),
            all(round_up(-box.min.x)), all(round_up(-box.min.y)), all(round_up(-box.min.z))};
}

ContactCandidates::SphereLimits::SphereLimits(const SweptSphere& sphere) noexcept : box(limits_of(sphere.box)) {
    const auto all = [](double number) {
        const auto x = static_cast<float>(number);
        return Lanes{x, x, x, x};
    };
    // The sphere is rounded outward more than the boxes: its test squares and adds.
    const double radius = sphere.bounding_radius * (1.0 + kSphereRoundOutward);
    center = {all(sphere.center.x), all(sphere.center.y), all(sphere.center.z)};
    squared = all(radius * radius);
}

SweptSphere::SweptSphere(const Vec3& from, const Vec3& to, double radius) noexcept
    : box(aabb_of_segment(from, to, radius)), center(0.5 * (from + to)) {
    const Vec3 half = to - center;
    bounding_radius = radius + std::sqrt(glm::dot(half, half));
}

ContactCandidates::ContactCandidates(std::size_t proxies) {
    if (proxies > kMaxProxies) {
        throw std::invalid_argument("contact candidates for " + std::to_string(proxies) + " proxies: at most " +
                                    std::to_string(kMaxProxies) + " are supported");
    }
    lists_.resize(proxies);
}

void ContactCandidates::collect(std::span<const MovingSurface> surfaces, std::span<const ProxyReach> proxies) noexcept {
    surfaces_ = surfaces;
    proxy_count_ = std::min(proxies.size(), lists_.size());
    // Region of each proxy, with empty lists.
    Scratch<Aabb, kMaxProxies> region;
    for (std::size_t p = 0; p < proxy_count_; ++p) {
        List& list = lists_[p];
        region[p] = list.region = region_of(proxies[p], surfaces);
        list.complete = true;
        list.range_count = 0;
        list.count = 0;
    }
    LeafBoxes boxes;
    // One traversal of each tree for all proxies: bit p of `mask` is set if the leaf overlaps region p.
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SweptTree& tree = *surfaces[object].tree;
        tree.query_leaves({region.data(), proxy_count_}, [&](std::uint32_t leaf, std::uint64_t mask) {
            const std::span<const std::uint32_t> triangles = tree.triangles_of(leaf);
            compute_boxes(boxes, surfaces[object].motion, triangles);
            for (; mask != 0; mask &= mask - 1) {
                add(lists_[static_cast<std::size_t>(std::countr_zero(mask))], object, triangles, boxes);
            }
        });
    }
}

NearSurfaces ContactCandidates::of(std::size_t proxy) const noexcept {
    // An overflowed list is incomplete and must not be used.
    const bool listed = proxy < proxy_count_ && lists_[proxy].complete;
    return {surfaces_, listed ? &lists_[proxy] : nullptr};
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

void ContactCandidates::compute_boxes(LeafBoxes& boxes, const SurfaceMotion& motion,
                                      std::span<const std::uint32_t> triangles) noexcept {
    // Both boxes of each triangle: at the end of the step, and over all of it.
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        const Triangle& t = motion.triangles[triangles[k]];
        const Aabb end = aabb_of(motion.end[t[0]], motion.end[t[1]], motion.end[t[2]]);
        Aabb step = end;
        step.extend(aabb_of(motion.start[t[0]], motion.start[t[1]], motion.start[t[2]]));
        boxes[static_cast<std::size_t>(QueryTime::EndOfStep)].set(k, end);
        boxes[static_cast<std::size_t>(QueryTime::WholeStep)].set(k, step);
    }
}

void ContactCandidates::add(List& list, std::uint32_t object, std::span<const std::uint32_t> triangles,
                            const LeafBoxes& boxes) noexcept {
    // Four boxes at a time; the leaf's last register may be partly used.
    const BoxLimits limits = limits_of(list.region);
    const PackedBoxes<SweptTree::kMaxInLeaf>& step = boxes[static_cast<std::size_t>(QueryTime::WholeStep)];
    for (std::size_t first = 0; first < triangles.size(); first += kLanes) {
        const std::size_t lanes_used = std::min(kLanes, triangles.size() - first);
        for (std::uint32_t hits = overlapping(step, first, limits) & ((1u << lanes_used) - 1u); hits != 0;
             hits &= hits - 1) {
            // Full: the list is incomplete, so queries use the trees.
            if (!reserve_slot(list, object)) {
                list.complete = false;
                return;
            }
            // Append triangle k with its packed boxes.
            const std::size_t k = first + static_cast<std::size_t>(std::countr_zero(hits));
            list.triangle[list.count] = triangles[k];
            for (std::size_t when = 0; when < kKinds; ++when) {
                for (std::size_t b = 0; b < 6; ++b) {
                    list.box[when].bound[b][list.count] = boxes[when].bound[b][k];
                }
            }
            list.range[list.range_count - 1].end = ++list.count;
        }
    }
}

bool ContactCandidates::reserve_slot(List& list, std::uint32_t object) noexcept {
    // A new surface starts at a whole register, so that a query never mixes two surfaces.
    if (list.range_count == 0 || list.range[list.range_count - 1].object != object) {
        list.count = (list.count + kLanes - 1) / kLanes * kLanes;
        if (list.range_count == kMaxRanges) {
            return false;
        }
        list.range[list.range_count++] = {object, list.count, list.count};
    }
    if (list.count == kMaxListed) {
        return false;
    }
    // New register: fill it with empty boxes, which overlap nothing.
    if (list.count % kLanes == 0) {
        for (PackedBoxes<kMaxListed>& boxes : list.box) {
            for (auto& bound : boxes.bound) {
                std::fill_n(&bound[list.count], kLanes, std::numeric_limits<float>::infinity());
            }
        }
    }
    return true;
}

}  // namespace haptic::sim
