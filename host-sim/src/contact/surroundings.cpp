#include "haptic/sim/contact/surroundings.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>

#include "contact/touching.hpp"

namespace haptic::sim {

namespace {

constexpr double kWithin = 1.25;       // radii, of what a proxy that stays looks for
constexpr double kFarthestGoal = 1.0;  // radii, along each axis
// Single precision rounds by 6e-8 of a number; the contact code's own rounding, which must not see more than these
// boxes do, is a billionth of that.
constexpr double kOutwards = 1e-6;
constexpr double kSphereOutwards = 1e-5;

float below(double x) noexcept {
    return static_cast<float>(x - std::abs(x) * kOutwards);
}

float above(double x) noexcept {
    return static_cast<float>(x + std::abs(x) * kOutwards);
}

Box united(const Box& a, const Box& b) noexcept {
    return {glm::min(a.low, b.low), glm::max(a.high, b.high)};
}

Box box_of(const TriangleCorners& t) noexcept {
    return {glm::min(t.a, glm::min(t.b, t.c)), glm::max(t.a, glm::max(t.b, t.c))};
}

/// Where the proxy can go, and with what surfaces.
Box region_of(const ProxyReach& at, std::span<const MovingSurface> surfaces) noexcept {
    const Vec3 farthest(kFarthestGoal * at.radius);
    const Vec3 goal = at.position + glm::clamp(at.goal - at.position, -farthest, farthest);
    const Box stays = box_about(at.position, goal, kWithin * at.radius + at.margin);
    Box region = stays;
    for (const MovingSurface& surface : surfaces) {
        if (surface.tree->meets(stays)) {
            const Box& d = surface.tree->displacement();
            region = united(region, {stays.low + d.low, stays.high + d.high});
        }
    }
    return region;
}

}  // namespace

template <std::size_t Count>
void Surroundings::Boxes<Count>::set(std::size_t at, const Box& box) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
        bound[static_cast<std::size_t>(axis)][at] = below(box.low[axis]);
        bound[static_cast<std::size_t>(axis) + 3][at] = below(-box.high[axis]);
    }
}

Surroundings::BoxLimits Surroundings::limits_of(const Box& box) noexcept {
    const auto all = [](float x) { return Lanes{x, x, x, x}; };
    return {all(above(box.high.x)), all(above(box.high.y)), all(above(box.high.z)),
            all(above(-box.low.x)), all(above(-box.low.y)), all(above(-box.low.z))};
}

Surroundings::BallLimits::BallLimits(const SweptBall& ball) noexcept : box(limits_of(ball.box)) {
    const auto all = [](double number) {
        const auto x = static_cast<float>(number);
        return Lanes{x, x, x, x};
    };
    const double outer = ball.outer * (1.0 + kSphereOutwards);
    center = {all(ball.center.x), all(ball.center.y), all(ball.center.z)};
    squared = all(outer * outer);
}

SweptBall::SweptBall(const Vec3& from, const Vec3& to, double radius) noexcept
    : box(box_about(from, to, radius)), center(0.5 * (from + to)) {
    const Vec3 half = to - center;
    outer = radius + std::sqrt(glm::dot(half, half));
}

Surroundings::Surroundings(std::size_t proxies) {
    if (proxies > kMaxProxies) {
        throw std::invalid_argument("surroundings of " + std::to_string(proxies) + " proxies: at most " +
                                    std::to_string(kMaxProxies) + " are looked round together");
    }
    lists_.resize(proxies);
}

void Surroundings::collect(std::span<const MovingSurface> surfaces, std::span<const ProxyReach> proxies) noexcept {
    surfaces_ = surfaces;
    proxy_count_ = std::min(proxies.size(), lists_.size());
    std::array<Box, kMaxProxies> region;
    for (std::size_t p = 0; p < proxy_count_; ++p) {
        List& list = lists_[p];
        region[p] = list.region = region_of(proxies[p], surfaces);
        list.limits = limits_of(list.region);
        list.complete = true;
        list.run_count = 0;
        list.count = 0;
    }
    LeafBoxes boxes;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SweptTree& tree = *surfaces[object].tree;
        tree.walk({region.data(), proxy_count_}, [&](std::uint32_t leaf, std::uint64_t who) {
            const std::span<const std::uint32_t> triangles = tree.triangles_of(leaf);
            make_boxes(boxes, surfaces[object].motion, triangles);
            for (; who != 0; who &= who - 1) {
                add(lists_[static_cast<std::size_t>(std::countr_zero(who))], object, triangles, boxes);
            }
        });
    }
}

