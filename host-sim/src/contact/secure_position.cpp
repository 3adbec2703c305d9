#include "contact/secure_position.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "contact/touching.hpp"
#include "contact/thesis/thesis_ccd.hpp"
#include "contact/triangle_ccd.hpp"

namespace haptic::sim {

namespace {

constexpr double kLeastRoom = 0.02;     // of the radius: with less between surfaces the centre is pinched
constexpr double kPinched = 1.05;       // of the least room: nearer than this there is none to lose
constexpr double kLeastStep = 1e-6;     // of the step: a ride shorter than this leads nowhere
constexpr int kHalvings = 6;            // of a ride, until it is short enough
constexpr int kExactRides = 3;          // before what clips the sphere may come nearer
constexpr double kPassing = 0.9;        // of its distance, by this much
constexpr double kLateRelease = 0.5;    // and by this much when rides run short
constexpr double kLateShrink = 0.7;     // of the sphere for each of these rides
constexpr double kSharpestTurn = 0.25;  // cosine: a surface that turns further is followed in parts

/// An orthonormal frame that turns with a triangle; its first axis is the touched edge. Zero where degenerate.
struct Frame {
    Vec3 along{0.0};
    Vec3 up{0.0};
    Vec3 side{0.0};
    bool good = false;
};

Frame frame_of(const TriangleCorners& t, const ClosestPoint& at) noexcept {
    Vec3 e = t.b - t.a;
    if (at.feature == Feature::Edge && at.index == 1) {
        e = t.c - t.b;
    } else if (at.feature == Feature::Edge && at.index == 2) {
        e = t.a - t.c;
    }
    const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
    const double ee = glm::dot(e, e);
    const double nn = glm::dot(n, n);
    Frame frame;
    // Below this share the triangle is a needle, whose normal says nothing.
    if (nn > 1e-12 * ee * glm::dot(t.c - t.a, t.c - t.a) && ee > 0.0) {
        frame.along = e / std::sqrt(ee);
        frame.up = n / std::sqrt(nn);
        frame.side = glm::cross(frame.up, frame.along);
        frame.good = true;
    }
    return frame;
}

/// A touched point and its direction at a later time, both taken along by the triangle's motion.
struct Carried {
    Vec3 point{0.0};
    Vec3 normal{0.0};
};

Carried carry(const SurfaceMotion& motion, const Touching& t, double now, double then) noexcept {
    const TriangleCorners at_then = corners_of(motion, t.triangle, then);
    Carried carried{blend(at_then, t.at.weights), t.normal};
    const Frame from = frame_of(corners_of(motion, t.triangle, now), t.at);
    const Frame to = frame_of(at_then, t.at);
    if (from.good && to.good) {
        const Vec3 n = to.along * glm::dot(from.along, t.normal) + to.up * glm::dot(from.up, t.normal) +
                       to.side * glm::dot(from.side, t.normal);
        const double length = std::sqrt(glm::dot(n, n));
        carried.normal = n / length;
    }
    return carried;
}

struct Hit {
    bool hits = false;
    double share = 1.0;  // of the piece
    SurfacePoint what;
    Vec3 normal{0.0};
};

/// One straight piece of the ride.
struct Piece {
    double from_time = 0.0;
    double to_time = 1.0;
    Vec3 from{0.0};
    Vec3 to{0.0};
    double radius = 0.0;
    double release = 1.0;
};

/// First touch on a piece, sphere and triangles both moving: in the sphere's frame the triangles still move linearly.
Hit sweep(const NearSurfaces& surfaces, const Piece& piece, const Ignored& ignored) noexcept {
    Hit hit;
    const SweptBall ball(piece.from, piece.to, piece.radius);
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SurfaceMotion& motion = surfaces[object].motion;
        surfaces.query(object, ball, When::Step, [&](std::uint32_t triangle) {
            const TriangleCorners t0 = corners_of(motion, triangle, piece.from_time);
            const TriangleCorners t1 = corners_of(motion, triangle, piece.to_time);
            const MovingTriangle relative{{t0.a - piece.from, t0.b - piece.from, t0.c - piece.from},
                                          {t1.a - piece.to, t1.b - piece.to, t1.c - piece.to}};
            if (ignored.has(object, triangle)) {
                return;
            }
            const TriangleTouch touch =
                sphere_triangle_ccd(Vec3(0.0), piece.radius, relative, hit.share, piece.release);
            if (touch.touches && (!hit.hits || touch.time < hit.share)) {
                hit.hits = true;
                hit.share = touch.time;
                hit.what = {object, triangle, touch.at.feature, touch.at.weights};
                const double length = std::sqrt(touch.at.squared_distance);
                hit.normal = length > 0.0 ? -touch.at.point / length : Vec3(0.0);
            }
        });
    }
    return hit;
}

/// The state of one proxy on its way through the step.
class Rider {
  public:
    Rider(const NearSurfaces& surfaces, const Vec3& center, double radius, const ContactSettings& settings)
        : surfaces_(surfaces), settings_(settings), radius_(radius), position_(center) {}

