#include "haptic/sim/contact/planes_in_reach.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tuple>

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
    std::array<Candidate, kMaxCandidates> list_;
    std::size_t count_ = 0;
};

/// The plane of one triangle, from where the grown sphere first touches it. False if it does not.
bool predict(const MovingSurface& surface, std::uint32_t object, std::uint32_t triangle, const ReachQuery& q,
             Candidate& out) noexcept {
    const Triangle& t = surface.motion.triangles[triangle];
    const auto start = surface.motion.start;
    const auto end = surface.motion.end;
    const TriangleCorners now = corners_of(end, t);
    const MovingTriangle onward{
        now,
        {now.a + (end[t[0]] - start[t[0]]) * q.horizon, now.b + (end[t[1]] - start[t[1]]) * q.horizon,
         now.c + (end[t[2]] - start[t[2]]) * q.horizon}};
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

}  // namespace

SurfacePlanes planes_in_reach(std::span<const MovingSurface> surfaces, const SurfacePlanes& contacts,
                              const ReachQuery& q) noexcept {
    Candidates candidates;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        // What moves by d within the horizon reaches the box from a place that is -d away from it.
        Box box = box_about(q.position, q.position, q.radius + q.reach);
        const Box& d = surfaces[object].tree->displacement();
        box.low -= glm::max(d.high, Vec3(0.0)) * q.horizon;
        box.high -= glm::min(d.low, Vec3(0.0)) * q.horizon;
        surfaces[object].tree->query(box, [&](std::uint32_t triangle) {
            Candidate candidate;
            if (predict(surfaces[object], object, triangle, q, candidate)) {
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
