#include "contact/speculative_planes.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tuple>

#include "contact/contact_points.hpp"
#include "contact/leaf_boxes.hpp"
#include "contact/scratch.hpp"
#include "contact/triangle_ccd.hpp"

namespace haptic::sim {

namespace {

constexpr std::size_t kMaxCandidates = 32;
constexpr double kImpliedTolerance = 1e-9;  // of the radius

/// A plane that may become a contact, with its urgency.
struct Candidate {
    SurfacePlane plane;
    Vec3 point{0.0};         // m, contact point at the end of the step
    Vec3 displacement{0.0};  // m, of that point over the step
    double gap = 0.0;        // m, between proxy and plane at the horizon, if the proxy rests
};

/// The kMaxCandidates candidates that come nearest, by gap. Ties are broken by index, so that the result does not
/// depend on the order of the query. Candidates are written in place and sorted by place: one has some 170 bytes.
class Candidates {
  public:
    /// Where to write the next candidate, each of its members.
    [[nodiscard]] Candidate& next() noexcept { return stored_[next_]; }

    /// Keeps the candidate in next(), if it is near enough.
    void keep_next() noexcept {
        const auto rank = [](const Candidate& x) {
            return std::tuple{x.gap, x.plane.touched.object, x.plane.touched.triangle};
        };
        const std::uint8_t place = next_;
        const Candidate& c = stored_[place];
        if (count_ < kMaxCandidates) {
            next_ = static_cast<std::uint8_t>(count_ + 1);
        } else {
            // Full: it replaces the last, if it comes nearer.
            const std::uint8_t last = order_[count_ - 1];
            if (rank(stored_[last]) <= rank(c)) {
                return;
            }
            next_ = last;
            --count_;
        }
        // Insertion sort.
        std::size_t k = count_++;
        for (; k > 0 && rank(c) < rank(stored_[order_[k - 1]]); --k) {
            order_[k] = order_[k - 1];
        }
        order_[k] = place;
    }
    [[nodiscard]] std::size_t size() const noexcept { return count_; }
    /// Nearest first.
    [[nodiscard]] const Candidate& operator[](std::size_t k) const noexcept { return stored_[order_[k]]; }

