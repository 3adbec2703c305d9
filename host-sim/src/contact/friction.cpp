#include "contact/friction.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "contact/active_contacts.hpp"

namespace haptic::sim {

namespace {

constexpr int kMaxSlideMoves = 6;        // moves of one slide; on a flat surface one suffices
constexpr double kConeTolerance = 0.01;  // of the friction limit: close enough to the cone
constexpr double kDependentNormal =
    1e-9;  // squared length of an orthogonalised normal below which it counts as dependent on the others

double length_of(const Vec3& v) noexcept {
    return std::sqrt(glm::dot(v, v));
}

/// Coupling force at the contact, divided by the coupling's stiffness.
struct ContactLoad {
    double normal = 0.0;      // m, sum of the multipliers lambda_k
    Vec3 tangential{0.0};     // m, x - x0 along the planes
    bool in_contact = false;  // a plane is active
    bool feasible = true;     // false: the touched planes leave no room, so the load is unknown
};

/// Moves one proxy through one step: carried by the surfaces, sticking or sliding.
class FrictionMover {
  public:
    FrictionMover(const NearSurfaces& surfaces, const ProxyStep& step, double radius, double dt,
                  const ContactSettings& settings, ProxyPath* path)
        : surfaces_(surfaces),
          step_(step),
          settings_(settings),
          radius_(radius),
          dt_(dt),
          path_(path),
          position_(step.from) {}

    ProxyMove run(FrictionState& state) noexcept {
        // Stick: start where the surfaces carry the proxy (dt = 1 turns the velocity into a displacement).
        if (state.active_planes.count > 0) {
            move_toward(step_.before + carrying_velocity(surfaces_.all(), state, 1.0));
        }
        // Not in contact: advance to the first contact on the path to the goal, where static friction applies.
        ContactLoad load = evaluate_load();
        if (!load.in_contact) {
            advance_to_first_contact();
            load = evaluate_load();
            state.slides = false;
        }
        if (!load.feasible) {
            // No room: friction is undefined, so move without it.
            move_toward(step_.goal);
            load = evaluate_load();
        } else if (load.in_contact) {
            // Coulomb: stick while |x - x0| <= mu sum lambda_k, otherwise slide to the dynamic cone.
            const double limit = (state.slides ? settings_.dynamic_friction : settings_.static_friction) * load.normal;
            state.slides = length_of(load.tangential) > limit * (1.0 + 1e-9);
            if (state.slides) {
                load = slide_to_cone(load);
            }
        }
        store_contacts(state);
        result_.position = position_;
        result_.contacts = state.active_planes;
        return result_;
    }

  private:
    void move_toward(const Vec3& goal) noexcept {
        const ProxyMove move = move_proxy(surfaces_, position_, goal, radius_, dt_, settings_, path_);
        position_ = move.position;
        result_.iterations += move.iterations;
        result_.converged = result_.converged && move.converged;
    }

    /// Advances along the direct path to the goal until the shrunk sphere touches, then moves to the full radius.
    void advance_to_first_contact() noexcept {
        const Vec3 displacement = step_.goal - position_;
        const double shrunk = radius_ * settings_.shrink;
        const Vec3 contact =
            position_ + displacement * free_fraction(surfaces_, position_, displacement, shrunk, settings_.shrink);
        move_toward(contact);
    }

    /// Normal and tangential load at the present position, for the goal.
    ContactLoad evaluate_load() noexcept {
        // x0: nearest point to the goal outside the planes that the proxy touches.
        active_contacts_.update(surfaces_, position_, step_.goal, radius_, settings_);
        const PlaneSet::Fit& fit = active_contacts_.fit();
        ContactLoad load;
        load.feasible = fit.feasible;
        load.in_contact = fit.feasible && fit.projection.active_count > 0;
        if (!load.in_contact) {
            return load;
        }
        // x - x0, still with a normal part.
        load.tangential = position_ - fit.projection.point;
        // Sum of the multipliers. Gram-Schmidt over the active normals removes the normal part of x - x0.
        std::array<Vec3, kMaxSurfacePlanes> basis{};
        for (std::size_t k = 0; k < fit.projection.active_count; ++k) {
            load.normal += fit.projection.multiplier[k];
            Vec3 n = active_contacts_.points()[fit.projection.active[k]].normal;
            for (std::size_t i = 0; i < k; ++i) {
                n -= basis[i] * glm::dot(basis[i], n);
            }
            const double squared = glm::dot(n, n);
            if (squared > kDependentNormal) {
                basis[k] = n / std::sqrt(squared);
                load.tangential -= basis[k] * glm::dot(basis[k], load.tangential);
            }
        }
        return load;
    }

