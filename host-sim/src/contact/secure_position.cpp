#include "contact/secure_position.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "contact/contact_points.hpp"
#include "contact/thesis/thesis_ccd.hpp"
#include "contact/triangle_ccd.hpp"

namespace haptic::sim {

namespace {

constexpr double kMinRadius = 0.02;          // of the radius: with less room the centre is overconstrained
constexpr double kNoMargin = 1.05;           // of the smallest radius: a clearance below this has no margin left
constexpr double kMinAdvance = 1e-6;         // of the step: a shorter advance makes no progress
constexpr int kHalvings = 6;                 // of an advance, until it is short enough
constexpr int kExactAdvances = 3;            // number of advances before the release is relaxed
constexpr double kPassingRelease = 0.9;      // release after kExactAdvances, share of the present distance
constexpr double kLateRelease = 0.5;         // release once half of the advances are used
constexpr double kLateShrink = 0.7;          // of the radius, for each advance beyond half of them
constexpr double kMinRotationCosine = 0.25;  // a larger rotation of the contact normal is followed in parts

/// Orthonormal frame attached to a moving triangle. `along` is the touched edge, `up` the face normal. Invalid for a
/// degenerate triangle.
struct TriangleFrame {
    Vec3 along{0.0};
    Vec3 up{0.0};
    Vec3 side{0.0};
    bool valid = false;
};

TriangleFrame frame_of(const TriangleCorners& t, const ClosestPoint& at) noexcept {
    // Axis along the touched edge; edge ab for a face or a vertex.
    Vec3 e = t.b - t.a;
    if (at.feature == Feature::Edge && at.index == 1) {
        e = t.c - t.b;
    } else if (at.feature == Feature::Edge && at.index == 2) {
        e = t.a - t.c;
    }
    // Face normal and squared lengths.
    const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
    const double ee = glm::dot(e, e);
    const double nn = glm::dot(n, n);
    TriangleFrame frame;
    // A needle (height below 1e-6 of its sides) has no reliable normal.
    if (nn > 1e-12 * ee * glm::dot(t.c - t.a, t.c - t.a) && ee > 0.0) {
        frame.along = e / std::sqrt(ee);
        frame.up = n / std::sqrt(nn);
        frame.side = glm::cross(frame.up, frame.along);
        frame.valid = true;
    }
    return frame;
}

/// Contact point and normal at a later time, carried by the triangle.
struct PredictedContact {
    Vec3 point{0.0};
    Vec3 normal{0.0};
};

PredictedContact predict_contact(const SurfaceMotion& motion, const ContactPoint& t, double now,
                                 double later) noexcept {
    // The point follows its barycentric weights.
    const TriangleCorners corners_later = corners_of(motion, t.triangle, later);
    PredictedContact predicted{blend(corners_later, t.at.weights), t.normal};
    const TriangleFrame from = frame_of(corners_of(motion, t.triangle, now), t.at);
    const TriangleFrame to = frame_of(corners_later, t.at);
    // The normal keeps its components in the triangle's frame.
    if (from.valid && to.valid) {
        const Vec3 n = to.along * glm::dot(from.along, t.normal) + to.up * glm::dot(from.up, t.normal) +
                       to.side * glm::dot(from.side, t.normal);
        const double length = std::sqrt(glm::dot(n, n));
        predicted.normal = n / length;
    }
    return predicted;
}

/// Earliest contact on one piece of the path.
struct FirstContact {
    bool found = false;
    double fraction = 1.0;  // of the piece, in [0, 1]
    SurfacePoint surface;
    Vec3 normal{0.0};
};

/// One straight piece of the path, from (from_time, from) to (to_time, to).
struct Piece {
    double from_time = 0.0;
    double to_time = 1.0;
    Vec3 from{0.0};
    Vec3 to{0.0};
    double radius = 0.0;   // m, radius of the swept sphere
    double release = 1.0;  // of the present distance: how near a triangle that clips the sphere may come
};

/// Earliest contact on a piece, with the sphere and the triangles both moving.
FirstContact first_contact(const NearSurfaces& surfaces, const Piece& piece) noexcept {
    FirstContact hit;
    const SweptSphere sphere(piece.from, piece.to, piece.radius);
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SurfaceMotion& motion = surfaces[object].motion;
        surfaces.query(object, sphere, QueryTime::WholeStep, [&](std::uint32_t triangle) {
            // Relative motion: in the sphere's frame the triangles still move linearly, so half-CCD applies.
            const TriangleCorners t0 = corners_of(motion, triangle, piece.from_time);
            const TriangleCorners t1 = corners_of(motion, triangle, piece.to_time);
            const MovingTriangle relative{{t0.a - piece.from, t0.b - piece.from, t0.c - piece.from},
                                          {t1.a - piece.to, t1.b - piece.to, t1.c - piece.to}};
            // A later triangle needs to be searched only up to the earliest contact so far.
            const TriangleTouch touch =
                sphere_triangle_ccd(Vec3(0.0), piece.radius, relative, hit.fraction, piece.release);
            if (touch.touches && (!hit.found || touch.time < hit.fraction)) {
                hit.found = true;
                hit.fraction = touch.time;
                hit.surface = {object, triangle, touch.at.feature, touch.at.weights};
                const double length = std::sqrt(touch.at.squared_distance);
                hit.normal = length > 0.0 ? -touch.at.point / length : Vec3(0.0);
            }
        });
    }
    return hit;
}

/// State of one proxy on its way through the step.
class SecurePositionSolver {
  public:
    SecurePositionSolver(const NearSurfaces& surfaces, const Vec3& center, double radius,
                         const ContactSettings& settings)
        : surfaces_(surfaces), settings_(settings), radius_(radius), start_(center), position_(center) {}

