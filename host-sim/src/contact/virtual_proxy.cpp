#include "contact/virtual_proxy.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "contact/active_contacts.hpp"

namespace haptic::sim {

namespace {

constexpr int kStallInterval = 8;       // iterations within which the proxy must make progress
constexpr double kMinProgress = 1e-4;   // of the radius: progress toward the goal within that interval
constexpr double kMinRollCosine = 0.5;  // one move rolls about an edge or a vertex by at most 60 degrees

/// Point of the touched edge or vertex that is nearest to `goal`.
Vec3 closest_point_on_feature(const NearSurfaces& surfaces, const ContactPoint& t, const Vec3& goal) noexcept {
    if (t.at.feature == Feature::Vertex) {
        return t.point;
    }
    // Edge: project the goal onto the segment and clamp.
    const SurfaceMotion& motion = surfaces[t.object].motion;
    const Triangle& corners = motion.triangles[t.triangle];
    const Vec3& p = motion.end[corners[t.at.index]];
    const Vec3 e = motion.end[corners[(t.at.index + 1u) % 3u]] - p;
    const double ee = glm::dot(e, e);
    return ee > 0.0 ? p + e * std::clamp(glm::dot(goal - p, e) / ee, 0.0, 1.0) : p;
}

/// Iterative search for the local minimum of the distance to the goal (thesis 4.1.1).
class ProxyMover {
  public:
    ProxyMover(const NearSurfaces& surfaces, const Vec3& from, const Vec3& goal, double radius,
               const ContactSettings& settings, ProxyPath* path)
        : surfaces_(surfaces), settings_(settings), goal_(goal), radius_(radius), position_(from), path_(path) {}

    ProxyMove run(double dt) noexcept {
        ProxyMove result;
        for (;; ++result.iterations) {
            // Sub-goal: nearest point to the goal outside all touched planes.
            active_contacts_.update(surfaces_, position_, goal_, radius_, settings_);
            const PlaneSet::Fit& fit = active_contacts_.fit();
            const Vec3 move = fit.feasible ? fit.projection.point - position_ : Vec3(0.0);
            // Stop at the minimum, or where no progress is made.
            const bool arrived =
                glm::dot(move, move) <= kMinMove * kMinMove * radius_ * radius_ || has_stalled(result.iterations);
            if (arrived || result.iterations >= settings_.max_proxy_moves) {
                result.converged = arrived;
                result.position = position_;
                result.contacts = active_contacts_.planes(surfaces_, dt);
                return result;
            }
            // One contact with an edge or a vertex: roll about it. Otherwise move straight to the sub-goal.
            if (!roll_around_feature(fit)) {
                advance_straight(move, fit.radius);
            }
        }
    }

  private:
    /// Whether the last kStallInterval iterations brought no progress. Between curved features the proxy may oscillate
    /// forever by a fraction of the shrink.
    bool has_stalled(int iteration) noexcept {
        if (iteration % kStallInterval != 0) {
            return false;
        }
        const Vec3 remaining = goal_ - position_;
        const double distance = std::sqrt(glm::dot(remaining, remaining));
        const bool stalled = iteration > 0 && distance > last_distance_ - kMinProgress * radius_;
        last_distance_ = distance;
        return stalled;
    }

    /// Moves along a straight line until the sphere of the available radius, shrunk, touches. True if it covers the
    /// whole move.
    bool advance_straight(const Vec3& move, double available_radius) noexcept {
        const double free =
            free_fraction(surfaces_, position_, move, available_radius * settings_.shrink, settings_.shrink);
        position_ += move * free;
        if (path_ != nullptr) {
            path_->append(1.0, position_);
        }
        return free >= 1.0;
    }

    /// Rolls about an edge or a vertex that is the only active contact, to the point of the C-obstacle nearest to the
    /// goal. Two straight moves stay outside of it: to the intersection of the tangent planes at both ends, then to the
    /// end. Moves along one tangent plane at a time would converge too, but more slowly the deeper the goal lies
    /// inside.
    bool roll_around_feature(const PlaneSet::Fit& fit) noexcept {
        if (fit.projection.active_count != 1 || fit.radius < radius_) {
            return false;
        }
        const ContactPoint& t = active_contacts_.points()[fit.projection.active[0]];
        if (t.at.feature != Feature::Edge && t.at.feature != Feature::Vertex) {
            return false;
        }
        // End of the roll: pivot + radius * n, with n from the feature toward the goal.
        const Vec3 pivot = closest_point_on_feature(surfaces_, t, goal_);
        const Vec3 inward = goal_ - pivot;
        const double depth = std::sqrt(glm::dot(inward, inward));
        if (!(depth > kMinMove * radius_) || depth >= radius_) {
            return false;  // the goal is on the feature, or clear of it
        }
        const Vec3 n = inward / depth;
        // A wide roll is left to the tangent plane: the two planes would meet far away.
        const double roll_cosine = glm::dot(n, t.normal);
        if (roll_cosine < kMinRollCosine) {
            return false;
        }
        // Intersection of the tangent planes with normals t.normal and n.
        const Vec3 corner = pivot + (n + t.normal) * (radius_ / (1.0 + roll_cosine));
        if (advance_straight(corner - position_, radius_)) {
            advance_straight(pivot + n * radius_ - position_, radius_);
        }
        return true;
    }

    NearSurfaces surfaces_;
    const ContactSettings& settings_;
    Vec3 goal_;
    double radius_;
    Vec3 position_;
    ProxyPath* path_;
    double last_distance_ = 0.0;  // m, to the goal, kStallInterval iterations ago
    ActiveContacts active_contacts_;
};

/// The move where no surface is near the whole path: without a query. False, with `result` unchanged, where a surface
/// may be near.
bool move_through_free_air(const NearSurfaces& surfaces, const Vec3& from, const Vec3& goal, double radius,
                           const ContactSettings& settings, ProxyPath* path, ProxyMove& result) noexcept {
    const Vec3 move = goal - from;
    const Vec3 to = from + move;
    // Every query of the move lies in this box: the sweep's radius is less than the reach of contacts.
    if (!surfaces.is_clear(aabb_of_segment(from, to, contact_reach(radius, settings)))) {
        return false;
    }
    // Without planes the sub-goal is the goal itself.
    const auto arrived = [&](const Vec3& left) {
        return glm::dot(left, left) <= kMinMove * kMinMove * radius * radius;
    };
    if (arrived(move)) {
        result.position = from;
        return true;
    }
    // Far from the origin of coordinates rounding may leave a rest, for which the iteration is needed.
    if (!arrived(goal - to)) {
        return false;
    }
    result.position = to;
    result.iterations = 1;
    if (path != nullptr) {
        path->append(1.0, to);
    }
    return true;
}

}  // namespace

ProxyMove move_proxy(const NearSurfaces& surfaces, const Vec3& from, const Vec3& goal, double radius, double dt,
                     const ContactSettings& settings, ProxyPath* path) noexcept {
    ProxyMove free;
    if (move_through_free_air(surfaces, from, goal, radius, settings, path, free)) {
        return free;
    }
    return ProxyMover(surfaces, from, goal, radius, settings, path).run(dt);
}

}  // namespace haptic::sim
