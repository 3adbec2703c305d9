#include "haptic/sim/contact/planes_in_reach.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tuple>

#include "contact/scratch.hpp"
#include "contact/touching.hpp"
#include "haptic/sim/contact/triangle_ccd.hpp"

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

/// Whether the box about the motion is wholly out of the grown sphere.
bool out_of_reach(const MovingTriangle& t, const ReachQuery& q) noexcept {
    const auto least = [](const TriangleCorners& x) { return glm::min(x.a, glm::min(x.b, x.c)); };
    const auto most = [](const TriangleCorners& x) { return glm::max(x.a, glm::max(x.b, x.c)); };
    const Vec3 low = glm::min(least(t.start), least(t.end));
    const Vec3 high = glm::max(most(t.start), most(t.end));
    const Vec3 off = glm::max(glm::max(low - q.position, q.position - high), Vec3(0.0));
    const double reach = (q.radius + q.reach) * (1.0 + kCreepTolerance);
    return glm::dot(off, off) > reach * reach;
}

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
bool implied(const SurfacePlane& by, const Candidate& c, const ReachQuery& q, const NearSurfaces& surfaces) noexcept {
    const double above = glm::dot(by.normal, c.point) - (by.offset - q.radius);
    const Vec3 moved =
        displacement_of(surfaces[c.plane.touched.object].motion, c.plane.touched.triangle, c.plane.touched.weights);
    const double rising = glm::dot(by.normal, moved) - by.velocity * q.dt;
    return above <= kSame * q.radius && above + rising * q.horizon <= kSame * q.radius;
}

}  // namespace

SurfacePlanes planes_in_reach(const NearSurfaces& surfaces, const SurfacePlanes& contacts,
                              const ReachQuery& q) noexcept {
    if (contacts.count == kMaxSurfacePlanes) {
        return contacts;
    }
    Candidates candidates;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        // What moves by d within the horizon reaches the box from a place that is -d away from it.
        Box box = box_about(q.position, q.position, q.radius + q.reach);
        const Box& d = surfaces[object].tree->displacement();
        box.low -= glm::max(d.high, Vec3(0.0)) * q.horizon;
        box.high -= glm::min(d.low, Vec3(0.0)) * q.horizon;
        surfaces[object].tree->query(box, [&](std::uint32_t triangle) {
            const MovingTriangle onward = onward_of(surfaces[object].motion, triangle, q.horizon);
            if (out_of_reach(onward, q)) {
                return;
            }
            for (std::uint32_t k = 0; k < contacts.count; ++k) {
                if (implied(contacts.plane[k], onward, q)) {
                    return;
                }
            }
            Candidate candidate;
            if (predict(surfaces[object], object, triangle, onward, q, candidate)) {
                candidates.insert(candidate);
            }
        });
    }
    SurfacePlanes planes = contacts;
    for (const Candidate& c : candidates.list()) {
        if (planes.count == kMaxSurfacePlanes) {
            break;
        }
        bool needed = true;
        for (std::uint32_t k = 0; k < planes.count; ++k) {
            needed = needed && !implied(planes.plane[k], c, q, surfaces);
        }
        if (needed) {
            planes.plane[planes.count++] = c.plane;
        }
    }
    return planes;
}

}  // namespace haptic::sim