    SecurePosition run(ProxyPath* path) noexcept {
        for (result_.rides = 0; time_ < 1.0; ++result_.rides) {
            if (result_.rides >= settings_.max_rides) {
                give_way(0);
                time_ = 1.0;
                append(path);
                break;
            }
            touching_.gather(surfaces_, time_, position_, touching_reach(radius_, settings_), &ignored_);
            if (!plan()) {
                continue;
            }
            const Hit hit = sweep(surfaces_, piece_, ignored_);
            was_hit_ = hit.hits;
            if (hit.hits) {
                note(time_ + (piece_.to_time - time_) * hit.share, hit.what, hit.normal);
                time_ += (piece_.to_time - time_) * hit.share;
                position_ += (piece_.to - piece_.from) * hit.share;
            } else {
                time_ = piece_.to_time;
                position_ = piece_.to;
            }
            append(path);
        }
        result_.position = position_;
        return result_;
    }

  private:
    void append(ProxyPath* path) const noexcept {
        if (path != nullptr) {
            path->append(time_, position_);
        }
    }

    void note(double time, const SurfacePoint& what, const Vec3& normal) noexcept {
        if (!result_.touched) {
            result_.touched = true;
            result_.first_time = time;
            result_.first = what;
            result_.first_normal = normal;
        }
    }

    /// How near the sphere may come to anything on this piece. What already clips the sphere may come a little nearer
    /// on the way, for it is the end of the ride that must be clear: by a thousandth on the first rides, by a tenth
    /// after, by half once half of the rides are used up, when the sphere itself becomes smaller too. So the rides
    /// suffice and the centre stays clear, whatever happens to the rest of the sphere on the way.
    void fill_piece(double until, const Vec3& aim, double room) noexcept {
        const int late = result_.rides - settings_.max_rides / 2;
        piece_.radius = std::min(radius_, room) * settings_.shrink;
        for (int k = 0; k < late; ++k) {
            piece_.radius *= kLateShrink;
        }
        piece_.release = settings_.shrink;
        if (result_.rides >= kExactRides) {
            piece_.release = std::min(piece_.release, late > 0 ? kLateRelease : kPassing);
        }
        piece_.from_time = time_;
        piece_.to_time = until;
        piece_.from = position_;
        piece_.to = aim;
    }

    /// Where the touching surfaces will be, as planes.
    void predict(double then) noexcept {
        planes_.clear();
        for (const Touching& t : touching_.points()) {
            const Carried c = carry(surfaces_[t.object].motion, t, time_, then);
            planes_.add(c.normal, glm::dot(c.normal, c.point));
        }
    }

    /// The touching point that comes nearest to the standing sphere by the end, if any comes nearer than allowed.
    [[nodiscard]] bool find_lead(std::size_t& lead) const noexcept {
        double worst = 0.0;
        bool found = false;
        for (std::size_t k = 0; k < planes_.size(); ++k) {
            const double allowed = std::min(radius_, touching_.points()[k].distance) * settings_.shrink;
            const double depth = allowed - planes_.height(k, position_);
            if (depth > worst) {
                worst = depth;
                lead = k;
                found = true;
            }
        }
        return found;
    }

    /// Beside the touched point at a later time. The offset is where the tangent planes of both times meet: a straight
    /// way there stays outside the turning plane all the time (in the plane of the turn, with k = s (1 - s) (1 - cos),
    /// its height is radius * (1 - k) / sqrt(1 - 2 k)).
    [[nodiscard]] Vec3 beside(const Touching& t, double then) const noexcept {
        const Carried c = carry(surfaces_[t.object].motion, t, time_, then);
        return c.point + (t.normal + c.normal) * (radius_ / (1.0 + glm::dot(t.normal, c.normal)));
    }