    /// Conservative advancement over the step: collect contacts, plan a piece, sweep it, move to its end or first
    /// contact.
    SecurePosition run(ProxyPath* path) noexcept {
        for (result_.advances = 0; time_ < 1.0; ++result_.advances) {
            // Contacts at the present time bound the next piece.
            contact_set_.collect(surfaces_, time_, position_, contact_reach(radius_, settings_));
            if (result_.advances >= settings_.max_advances || !plan_piece()) {
                result_.overconstrained = true;
                if (find_in_the_way()) {
                    result_.no_room = true;
                    result_.position = start_;
                    return result_;
                }
                // Nothing moves that leaves no room: the centre has begun on it, and stays there.
                time_ = 1.0;
                append(path);
                break;
            }
            // Half-CCD along the planned piece; stop at the earliest contact.
            const FirstContact hit = first_contact(surfaces_, piece_);
            was_stopped_ = hit.found;
            if (hit.found) {
                record_first_contact(time_ + (piece_.to_time - time_) * hit.fraction, hit.surface, hit.normal);
                time_ += (piece_.to_time - time_) * hit.fraction;
                position_ += (piece_.to - piece_.from) * hit.fraction;
            } else {
                // Free path: take the whole piece.
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

    void record_first_contact(double time, const SurfacePoint& surface, const Vec3& normal) noexcept {
        if (!result_.touched) {
            result_.touched = true;
            result_.first_time = time;
            result_.first = surface;
            result_.first_normal = normal;
        }
    }

    /// Sets the next piece, with the radius and the release of its sweep. Only the end of a piece must be clear. So a
    /// triangle that already clips the sphere may come nearer during the piece: to `shrink` of its distance on the
    /// first advances, then to 0.9, and to 0.5 once half of the advances are used, when the sphere shrinks too. This
    /// bounds the number of advances and keeps the centre clear, whatever the rest of the sphere touches.
    void set_piece(double until, const Vec3& target, double available_radius) noexcept {
        // Late advances shrink the swept sphere.
        const int late = result_.advances - settings_.max_advances / 2;
        piece_.radius = std::min(radius_, available_radius) * settings_.shrink;
        for (int k = 0; k < late; ++k) {
            piece_.radius *= kLateShrink;
        }
        // Release: how near to its present distance a clipping triangle may come.
        piece_.release = settings_.shrink;
        if (result_.advances >= kExactAdvances) {
            piece_.release = std::min(piece_.release, late > 0 ? kLateRelease : kPassingRelease);
        }
        piece_.from_time = time_;
        piece_.to_time = until;
        piece_.from = position_;
        piece_.to = target;
    }

    /// Contact point and normal at a later time. A normal that leaps has not rotated: the triangle is turned inside out
    /// in its plane, and the sphere stays on its side.
    [[nodiscard]] PredictedContact predict(const ContactPoint& t, double later) const noexcept {
        const SurfaceMotion& motion = surfaces_[t.object].motion;
        PredictedContact predicted = predict_contact(motion, t, time_, later);
        if (glm::dot(predicted.normal, t.normal) < kMinRotationCosine) {
            const double soon = time_ + std::ldexp(later - time_, -kHalvings);
            if (glm::dot(predict_contact(motion, t, time_, soon).normal, t.normal) < kMinRotationCosine) {
                predicted.normal = t.normal;
            }
        }
        return predicted;
    }

    /// Tangent planes of the touching features, predicted at a later time.
    void predict_planes(double later) noexcept {
        planes_.clear();
        for (const ContactPoint& t : contact_set_.points()) {
            const PredictedContact c = predict(t, later);
            planes_.add(c.normal, glm::dot(c.normal, c.point));
        }
    }

    /// Finds the contact whose predicted plane is violated most by the sphere at rest. False if none is violated.
    [[nodiscard]] bool find_deepest(std::size_t& deepest) const noexcept {
        double worst = 0.0;
        bool found = false;
        for (std::size_t k = 0; k < planes_.size(); ++k) {
            // A triangle that is already nearer than the radius only has to keep its distance.
            const double allowed = std::min(radius_, contact_set_.points()[k].distance) * settings_.shrink;
            const double depth = allowed - planes_.height(k, position_);
            if (depth > worst) {
                worst = depth;
                deepest = k;
                found = true;
            }
        }
        return found;
    }

    /// Target next to the contact point at a later time: the intersection of the tangent planes at both times, at
    /// distance `radius` from each. On the straight path there the sphere stays outside the rotating plane at all
    /// times: in the plane of rotation, with k = s (1 - s) (1 - cos), its height is radius * (1 - k) / sqrt(1 - 2 k).
    [[nodiscard]] Vec3 target_beside(const ContactPoint& t, double later) const noexcept {
        const PredictedContact c = predict(t, later);
        return c.point + (t.normal + c.normal) * (radius_ / (1.0 + glm::dot(t.normal, c.normal)));
    }

    /// Plans the next piece. False if none is feasible.
    bool plan_piece() noexcept {
        // Contact with the deepest predicted penetration at t = 1. A surface that stopped the last piece may come
        // nearer and leave again before t = 1; then halve the horizon until it penetrates.
        double until = 1.0;
        std::size_t deepest = 0;
        predict_planes(until);
        bool needs_advance = find_deepest(deepest);
        for (int k = 0; k < kHalvings && !needs_advance && was_stopped_; ++k) {
            until = time_ + 0.5 * (until - time_);
            predict_planes(until);
            needs_advance = find_deepest(deepest);
        }
        // No predicted penetration: rest until t = 1 or the next contact.
        if (!needs_advance) {
            set_piece(1.0, position_, radius_);
            piece_.release = was_stopped_ ? std::min(piece_.release, kPassingRelease) : piece_.release;
            return true;
        }
        // Shorten the horizon until the deepest contact's normal rotates little: the tangent planes before and after a
        // large rotation meet far away.
        const ContactPoint& t = contact_set_.points()[deepest];
        record_first_contact(time_, surface_point(t), t.normal);
        for (int k = 0; k < kHalvings; ++k) {
            if (glm::dot(predict(t, until).normal, t.normal) >= kMinRotationCosine) {
                break;
            }
            until = time_ + 0.5 * (until - time_);
        }
        // Smallest usable radius: kMinRadius, or half the clearance at the first contact if that is less.
        const double clearance = contact_set_.clearance(radius_);
        if (min_radius_ == 0.0) {
            min_radius_ = std::min(kMinRadius * radius_, 0.5 * clearance);
        }
        // Target: nearest point to target_beside() outside all predicted planes, with the largest radius that fits.
        PlaneSet::Fit fit = fit_at(t, until, min_radius_);
        if (!fit.feasible) {
            // No room at `until`: advance to the last time that has room. If that is now, the centre is
            // overconstrained.
            until = clearance > kNoMargin * min_radius_ ? last_feasible_time(t, until) : time_;
            if (until - time_ < kMinAdvance) {
                return false;
            }
            fit = fit_at(t, until, min_radius_);
        }
        // A smaller radius than the shrunk one means that the whole sphere does not fit.
        result_.overconstrained = result_.overconstrained || fit.radius < radius_ * settings_.shrink;
        set_piece(until, fit.feasible ? fit.projection.point : position_, fit.radius);
        return true;
    }

    /// Best target at a later time: project target_beside() onto the predicted half-spaces.
    PlaneSet::Fit fit_at(const ContactPoint& t, double later, double min_radius) noexcept {
        predict_planes(later);
        return planes_.project_with_largest_radius(target_beside(t, later), radius_, min_radius);
    }

    /// Last time at which a sphere of the smallest radius fits, by bisection. `infeasible` is a time at which it does
    /// not.
    double last_feasible_time(const ContactPoint& t, double infeasible) noexcept {
        double feasible = time_;
        // Invariant: the sphere fits at `feasible` and does not at `infeasible`.
        while (infeasible - feasible > 0.25 * kMinAdvance) {
            const double middle = 0.5 * (feasible + infeasible);
            predict_planes(middle);
            if (planes_.project(target_beside(t, middle), min_radius_).feasible) {
                feasible = middle;
            } else {
                infeasible = middle;
            }
        }
        return feasible;
    }

    /// Names the fastest of the surfaces that leave no way, by its normal speed. False: all of them stand.
    [[nodiscard]] bool find_in_the_way() noexcept {
        result_.in_the_way = result_.first;
        double max_speed = 0.0;
        for (const ContactPoint& point : contact_set_.points()) {
            // Of its corners: it may turn about the point.
            double speed = 0.0;
            for (int corner = 0; corner < 3; ++corner) {
                Vec3 at(0.0);
                at[corner] = 1.0;
                const Vec3 d = displacement_of(surfaces_[point.object].motion, point.triangle, at);
                speed = std::max(speed, std::abs(glm::dot(point.normal, d)));
            }
            if (speed > max_speed) {
                max_speed = speed;
                result_.in_the_way = surface_point(point);
            }
        }
        return max_speed > 0.0 || contact_set_.empty();
    }

    NearSurfaces surfaces_;
    const ContactSettings& settings_;
    double radius_;
    Vec3 start_;
    Vec3 position_;
    double time_ = 0.0;
    bool was_stopped_ = false;  // the last piece ended at a contact
    double min_radius_ = 0.0;   // m, smallest usable radius; 0 until something touches
    ContactPointSet contact_set_;
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
    // Free air: the proxy stays where it is, in one advance.
    if (surfaces.is_clear(aabb_of_segment(center, center, contact_reach(radius, settings)))) {
        if (path != nullptr) {
            path->append(1.0, center);
        }
        SecurePosition result;
        result.position = center;
        result.advances = 1;
        return result;
    }
    return SecurePositionSolver(surfaces, center, radius, settings).run(path);
}

}  // namespace haptic::sim
