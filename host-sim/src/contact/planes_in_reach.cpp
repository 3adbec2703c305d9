#include "haptic/sim/contact/planes_in_reach.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <tuple>

#include "contact/scratch.hpp"
#include "contact/touching.hpp"
#include "contact/triangle_ccd.hpp"

namespace haptic::sim {

namespace {

constexpr std::size_t kMaxCandidates = 32;
constexpr double kSame = 1e-9;  // of the radius

struct Candidate {
    SurfacePlane plane;
    Vec3 point{0.0};   // m, touched point at the end of the step
    double gap = 0.0;  // m, between proxy and plane at the horizon, if the proxy stays
};

/// The candidates that come nearest, in that order.
class Candidates {
  public:
    void insert(const Candidate& c) noexcept {
        const auto rank = [](const Candidate& x) {
            return std::tuple{x.gap, x.plane.touched.object, x.plane.touched.triangle};
        };
        if (count_ == kMaxCandidates) {
            if (rank(list_[count_ - 1]) <= rank(c)) {
                return;
            }
            --count_;
        }
        std::size_t k = count_++;
        for (; k > 0 && rank(c) < rank(list_[k - 1]); --k) {
            list_[k] = list_[k - 1];
        }
        list_[k] = c;
    }
    [[nodiscard]] std::span<const Candidate> list() const noexcept { return {list_.data(), count_}; }

  private:
    Scratch<Candidate, kMaxCandidates> list_;
    std::size_t count_ = 0;
};

/// A triangle as it will go on until the horizon.
MovingTriangle onward_of(const SurfaceMotion& motion, std::uint32_t triangle, double horizon) noexcept {
    const Triangle& t = motion.triangles[triangle];
    const TriangleCorners now = corners_of(motion.end, t);
    const TriangleCorners before = corners_of(motion.start, t);
    return {now,
            {now.a + (now.a - before.a) * horizon, now.b + (now.b - before.b) * horizon,
             now.c + (now.c - before.c) * horizon}};
}

/// Box about a triangle as it goes on.
Box box_of(const MovingTriangle& t) noexcept {
    const auto least = [](const TriangleCorners& x) { return glm::min(x.a, glm::min(x.b, x.c)); };
    const auto most = [](const TriangleCorners& x) { return glm::max(x.a, glm::max(x.b, x.c)); };
    return {glm::min(least(t.start), least(t.end)), glm::max(most(t.start), most(t.end))};
}

/// Whether a box is wholly out of the grown sphere.
bool out_of_reach(const Box& box, const ReachQuery& q) noexcept {
    const Vec3 off = glm::max(glm::max(box.low - q.position, q.position - box.high), Vec3(0.0));
    const double reach = (q.radius + q.reach) * (1.0 + kCreepTolerance);
    return glm::dot(off, off) > reach * reach;
}

/// The triangles of a leaf as they go on; made anew only for another horizon.
class OnwardLeaf {
  public:
    OnwardLeaf(const MovingSurface& surface, std::uint32_t leaf) noexcept
        : motion_(surface.motion),
          vertices_(surface.tree->vertices_of(leaf)),
          triangles_(surface.tree->triangles_of(leaf)) {}

    [[nodiscard]] std::span<const std::uint32_t> triangles() const noexcept { return triangles_; }

    /// Whether all of them are out of the grown sphere.
    [[nodiscard]] bool is_out_of_reach(const ReachQuery& q) noexcept {
        if (q.horizon != box_horizon_) {
            box_horizon_ = q.horizon;
            box_ = {Vec3(std::numeric_limits<double>::infinity()), Vec3(-std::numeric_limits<double>::infinity())};
            for (const std::uint32_t v : vertices_) {
                const Vec3& now = motion_.end[v];
                const Vec3 then = now + (now - motion_.start[v]) * q.horizon;
                box_ = {glm::min(box_.low, glm::min(now, then)), glm::max(box_.high, glm::max(now, then))};
            }
        }
        return out_of_reach(box_, q);
    }
    [[nodiscard]] const MovingTriangle& onward(std::size_t k, const ReachQuery& q) noexcept {
        make(q.horizon);
        return onward_[k];
    }
    [[nodiscard]] const Box& box(std::size_t k, const ReachQuery& q) noexcept {
        make(q.horizon);
        return boxes_[k];
    }

  private:
    void make(double horizon) noexcept {
        if (horizon == horizon_) {
            return;
        }
        horizon_ = horizon;
        for (std::size_t k = 0; k < triangles_.size(); ++k) {
            onward_[k] = onward_of(motion_, triangles_[k], horizon);
            boxes_[k] = box_of(onward_[k]);
        }
    }

