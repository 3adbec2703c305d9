#include "contact/virtual_proxy.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "contact/hold.hpp"

namespace haptic::sim {

namespace {

constexpr int kPatience = 8;         // iterations that must bring the proxy nearer
constexpr double kProgress = 1e-4;   // of the radius, by this much
constexpr double kWidestTurn = 0.5;  // cosine: a proxy rolls about an edge or a corner by at most 60 degrees at once

/// The nearest point to `goal` of the edge or corner that is touched.
Vec3 nearest_of_feature(const NearSurfaces& surfaces, const Touching& t, const Vec3& goal) noexcept {
    if (t.at.feature == Feature::Vertex) {
        return t.point;
    }
    const SurfaceMotion& motion = surfaces[t.object].motion;
    const Triangle& corners = motion.triangles[t.triangle];
    const Vec3& p = motion.end[corners[t.at.index]];
    const Vec3 e = motion.end[corners[(t.at.index + 1u) % 3u]] - p;
    const double ee = glm::dot(e, e);
    return ee > 0.0 ? p + e * std::clamp(glm::dot(goal - p, e) / ee, 0.0, 1.0) : p;
}

/// A proxy on its way to the goal.
class Walker {
  public:
    Walker(const NearSurfaces& surfaces, const Vec3& from, const Vec3& goal, double radius,
           const ContactSettings& settings, ProxyPath* path)
        : surfaces_(surfaces), settings_(settings), goal_(goal), radius_(radius), position_(from), path_(path) {}

    ProxyMove run(double dt) noexcept {
        ProxyMove result;
        for (;; ++result.iterations) {
            hold_.look(surfaces_, position_, goal_, radius_, settings_);
            const PlaneSet::Room& room = hold_.room();
            const Vec3 move = room.any ? room.at.point - position_ : Vec3(0.0);
            const bool arrived =
                glm::dot(move, move) <= kArrived * kArrived * radius_ * radius_ || stalls(result.iterations);
            if (arrived || result.iterations >= settings_.max_proxy_moves) {
                result.converged = arrived;
                result.position = position_;
                result.contacts = hold_.planes(surfaces_, dt);
                return result;
            }
            if (!roll(room)) {
                walk(move, room.radius);
            }
        }
    }

  private:
    /// Between curved features the proxy may swing by a part of the shrink for ever, and come no nearer.
    bool stalls(int iteration) noexcept {
        if (iteration % kPatience != 0) {
            return false;
        }
        const Vec3 left = goal_ - position_;
        const double distance = std::sqrt(glm::dot(left, left));
        const bool stalled = iteration > 0 && distance > last_distance_ - kProgress * radius_;
        last_distance_ = distance;
        return stalled;
    }

    /// Straight on as far as nothing is in the way of as much of the sphere as there is room for here. True if it came
    /// all the way.
    bool walk(const Vec3& move, double room) noexcept {
        const double free = free_fraction(surfaces_, position_, move, room * settings_.shrink, settings_.shrink);
        position_ += move * free;
        if (path_ != nullptr) {
            path_->append(1.0, position_);
        }
        return free >= 1.0;
    }

    /// About an edge or a corner that alone holds the proxy, to where the goal is nearest, in two straight moves that
    /// stay outside: to where the tangent planes at both ends meet, and on. Tangent planes alone would get there too,
    /// but the slower the deeper the goal is inside.
    bool roll(const PlaneSet::Room& room) noexcept {
        if (room.at.active_count != 1 || room.radius < radius_) {
            return false;
        }
        const Touching& t = hold_.points()[room.at.active[0]];
        if (t.at.feature != Feature::Edge && t.at.feature != Feature::Vertex) {
            return false;
        }
        const Vec3 pivot = nearest_of_feature(surfaces_, t, goal_);
        const Vec3 inward = goal_ - pivot;
        const double depth = std::sqrt(glm::dot(inward, inward));
        if (!(depth > kArrived * radius_) || depth >= radius_) {
            return false;  // the goal is right on the feature, or can be reached past it
        }
        const Vec3 n = inward / depth;
        const double turn = glm::dot(n, t.normal);
        if (turn < kWidestTurn) {
            return false;
        }
        const Vec3 corner = pivot + (n + t.normal) * (radius_ / (1.0 + turn));
        if (walk(corner - position_, radius_)) {
            walk(pivot + n * radius_ - position_, radius_);
        }
        return true;
    }

    NearSurfaces surfaces_;
    const ContactSettings& settings_;
    Vec3 goal_;
    double radius_;
    Vec3 position_;
    ProxyPath* path_;
    double last_distance_ = 0.0;  // m, to the goal, kPatience iterations ago
    Hold hold_;
};

}  // namespace

ProxyMove move_proxy(const NearSurfaces& surfaces, const Vec3& from, const Vec3& goal, double radius, double dt,
                     const ContactSettings& settings, ProxyPath* path) noexcept {
    return Walker(surfaces, from, goal, radius, settings, path).run(dt);
}

}  // namespace haptic::sim