    /// Plans the next piece; false if there was none and a surface was let through instead.
    bool plan() noexcept {
        // What touched may come nearer first and be gone by the end: then the ride ends where it is nearer still.
        double until = 1.0;
        std::size_t lead = 0;
        predict(until);
        bool rides = find_lead(lead);
        for (int k = 0; k < kHalvings && !rides && was_hit_; ++k) {
            until = time_ + 0.5 * (until - time_);
            predict(until);
            rides = find_lead(lead);
        }
        if (!rides) {
            fill_piece(1.0, position_, radius_);
            piece_.release = was_hit_ ? std::min(piece_.release, kPassing) : piece_.release;
            return true;
        }
        const Touching& t = touching_.points()[lead];
        note(time_, surface_point(t), t.normal);
        for (int k = 0; k < kHalvings; ++k) {
            const Carried c = carry(surfaces_[t.object].motion, t, time_, until);
            if (glm::dot(c.normal, t.normal) >= kSharpestTurn) {
                break;
            }
            until = time_ + 0.5 * (until - time_);
        }
        const double clearance = touching_.clearance(radius_);
        if (least_room_ == 0.0) {
            least_room_ = std::min(kLeastRoom * radius_, 0.5 * clearance);
        }
        PlaneSet::Room room = room_at(t, until, least_room_);
        if (!room.any) {
            until = clearance > kPinched * least_room_ ? last_time_with_room(t, until) : time_;
            if (until - time_ < kLeastStep) {
                give_way(lead);
                return false;
            }
            room = room_at(t, until, least_room_);
        }
        result_.squeezed = result_.squeezed || room.radius < radius_ * settings_.shrink;
        fill_piece(until, room.any ? room.at.point : position_, room.radius);
        return true;
    }

    PlaneSet::Room room_at(const Touching& t, double then, double least) noexcept {
        predict(then);
        return planes_.project_with_room(beside(t, then), radius_, least);
    }

    double last_time_with_room(const Touching& t, double without) noexcept {
        double with = time_;
        while (without - with > 0.25 * kLeastStep) {
            const double middle = 0.5 * (with + without);
            predict(middle);
            if (planes_.project(beside(t, middle), least_room_).feasible) {
                with = middle;
            } else {
                without = middle;
            }
        }
        return with;
    }

    /// Lets the fastest of the surfaces that pinch the centre through.
    void give_way(std::size_t lead) noexcept {
        result_.squeezed = true;
        result_.let_through = true;
        const std::span<const Touching> points = touching_.points();
        if (points.empty()) {
            return;
        }
        std::size_t fastest = std::min(lead, points.size() - 1);
        double most = -1.0;
        bool one_object = true;
        for (std::size_t k = 0; k < points.size(); ++k) {
            const Vec3 d =
                displacement_of(surfaces_[points[k].object].motion, points[k].triangle, points[k].at.weights);
            const double speed = std::abs(glm::dot(points[k].normal, d));
            if (speed > most) {
                most = speed;
                fastest = k;
            }
            one_object = one_object && points[k].object == points[0].object;
        }
        result_.passed = surface_point(points[fastest]);
        if (!one_object) {
            static_cast<void>(ignored_.add(points[fastest].object, Ignored::kWhole));
            return;
        }
        for (const Touching& t : points) {
            if (glm::dot(t.normal, points[fastest].normal) > 0.0) {
                static_cast<void>(ignored_.add(t.object, t.triangle));
            }
        }
    }

    NearSurfaces surfaces_;
    const ContactSettings& settings_;
    double radius_;
    Vec3 position_;
    double time_ = 0.0;
    bool was_hit_ = false;     // the last piece ended at a touch
    double least_room_ = 0.0;  // m, with less the centre is pinched; 0 until something touches
    Ignored ignored_;
    TouchingSet touching_;
    PlaneSet planes_;
    Piece piece_;
    SecurePosition result_;
};

}  // namespace

SecurePosition secure_position(const NearSurfaces& surfaces, const Vec3& center, double radius,
                               const ContactSettings& settings, ProxyPath* path) noexcept {
    if (settings.method == CcdMethod::Thesis) {
        return thesis_secure_position(surfaces.all(), center, radius, settings, path);
    }
    return Rider(surfaces, center, radius, settings).run(path);
}

}  // namespace haptic::sim
