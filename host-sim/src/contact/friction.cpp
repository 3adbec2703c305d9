#include "contact/friction.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "contact/hold.hpp"

namespace haptic::sim {

namespace {

constexpr int kSlides = 6;           // moves of one slide; on a flat place one is enough
constexpr double kOnTheCone = 0.01;  // of the limit: near enough to it
constexpr double kDependent = 1e-9;  // squared length that a normal must keep beside the others

double length_of(const Vec3& v) noexcept {
    return std::sqrt(glm::dot(v, v));
}

/// The forces at a place, over the stiffness of the coupling.
struct Load {
    double normal = 0.0;  // m, sum of the multipliers
    Vec3 along{0.0};      // m, from where the proxy would slide to where it is
    bool held = false;    // by a plane
    bool known = true;    // false: no room, nothing can be said
};

/// A proxy that is taken along, sticks or slides.
class Slider {
  public:
    Slider(const NearSurfaces& surfaces, const ProxyStep& step, double radius, double dt,
           const ContactSettings& settings, ProxyPath* path)
        : surfaces_(surfaces),
          step_(step),
          settings_(settings),
          radius_(radius),
          dt_(dt),
          path_(path),
          at_(step.from) {}

    ProxyMove run(ProxyGrip& grip) noexcept {
        if (grip.held_by.count > 0) {
            reach(step_.before + carrying_velocity(surfaces_.all(), grip, 1.0));
        }
        Load load = look();
        if (!load.held) {
            fly();
            load = look();
            grip.slides = false;
        }
        if (!load.known) {
            reach(step_.goal);
            load = look();
        } else if (load.held) {
            const double limit = (grip.slides ? settings_.dynamic_friction : settings_.static_friction) * load.normal;
            grip.slides = length_of(load.along) > limit * (1.0 + 1e-9);
            if (grip.slides) {
                load = slide(load);
            }
        }
        take_hold(grip);
        result_.position = at_;
        result_.contacts = grip.held_by;
        return result_;
    }

  private:
    void reach(const Vec3& goal) noexcept {
        const ProxyMove move = move_proxy(surfaces_, at_, goal, radius_, dt_, settings_, path_);
        at_ = move.position;
        result_.iterations += move.iterations;
        result_.converged = result_.converged && move.converged;
    }

    /// Straight toward the goal to the first touch, and there to the whole radius.
    void fly() noexcept {
        const Vec3 way = step_.goal - at_;
        const double shrunk = radius_ * settings_.shrink;
        const Vec3 touch = at_ + way * free_fraction(surfaces_, at_, way, shrunk, settings_.shrink);
        reach(touch);
    }

    Load look() noexcept {
        hold_.look(surfaces_, at_, step_.goal, radius_, settings_);
        const PlaneSet::Room& room = hold_.room();
        Load load;
        load.known = room.any;
        load.held = room.any && room.at.active_count > 0;
        if (!load.held) {
            return load;
        }
        load.along = at_ - room.at.point;
        std::array<Vec3, kMaxSurfacePlanes> across{};
        for (std::size_t k = 0; k < room.at.active_count; ++k) {
            load.normal += room.at.multiplier[k];
            Vec3 n = hold_.points()[room.at.active[k]].normal;
            for (std::size_t i = 0; i < k; ++i) {
                n -= across[i] * glm::dot(across[i], n);
            }
            const double left = glm::dot(n, n);
            if (left > kDependent) {
                across[k] = n / std::sqrt(left);
                load.along -= across[k] * glm::dot(across[k], load.along);
            }
        }
        return load;
    }

    /// Toward the frictionless place until the goal is on the dynamic cone. On a flat place the proxy for a goal that
    /// is a share s of the way back to where it stuck keeps the share s of its offset.
    Load slide(Load load) noexcept {
        const Vec3 stuck = at_;
        double share = 1.0;
        for (int k = 0; k < kSlides; ++k) {
            const double limit = settings_.dynamic_friction * load.normal;
            const double along = length_of(load.along);
            if (std::abs(along - limit) <= kOnTheCone * limit || !(along > 0.0)) {
                break;
            }
            share = std::min(share * limit / along, 1.0);
            reach(step_.goal + (stuck - step_.goal) * share);
            load = look();
            if (!load.held || limit == 0.0) {
                break;
            }
        }
        return load;
    }

    void take_hold(ProxyGrip& grip) noexcept {
        grip.held_by = hold_.planes(surfaces_, dt_);
        grip.share = {};
        const Projection& at = hold_.room().at;
        double sum = 0.0;
        for (std::size_t k = 0; k < grip.held_by.count; ++k) {
            sum += at.multiplier[k];
        }
        for (std::size_t k = 0; k < grip.held_by.count; ++k) {
            grip.share[k] = sum > 0.0 ? at.multiplier[k] / sum : 1.0 / grip.held_by.count;
        }
        grip.slides = grip.slides && grip.held_by.count > 0;
    }

    NearSurfaces surfaces_;
    const ProxyStep& step_;
    const ContactSettings& settings_;
    double radius_;
    double dt_;
    ProxyPath* path_;
    Vec3 at_;
    Hold hold_;
    ProxyMove result_;
};

}  // namespace

ProxyMove move_proxy(const NearSurfaces& surfaces, const ProxyStep& step, double radius, double dt,
                     const ContactSettings& settings, ProxyGrip& grip, ProxyPath* path) noexcept {
    if (settings.static_friction == 0.0 && settings.dynamic_friction == 0.0) {
        return move_proxy(surfaces, step.from, step.goal, radius, dt, settings, path);
    }
    return Slider(surfaces, step, radius, dt, settings, path).run(grip);
}

FrictionParts divide_friction(const Vec3& force, const SurfacePlanes& contacts,
                              const std::array<double, kMaxSurfacePlanes>& strength) noexcept {
    Vec3 left = force;
    double sum = 0.0;
    for (std::size_t c = 0; c < contacts.count; ++c) {
        left -= strength[c] * contacts.plane[c].normal;
        sum += strength[c];
    }
    FrictionParts parts{};
    for (std::size_t c = 0; c < contacts.count; ++c) {
        parts[c] = left * (sum > 0.0 ? strength[c] / sum : 1.0 / contacts.count);
    }
    return parts;
}

Vec3 carrying_velocity(std::span<const MovingSurface> surfaces, const ProxyGrip& grip, double dt) noexcept {
    Vec3 velocity(0.0);
    for (std::size_t k = 0; k < grip.held_by.count; ++k) {
        const SurfacePoint& touched = grip.held_by.plane[k].touched;
        velocity +=
            displacement_of(surfaces[touched.object].motion, touched.triangle, touched.weights) * (grip.share[k] / dt);
    }
    return velocity;
}

}  // namespace haptic::sim
