#include "haptic/sim/contact/virtual_proxy.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "contact/hold.hpp"

namespace haptic::sim {

namespace {

constexpr int kPatience = 8;         // iterations that must bring the proxy nearer
constexpr double kProgress = 1e-4;   // of the radius, by this much
constexpr double kWidestTurn = 0.5;  // cosine: a proxy rolls about an edge or a corner by at most 60 degrees at once
// Of the radius: a chord so short cuts 8e-4 of the radius off what is round, less than the shrink leaves.
constexpr double kShort = 0.08;
// Radii, above touching_reach(): what is so near is to be met next. Planes of what is not touched hold it no less: none
// can hold the proxy where it ends but those that touch it there.
constexpr double kLookAhead = 1.02;
constexpr int kSettlings = 24;    // exchanges of planes on a short move
constexpr double kSurest = 0.95;  // of a change that the next one keeps: above, where it leads is not known

double distance2(const Vec3& a, const Vec3& b) noexcept {
    return glm::dot(a - b, a - b);
}

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
            hold_.look(surfaces_, position_, goal_, radius_, kLookAhead * radius_);
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
                walk(room.any ? settled(room) - position_ : move, room.radius);
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
        go_to(position_ + move * free);
        return free >= 1.0;
    }

    void go_to(const Vec3& place) noexcept {
        position_ = place;
        if (path_ != nullptr) {
            path_->append(1.0, position_);
        }
    }

    /// About an edge or a corner that alone holds the proxy, to where the goal is nearest, in two straight moves that
    /// stay outside: to where the tangent planes at both ends meet, and on. Tangent planes alone would get there too,
    /// but the slower the deeper the goal is inside.
    bool roll(const PlaneSet::Room& room) noexcept {
        if (room.at.active_count != 1 || room.radius < radius_) {
            return false;
        }
        const Touching& t = hold_.points()[room.at.active[0]];
        if (!is_round(t)) {
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
        const Vec3 corner = pivot + (n + t.normal) * (radius_ / (1.0 + turn));
        const Vec3 end = pivot + n * radius_;
        if (turn < kWidestTurn || !is_clear(corner, t) || !is_clear(end, t)) {
            return false;
        }
        if (walk(corner - position_, radius_)) {
            walk(end - position_, radius_);
        }
        return true;
    }

    /// Whether nothing else of what is touched here stops the sphere on a straight way to a place.
    [[nodiscard]] bool is_clear(const Vec3& place, const Touching& but) const noexcept {
        for (const Touching& t : hold_.points()) {
            if (&t != &but && glm::dot(t.normal, place - t.point) < std::min(radius_, t.distance) * settings_.shrink) {
                return false;
            }
        }
        return true;
    }

    /// The place that the room names, but with the tangent planes of edges and corners as they are there, not as they
    /// are here, as far as a straight way may lead. Where several things hold the proxy, tangent planes of where it is
    /// would get it there by a part of the way each time. Planes are exchanged until the place stays; every other
    /// change is extrapolated (Aitken).
    [[nodiscard]] Vec3 settled(const PlaneSet::Room& room) const noexcept {
        Vec3 at = room.at.point;
        if (!is_held_by_round(room) || !is_short(at)) {
            return at;
        }
        Vec3 from = at;
        Vec3 last(0.0);
        for (int k = 0; k < kSettlings; ++k) {
            const Projection next = planes_at(from).project(goal_, radius_);
            if (!next.feasible || !is_short(next.point)) {
                break;
            }
            at = next.point;
            const Vec3 change = at - from;
            if (glm::dot(change, change) <= 0.01 * kArrived * kArrived * radius_ * radius_) {
                break;
            }
            const double share = glm::dot(change, last) / glm::dot(last, last);
            const bool leaps = k % 2 == 1 && share > 0.0 && share < kSurest;
            from = leaps ? at + change * (share / (1.0 - share)) : at;
            last = change;
        }
        return at;
    }

    [[nodiscard]] static bool is_round(const Touching& t) noexcept {
        return t.at.feature == Feature::Edge || t.at.feature == Feature::Vertex;
    }

    /// Whether several things hold the whole sphere there, an edge or a corner among them.
    [[nodiscard]] bool is_held_by_round(const PlaneSet::Room& room) const noexcept {
        bool round = false;
        for (std::uint32_t k = 0; k < room.at.active_count; ++k) {
            round = round || is_round(hold_.points()[room.at.active[k]]);
        }
        return round && room.at.active_count > 1 && room.radius >= radius_;
    }

    /// The planes of all that is touched, as the features lie to a place nearby.
    [[nodiscard]] PlaneSet planes_at(const Vec3& place) const noexcept {
        PlaneSet planes;
        for (const Touching& t : hold_.points()) {
            const bool round = is_round(t);
            const Vec3 point = round ? nearest_of_feature(surfaces_, t, place) : t.point;
            const double apart = std::sqrt(distance2(place, point));
            const Vec3 normal = round && apart > 0.0 ? (place - point) / apart : t.normal;
            planes.add(normal, glm::dot(normal, point));
        }
        return planes;
    }

    [[nodiscard]] bool is_short(const Vec3& place) const noexcept {
        return distance2(place, position_) <= kShort * kShort * radius_ * radius_;
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