  private:
    Scratch<Candidate, kMaxCandidates + 1> stored_;
    Scratch<std::uint8_t, kMaxCandidates> order_;  // places in stored_, nearest first
    std::size_t count_ = 0;
    std::uint8_t next_ = 0;  // a free place in stored_
};

/// Motion of a triangle from the end of the step to the horizon, at its present velocity.
MovingTriangle extrapolate(const SurfaceMotion& motion, std::uint32_t triangle, double horizon) noexcept {
    const Triangle& t = motion.triangles[triangle];
    const TriangleCorners now = corners_of(motion.end, t);
    const TriangleCorners before = corners_of(motion.start, t);
    return {now,
            {now.a + (now.a - before.a) * horizon, now.b + (now.b - before.b) * horizon,
             now.c + (now.c - before.c) * horizon}};
}

/// Radius beyond which the CCD never reports a triangle, m.
double grown_radius(const SpeculativeQuery& q) noexcept {
    return (q.radius + q.reach) * (1.0 + kCreepTolerance);
}

/// Centres at which the grown sphere would touch a surface as it is at the end of the step, instead of moving on by any
/// of its displacements.
Aabb displaced_centers(const SpeculativeQuery& q, const Aabb& displacement) noexcept {
    return {q.position - glm::max(displacement.max, Vec3(0.0)) * q.horizon,
            q.position - glm::min(displacement.min, Vec3(0.0)) * q.horizon};
}

/// Whether a plane separates the whole triangle from the proxy, now and at the horizon.
bool implies(const SurfacePlane& plane, const MovingTriangle& t, const SpeculativeQuery& q) noexcept {
    const auto max_height = [&](const TriangleCorners& x) {
        return std::max({glm::dot(plane.normal, x.a), glm::dot(plane.normal, x.b), glm::dot(plane.normal, x.c)});
    };
    const double base = plane.offset - q.radius + kImpliedTolerance * q.radius;
    return max_height(t.start) <= base && max_height(t.end) <= base + plane.velocity * q.dt * q.horizon;
}

/// Plane of one triangle, where the grown sphere first touches it. False if it does not.
bool predict_plane(const MovingSurface& surface, std::uint32_t object, std::uint32_t triangle,
                   const MovingTriangle& extrapolated, const SpeculativeQuery& q, Candidate& out) noexcept {
    const TriangleCorners& now = extrapolated.start;
    // Half-CCD of the grown sphere at rest against the extrapolated triangle.
    const TriangleTouch touch = sphere_triangle_ccd(q.position, q.radius + q.reach, extrapolated);
    const double distance = std::sqrt(touch.at.squared_distance);
    if (!touch.touches || distance == 0.0) {
        return false;
    }
    // Plane through the contact point, with the normal at the predicted contact and the present velocity along it.
    out.point = blend(now, touch.at.weights);
    out.displacement = displacement_of(surface.motion, triangle, touch.at.weights);
    SurfacePlane& plane = out.plane;
    plane.normal = -touch.at.point / distance;
    plane.offset = glm::dot(plane.normal, out.point) + q.radius;
    plane.velocity = glm::dot(plane.normal, out.displacement) / q.dt;
    plane.touched = {object, triangle, touch.at.feature, touch.at.weights};
    out.gap = glm::dot(plane.normal, q.position) - plane.offset - plane.velocity * q.dt * q.horizon;
    return true;
}

/// Whether a plane already separates the candidate's point from the proxy, now and at the horizon.
bool implies(const SurfacePlane& plane, const Candidate& c, const SpeculativeQuery& q) noexcept {
    const double above = glm::dot(plane.normal, c.point) - (plane.offset - q.radius);
    const double rising = glm::dot(plane.normal, c.displacement) - plane.velocity * q.dt;
    return above <= kImpliedTolerance * q.radius && above + rising * q.horizon <= kImpliedTolerance * q.radius;
}

/// Adds the candidates of one leaf for one proxy.
void add_candidates(const LeafBoxes& boxes, std::uint32_t leaf, const MovingSurface& surface, std::uint32_t object,
                    const SpeculativeTask& task, const SphereLimits& limits, Candidates& candidates) noexcept {
    const SpeculativeQuery& q = task.query;
    const std::span<const SurfacePlane> contacts(task.contacts.plane.data(), task.contacts.count);
    const std::span<const std::uint32_t> triangles = surface.tree->triangles_of(leaf);
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        // Cull by the box at the end of the step and the displacements of the whole surface.
        if (!limits.overlap(boxes.at(QueryTime::EndOfStep, k))) {
            continue;
        }
        // Skip triangles behind the active contacts.
        const MovingTriangle extrapolated = extrapolate(surface.motion, triangles[k], q.horizon);
        if (std::any_of(contacts.begin(), contacts.end(),
                        [&](const SurfacePlane& plane) { return implies(plane, extrapolated, q); })) {
            continue;
        }
        if (predict_plane(surface, object, triangles[k], extrapolated, q, candidates.next())) {
            candidates.keep_next();
        }
    }
}

/// The active contacts, then the nearest candidates that no chosen plane implies.
SurfacePlanes select_planes(const SpeculativeTask& task, const Candidates& candidates) noexcept {
    SurfacePlanes planes = task.contacts;
    for (std::size_t n = 0; n < candidates.size(); ++n) {
        const Candidate& c = candidates[n];
        // Candidates come nearest first, so each new plane is tested against all more urgent ones.
        if (planes.count == kMaxSurfacePlanes) {
            break;
        }
        bool needed = true;
        for (std::uint32_t k = 0; k < planes.count; ++k) {
            needed = needed && !implies(planes.plane[k], c, task.query);
        }
        if (needed) {
            planes.plane[planes.count++] = c.plane;
        }
    }
    return planes;
}

/// One batch: at most `Capacity` proxies share a traversal.
template <std::size_t Capacity>
void find_planes(std::span<const MovingSurface> surfaces, std::span<SpeculativeTask> tasks) noexcept {
    std::array<Candidates, Capacity> candidates;
    Scratch<Aabb, Capacity> regions;
    Scratch<SphereLimits, Capacity> limits;
    std::array<std::size_t, Capacity> active{};
    std::size_t count = 0;
    // Proxies with three active contacts have no plane left to fill.
    for (std::size_t k = 0; k < tasks.size(); ++k) {
        if (tasks[k].contacts.count < kMaxSurfacePlanes) {
            active[count++] = k;
        }
    }
    // One traversal of each tree finds the leaves near any proxy. A tree's boxes hold the surface during the step, and
    // it moves on by displacement * horizon: so the spheres are displaced against that direction.
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SweptTree& tree = *surfaces[object].tree;
        for (std::size_t k = 0; k < count; ++k) {
            const SpeculativeQuery& q = tasks[active[k]].query;
            const Aabb centers = displaced_centers(q, tree.displacement());
            regions[k] = {centers.min - Vec3(q.radius + q.reach), centers.max + Vec3(q.radius + q.reach)};
            limits[k] = SphereLimits(centers, grown_radius(q));
        }
        tree.query_leaves({regions.data(), count}, [&](std::uint32_t leaf, std::uint64_t mask) {
            const LeafBoxes boxes(surfaces[object], leaf, QueryTime::EndOfStep);
            for (; mask != 0; mask &= mask - 1) {
                const auto k = static_cast<std::size_t>(std::countr_zero(mask));
                add_candidates(boxes, leaf, surfaces[object], object, tasks[active[k]], limits[k], candidates[k]);
            }
        });
    }
    // Select from the candidates of each proxy.
    for (SpeculativeTask& task : tasks) {
        task.planes = task.contacts;
    }
    for (std::size_t k = 0; k < count; ++k) {
        tasks[active[k]].planes = select_planes(tasks[active[k]], candidates[k]);
    }
}

}  // namespace

SurfacePlanes speculative_planes(const NearSurfaces& surfaces, const SurfacePlanes& contacts,
                                 const SpeculativeQuery& query) noexcept {
    SpeculativeTask task{contacts, query, {}};
    find_planes<1>(surfaces.all(), {&task, 1});
    return task.planes;
}

void speculative_planes(std::span<const MovingSurface> surfaces, std::span<SpeculativeTask> tasks) noexcept {
    constexpr std::size_t capacity = ContactCandidates::kMaxProxies;
    for (std::size_t first = 0; first < tasks.size(); first += capacity) {
        find_planes<capacity>(surfaces, tasks.subspan(first, std::min(capacity, tasks.size() - first)));
    }
}

}  // namespace haptic::sim
