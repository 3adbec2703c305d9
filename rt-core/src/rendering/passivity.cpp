#include "rendering/passivity.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "haptic/numeric.hpp"
#include "rendering/wrench_arithmetic.hpp"

namespace haptic::rt {
namespace {

// Share of the allowance below which the budget falls off smoothly and never reaches zero. A wall in debt could
// otherwise not push, take in nothing, and stay in debt; and at rest the last count of the encoders would switch it on
// and off.
constexpr double kSoftEnd = 0.1;
// s, time constant of the velocity that the brake acts on: a reading that jumps by a count, or a hand that is recorded
// in millimetres, must not make a pulse.
constexpr double kBrakeTimeS = 10e-3;

/// J that may be spent with `left` remaining: all of it, and below `soft` progressively less. The slope is continuous.
/// Spending the whole budget every tick takes at most 17 soft in a thousand ticks.
double budget_of(double left, double soft) HAPTIC_RT {
    if (left >= soft) {
        return left;
    }
    const double q = soft > 0.0 ? 4.0 * soft / (5.0 * soft - left) : 0.0;
    return soft * q * q * q * q;
}

double ratio(double limit, double value) HAPTIC_RT {
    return value > limit ? limit / value : 1.0;
}

/// J, work credited to a moving surface. Of a receding one (negative) only the part energy / storage_limit counts: a
/// surface that jumped unannounced left more in the springs than was credited, and taking it back must not become debt.
double credited_work(double surface, double energy, double storage_limit) HAPTIC_RT {
    return surface < 0.0 && storage_limit > 0.0 ? surface * std::clamp(energy / storage_limit, 0.0, 1.0) : surface;
}

/// Bounds E by what the springs can hold. Surplus pays what the bodies have taken; what they have given, at most `most`
/// in a tick, fills E up.
void settle(double& energy, double& bodies, double storage_limit, double most) HAPTIC_RT {
    const double missing = storage_limit - energy;
    if (missing < 0.0) {
        energy = storage_limit;
        bodies = bodies < 0.0 ? std::min(0.0, bodies - missing) : bodies;
    } else if (bodies > 0.0) {
        const double given = std::min({bodies, missing, most});
        energy += given;
        bodies -= given;
    }
}

/// alpha, at most `max_damping`, that pays back `debt` (J) in another tick with the same displacement.
double paying_damping(double debt, const Vec3& displacement, double elapsed_s, double max_damping) HAPTIC_RT {
    const double square = glm::dot(displacement, displacement);
    const double energy = max_damping * square / elapsed_s;  // J, that the maximum takes in such a tick
    return debt >= energy ? max_damping : max_damping * debt / energy;
}

}  // namespace

double affordable_share(double power, double acceleration_power, double period_s, double ramp_s,
                        double budget) HAPTIC_RT {
    if (!(budget > 0.0)) {
        return 0.0;
    }
    // P h + Q h^2 / 2 = budget, in the form without cancellation: h = 2 budget / (P + sqrt(P^2 + 2 Q budget)).
    const double divisor = power + std::sqrt(std::max(0.0, power * power + 2.0 * acceleration_power * budget));
    if (!(divisor > 0.0)) {
        return 1.0;  // zero wrench
    }
    // gamma = 1 fits if h covers a tick of holding and the whole ramp.
    const double h = 2.0 * budget / divisor;
    if (h >= period_s + 0.5 * ramp_s) {
        return 1.0;
    }
    // Otherwise the positive root of h = gamma (T + gamma tau / 2), in the same form.
    return 2.0 * h / (period_s + std::sqrt(period_s * period_s + 2.0 * ramp_s * h));
}

void Passivity::reset() HAPTIC_RT {
    energy_ = tank_ = translation_ = {};
    rotation_ = 0.0;
    scale_ = 1.0;
    brake_velocity_ = brake_turn_ = Vec3(0.0);
    surface_power_ = 0.0;
}

void Passivity::observe(const PassivityMotion& motion, const PassivityRequest& request, bool requested) HAPTIC_RT {
    const double dt = motion.elapsed_s;
    const bool active = motion.requested || requested;
    double translation = 0.0;
    double rotation = 0.0;
    double dissipated = 0.0;  // by the device
    // Work of the held wrench, exact over the tick, and the dissipation of the device.
    if (motion.requested) {
        translation -= glm::dot(motion.held.force, motion.displacement);
        rotation -= glm::dot(motion.held.torque, motion.rotation);
    }
    if (active && dt > 0.0) {
        // b |dx|^2 / dt + b_r |dtheta|^2 / dt, at least.
        const double of_translation = settings_.damping * glm::dot(motion.displacement, motion.displacement) / dt;
        const double of_rotation = settings_.rotational_damping * glm::dot(motion.rotation, motion.rotation) / dt;
        translation += of_translation;
        rotation += of_rotation;
        dissipated = of_translation + of_rotation;
    }
    // Trapezoidal rule for the work of the announced surfaces.
    const double max_power = settings_.surface_power;
    const double power = std::clamp(request.surface_power, -max_power, max_power);
    const double surface = active ? 0.5 * (surface_power_ + scale_ * power) * request.elapsed_s : 0.0;

    // E = min(E + work, stored + store), for each of the observers.
    const double storage_limit = active ? std::max(request.stored, 0.0) + settings_.store : 0.0;
    // The tank, which the controller spends, gets only damping_credit of the dissipation.
    const double absorbed = translation + rotation;
    const double wasted = (1.0 - settings_.damping_credit) * dissipated;
    const double most = active ? max_power * request.elapsed_s : 0.0;
    const double decay = 1.0 / (1.0 + request.elapsed_s / settings_.forget_s);
    const auto take = [&](Account& account, double taken) {
        // What the bodies have taken is remembered for some time, what they have given until the next frame.
        account.bodies *= account.bodies < 0.0 ? decay : 1.0;
        if (request.reported) {
            account.bodies = std::min(account.bodies, 0.0) + request.body_work;
        }
        account.energy += taken + credited_work(surface, account.energy, storage_limit);
        settle(account.energy, account.bodies, storage_limit, most);
    };
    take(energy_, absorbed);
    take(tank_, absorbed - wasted);
    take(translation_, translation);
    rotation_ = std::min(rotation_ + rotation, storage_limit);
    // Without a wrench, debt is forgotten with a time constant and surplus is already cut to zero.
    if (!active) {
        for (double* debt : {&energy_.energy, &tank_.energy, &translation_.energy, &rotation_}) {
            *debt *= decay;
        }
        scale_ = 1.0;
        brake_velocity_ = brake_turn_ = Vec3(0.0);
        surface_power_ = 0.0;
    } else {
        surface_power_ = power;  // apply() scales it like the wrench
    }
}

Passivity::Result Passivity::apply(const PassivityMotion& motion, const PassivityRequest& request) HAPTIC_RT {
    // Input that is not finite: zero wrench, and the observers stay as they are.
    if (!is_finite(request.wrench) || !std::isfinite(request.stored) || !std::isfinite(request.surface_power) ||
        !std::isfinite(request.body_work) || !is_finite(motion.displacement) || !is_finite(motion.rotation) ||
        !is_finite(motion.held)) {
        return {.wrench = Wrench{}, .scale = 0.0, .acted = true};
    }
    // Observe first: the energy of the last tick limits the wrench of this one.
    const bool requested = !is_zero(request.wrench);
    observe(motion, request, requested);
    if (!requested || settings_.control == PassivityControl::Observe) {
        return {.wrench = request.wrench};
    }
    // The surface works against the scaled wrench, so its power is scaled too.
    const Result result = settings_.control == PassivityControl::Bound ? bound(motion, request) : damp(motion, request);
    surface_power_ *= result.scale;
    return result;
}

Passivity::Result Passivity::bound(const PassivityMotion& motion, const PassivityRequest& request) HAPTIC_RT {
    // Velocity for the brake, by a first-order low-pass.
    if (motion.elapsed_s > 0.0) {
        const double part = motion.elapsed_s / (motion.elapsed_s + kBrakeTimeS);
        brake_velocity_ += part * (motion.displacement / motion.elapsed_s - brake_velocity_);
        brake_turn_ += part * (motion.rotation / motion.elapsed_s - brake_turn_);
    }
    // The size limits apply after this: only what they leave of the wrench has to be paid for.
    const double force = glm::length(request.wrench.force);
    const double torque = glm::length(request.wrench.torque);
    const double within = std::min(ratio(limits_.force, force), ratio(limits_.torque, torque));
    const double force_within = within * force;
    const double torque_within = within * torque;

    // P = w . v of the limited wrench.
    double power = 0.0;
    if (motion.elapsed_s > 0.0) {
        power =
            within *
            (glm::dot(request.wrench.force, motion.displacement) + glm::dot(request.wrench.torque, motion.rotation)) /
            motion.elapsed_s;
    }
    // Q = |F|^2 / m + |T|^2 / I, and the ramp time tau to zero: the longer of force and torque.
    const double acceleration_power =
        force_within * force_within / settings_.mass + torque_within * torque_within / settings_.inertia;
    const double ramp_s = std::max(force_within / limits_.force_rate, torque_within / limits_.torque_rate);
    // Largest affordable gamma.
    const double budget = budget_of(tank_.energy + settings_.allowance, kSoftEnd * settings_.allowance);
    const double target = affordable_share(std::max(power, 0.0), acceleration_power, request.period_s, ramp_s, budget);
    // gamma recovers only while the wrench does no work. Otherwise a rising gamma would push the hand out, use up the
    // budget and fall again, which is a vibration of its own.
    const double rise =
        power > 0.0 ? 0.0 : (1.0 - scale_) * request.elapsed_s / (request.elapsed_s + settings_.recovery_s);
    // gamma falls to the target at once, and rises by at most this tick's recovery.
    const double risen = scale_ + rise;
    // Snap to 1 near 1, so that the wrench soon equals the requested one bit for bit.
    scale_ = std::min(target, risen > 0.999 ? 1.0 : risen);
    if (scale_ >= 1.0) {
        return {.wrench = request.wrench};
    }
    // gamma w, and the brake -(1 - gamma) d v with the mean velocity v.
    const double wrench_scale = scale_ * within;
    Result result{.wrench = scaled(wrench_scale, request.wrench), .scale = scale_, .acted = true};
    if (motion.elapsed_s > 0.0) {
        const Vec3 brake = (1.0 - scale_) * settings_.brake * brake_velocity_;
        const Vec3 turn_brake = (1.0 - scale_) * settings_.rotational_brake * brake_turn_;
        result.wrench.force -= brake;
        result.wrench.torque -= turn_brake;
        // The energy of the brake is removed from the tank, so that it cannot be given back; but not below
        // -allowance, so that a count's jitter at rest makes no debt.
        const double braked = glm::dot(brake, motion.displacement) + glm::dot(turn_brake, motion.rotation);
        tank_.energy = std::max(tank_.energy - std::max(braked, 0.0), std::min(tank_.energy, -settings_.allowance));
    }
    return result;
}

Passivity::Result Passivity::damp(const PassivityMotion& motion, const PassivityRequest& request) const HAPTIC_RT {
    Result result{.wrench = request.wrench};
    if (!(motion.elapsed_s > 0.0)) {
        return result;
    }
    // Force -alpha v while the observer of translation is in debt.
    if (translation_.energy < 0.0 && motion.displacement != Vec3(0.0)) {
        const double alpha =
            paying_damping(-translation_.energy, motion.displacement, motion.elapsed_s, settings_.max_damping);
        result.wrench.force -= alpha / motion.elapsed_s * motion.displacement;
        result.acted = true;
    }
    // Torque -alpha omega while the observer of rotation is in debt.
    if (rotation_ < 0.0 && motion.rotation != Vec3(0.0)) {
        const double alpha =
            paying_damping(-rotation_, motion.rotation, motion.elapsed_s, settings_.max_rotational_damping);
        result.wrench.torque -= alpha / motion.elapsed_s * motion.rotation;
        result.acted = true;
    }
    return result;
}

double passive_stiffness(double damping, double friction, double resolution, double period_s, double delay_s) {
    // Limit of a sampled spring with delay, K <= 2 b / (T + 2 delay), and of one read in encoder counts.
    const double sampled = 2.0 * damping / (period_s + 2.0 * delay_s);
    const double quantised =
        friction > 0.0 && resolution > 0.0 ? 2.0 * friction / resolution : std::numeric_limits<double>::infinity();
    return std::min(sampled, quantised);
}

}  // namespace haptic::rt