NearSurfaces Surroundings::of(std::size_t proxy) const noexcept {
    const bool listed = proxy < proxy_count_ && lists_[proxy].complete;
    return {surfaces_, listed ? &lists_[proxy] : nullptr};
}

std::size_t Surroundings::listed(std::size_t proxy) const noexcept {
    std::size_t count = 0;
    if (proxy < proxy_count_) {
        for (std::uint32_t r = 0; r < lists_[proxy].run_count; ++r) {
            count += lists_[proxy].run[r].end - lists_[proxy].run[r].begin;
        }
    }
    return count;
}

std::size_t Surroundings::overflows() const noexcept {
    std::size_t count = 0;
    for (std::size_t p = 0; p < proxy_count_; ++p) {
        count += lists_[p].complete ? 0u : 1u;
    }
    return count;
}

void Surroundings::make_boxes(LeafBoxes& boxes, const SurfaceMotion& motion,
                              std::span<const std::uint32_t> triangles) noexcept {
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        const Triangle& t = motion.triangles[triangles[k]];
        const Box end = box_of(corners_of(motion.end, t));
        boxes[static_cast<std::size_t>(When::End)].set(k, end);
        boxes[static_cast<std::size_t>(When::Step)].set(k, united(end, box_of(corners_of(motion.start, t))));
    }
}

void Surroundings::add(List& list, std::uint32_t object, std::span<const std::uint32_t> triangles,
                       const LeafBoxes& boxes) noexcept {
    const Boxes<SweptTree::kMostInLeaf>& step = boxes[static_cast<std::size_t>(When::Step)];
    for (std::size_t first = 0; first < triangles.size(); first += kLanes) {
        const std::size_t here = std::min(kLanes, triangles.size() - first);
        for (std::uint32_t near = meeting(step, first, list.limits) & ((1u << here) - 1u); near != 0;
             near &= near - 1) {
            if (!make_room(list, object)) {
                list.complete = false;
                return;
            }
            const std::size_t k = first + static_cast<std::size_t>(std::countr_zero(near));
            list.triangle[list.count] = triangles[k];
            for (std::size_t when = 0; when < kKinds; ++when) {
                for (std::size_t b = 0; b < 6; ++b) {
                    list.box[when].bound[b][list.count] = boxes[when].bound[b][k];
                }
            }
            list.run[list.run_count - 1].end = ++list.count;
        }
    }
}

bool Surroundings::make_room(List& list, std::uint32_t object) noexcept {
    if (list.run_count == 0 || list.run[list.run_count - 1].object != object) {
        list.count = (list.count + kLanes - 1) / kLanes * kLanes;
        if (list.run_count == kMaxRuns) {
            return false;
        }
        list.run[list.run_count++] = {object, list.count, list.count};
    }
    if (list.count == kMaxListed) {
        return false;
    }
    if (list.count % kLanes == 0) {
        for (Boxes<kMaxListed>& boxes : list.box) {
            for (auto& bound : boxes.bound) {
                std::fill_n(&bound[list.count], kLanes, std::numeric_limits<float>::infinity());
            }
        }
    }
    return true;
}

bool NearSurfaces::is_listed(const Box& box) const noexcept {
    if (list_ == nullptr) {
        return false;
    }
    const Box& all = list_->region;
    return all.low.x <= box.low.x && all.low.y <= box.low.y && all.low.z <= box.low.z && all.high.x >= box.high.x &&
           all.high.y >= box.high.y && all.high.z >= box.high.z;
}

}  // namespace haptic::sim