    /// Moves toward the frictionless position until the goal lies on the dynamic friction cone. On a flat surface the
    /// offset x - x0 is proportional to the share s by which the goal is moved back to the sticking point.
    ContactLoad slide_to_cone(ContactLoad load) noexcept {
        // Fixed-point iteration on s; exact after one move while the normal load stays the same.
        const Vec3 stuck = position_;
        double share = 1.0;
        for (int k = 0; k < kMaxSlideMoves; ++k) {
            // Done if |x - x0| is mu_d sum lambda_k to 1 %.
            const double limit = settings_.dynamic_friction * load.normal;
            const double tangential = length_of(load.tangential);
            if (std::abs(tangential - limit) <= kConeTolerance * limit || !(tangential > 0.0)) {
                break;
            }
            // Scale the share so that the offset meets the limit, and move there without friction.
            share = std::min(share * limit / tangential, 1.0);
            move_toward(step_.goal + (stuck - step_.goal) * share);
            load = evaluate_load();
            if (!load.in_contact || limit == 0.0) {
                break;
            }
        }
        return load;
    }

    /// Stores the active planes and their shares of the normal force for the next step.
    void store_contacts(FrictionState& state) noexcept {
        state.active_planes = active_contacts_.planes(surfaces_, dt_);
        state.share = {};
        const Projection& projection = active_contacts_.fit().projection;
        // Share of each plane in sum lambda_k; even shares if no plane presses.
        double sum = 0.0;
        for (std::size_t k = 0; k < state.active_planes.count; ++k) {
            sum += projection.multiplier[k];
        }
        for (std::size_t k = 0; k < state.active_planes.count; ++k) {
            state.share[k] = sum > 0.0 ? projection.multiplier[k] / sum : 1.0 / state.active_planes.count;
        }
        state.slides = state.slides && state.active_planes.count > 0;
    }

    NearSurfaces surfaces_;
    const ProxyStep& step_;
    const ContactSettings& settings_;
    double radius_;
    double dt_;
    ProxyPath* path_;
    Vec3 position_;
    ActiveContacts active_contacts_;
    ProxyMove result_;
};

}  // namespace

ProxyMove move_proxy(const NearSurfaces& surfaces, const ProxyStep& step, double radius, double dt,
                     const ContactSettings& settings, FrictionState& state, ProxyPath* path) noexcept {
    if (settings.static_friction == 0.0 && settings.dynamic_friction == 0.0) {
        return move_proxy(surfaces, step.from, step.goal, radius, dt, settings, path);
    }
    // Free air: nothing carries the proxy, and it reaches its goal.
    ProxyMove free;
    if (state.active_planes.count == 0 &&
        move_through_free_air(surfaces, step.from, step.from + (step.goal - step.from), radius, settings, path, free)) {
        state = {};
        return free;
    }
    return FrictionMover(surfaces, step, radius, dt, settings, path).run(state);
}

FrictionParts divide_friction(const Vec3& force, const SurfacePlanes& contacts,
                              const std::array<double, kMaxSurfacePlanes>& strength) noexcept {
    // Remove the normal parts.
    Vec3 tangential = force;
    double sum = 0.0;
    for (std::size_t c = 0; c < contacts.count; ++c) {
        tangential -= strength[c] * contacts.plane[c].normal;
        sum += strength[c];
    }
    // Share out the rest by normal force.
    FrictionParts parts{};
    for (std::size_t c = 0; c < contacts.count; ++c) {
        parts[c] = tangential * (sum > 0.0 ? strength[c] / sum : 1.0 / contacts.count);
    }
    return parts;
}

Vec3 carrying_velocity(std::span<const MovingSurface> surfaces, const FrictionState& state, double dt) noexcept {
    Vec3 velocity(0.0);
    for (std::size_t k = 0; k < state.active_planes.count; ++k) {
        const SurfacePoint& touched = state.active_planes.plane[k].touched;
        velocity +=
            displacement_of(surfaces[touched.object].motion, touched.triangle, touched.weights) * (state.share[k] / dt);
    }
    return velocity;
}

}  // namespace haptic::sim