    const SurfaceMotion& motion_;
    std::span<const std::uint32_t> vertices_;
    std::span<const std::uint32_t> triangles_;
    double box_horizon_ = -1.0;  // of none
    double horizon_ = -1.0;
    Box box_;
    Scratch<MovingTriangle, SweptTree::kMostInLeaf> onward_;
    Scratch<Box, SweptTree::kMostInLeaf> boxes_;
};

/// Whether a plane keeps the proxy off the whole triangle, now and at the horizon.
bool implied(const SurfacePlane& by, const MovingTriangle& t, const ReachQuery& q) noexcept {
    const auto most = [&](const TriangleCorners& x) {
        return std::max({glm::dot(by.normal, x.a), glm::dot(by.normal, x.b), glm::dot(by.normal, x.c)});
    };
    const double base = by.offset - q.radius + kSame * q.radius;
    return most(t.start) <= base && most(t.end) <= base + by.velocity * q.dt * q.horizon;
}

/// The plane of one triangle, from where the grown sphere first touches it. False if it does not.
bool predict(const MovingSurface& surface, std::uint32_t object, std::uint32_t triangle, const MovingTriangle& onward,
             const ReachQuery& q, Candidate& out) noexcept {
    const TriangleCorners& now = onward.start;
    const TriangleTouch touch = sphere_triangle_ccd(q.position, q.radius + q.reach, onward);
    const double distance = std::sqrt(touch.at.squared_distance);
    if (!touch.touches || distance == 0.0) {
        return false;
    }
    out.point = blend(now, touch.at.weights);
    const Vec3 moved = displacement_of(surface.motion, triangle, touch.at.weights);
    SurfacePlane& plane = out.plane;
    plane.normal = -touch.at.point / distance;
    plane.offset = glm::dot(plane.normal, out.point) + q.radius;
    plane.velocity = glm::dot(plane.normal, moved) / q.dt;
    plane.touched = {object, triangle, touch.at.feature, touch.at.weights};
    out.gap = glm::dot(plane.normal, q.position) - plane.offset - plane.velocity * q.dt * q.horizon;
    return true;
}

/// Whether a plane already keeps the proxy off the candidate's point, now and at the horizon.
bool implied(const SurfacePlane& by, const Candidate& c, const ReachQuery& q,
             std::span<const MovingSurface> surfaces) noexcept {
    const double above = glm::dot(by.normal, c.point) - (by.offset - q.radius);
    const Vec3 moved =
        displacement_of(surfaces[c.plane.touched.object].motion, c.plane.touched.triangle, c.plane.touched.weights);
    const double rising = glm::dot(by.normal, moved) - by.velocity * q.dt;
    return above <= kSame * q.radius && above + rising * q.horizon <= kSame * q.radius;
}

/// Takes what the leaf has for one proxy.
void look_into(OnwardLeaf& leaf, const MovingSurface& surface, std::uint32_t object, const ReachTask& task,
               Candidates& candidates) noexcept {
    const ReachQuery& q = task.query;
    if (leaf.is_out_of_reach(q)) {
        return;
    }
    for (std::size_t k = 0; k < leaf.triangles().size(); ++k) {
        if (out_of_reach(leaf.box(k, q), q)) {
            continue;
        }
        const MovingTriangle& onward = leaf.onward(k, q);
        bool needed = true;
        for (std::uint32_t c = 0; c < task.contacts.count; ++c) {
            needed = needed && !implied(task.contacts.plane[c], onward, q);
        }
        Candidate candidate;
        if (needed && predict(surface, object, leaf.triangles()[k], onward, q, candidate)) {
            candidates.insert(candidate);
        }
    }
}

/// The contacts and, of the others, those that come nearest and are not implied by what there is already.
SurfacePlanes choose(std::span<const MovingSurface> surfaces, const ReachTask& task,
                     std::span<const Candidate> candidates) noexcept {
    SurfacePlanes planes = task.contacts;
    for (const Candidate& c : candidates) {
        if (planes.count == kMaxSurfacePlanes) {
            break;
        }
        bool needed = true;
        for (std::uint32_t k = 0; k < planes.count; ++k) {
            needed = needed && !implied(planes.plane[k], c, task.query, surfaces);
        }
        if (needed) {
            planes.plane[planes.count++] = c.plane;
        }
    }
    return planes;
}

/// What moves by d within the horizon reaches the box from a place that is -d away from it.
Box box_around(const ReachQuery& q, const Box& displacement) noexcept {
    Box box = box_about(q.position, q.position, q.radius + q.reach);
    box.low -= glm::max(displacement.high, Vec3(0.0)) * q.horizon;
    box.high -= glm::min(displacement.low, Vec3(0.0)) * q.horizon;
    return box;
}

/// As many as one walk takes along.
template <std::size_t Most>
void find_planes(std::span<const MovingSurface> surfaces, std::span<ReachTask> tasks) noexcept {
    std::array<Candidates, Most> candidates;
    Scratch<Box, Most> boxes;
    std::array<std::size_t, Most> who{};
    std::size_t count = 0;
    for (std::size_t k = 0; k < tasks.size(); ++k) {
        if (tasks[k].contacts.count < kMaxSurfacePlanes) {
            who[count++] = k;
        }
    }
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SweptTree& tree = *surfaces[object].tree;
        for (std::size_t k = 0; k < count; ++k) {
            boxes[k] = box_around(tasks[who[k]].query, tree.displacement());
        }
        tree.walk({boxes.data(), count}, [&](std::uint32_t index, std::uint64_t near) {
            OnwardLeaf leaf(surfaces[object], index);
            for (; near != 0; near &= near - 1) {
                const auto k = static_cast<std::size_t>(std::countr_zero(near));
                look_into(leaf, surfaces[object], object, tasks[who[k]], candidates[k]);
            }
        });
    }
    for (ReachTask& task : tasks) {
        task.planes = task.contacts;
    }
    for (std::size_t k = 0; k < count; ++k) {
        tasks[who[k]].planes = choose(surfaces, tasks[who[k]], candidates[k].list());
    }
}

}  // namespace

SurfacePlanes planes_in_reach(const NearSurfaces& surfaces, const SurfacePlanes& contacts,
                              const ReachQuery& query) noexcept {
    ReachTask task{contacts, query, {}};
    find_planes<1>(surfaces.all(), {&task, 1});
    return task.planes;
}

void planes_in_reach(std::span<const MovingSurface> surfaces, std::span<ReachTask> tasks) noexcept {
    constexpr std::size_t most = Surroundings::kMaxProxies;
    for (std::size_t first = 0; first < tasks.size(); first += most) {
        find_planes<most>(surfaces, tasks.subspan(first, std::min(most, tasks.size() - first)));
    }
}

}  // namespace haptic::sim
