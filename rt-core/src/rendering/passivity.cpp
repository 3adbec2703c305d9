#include "rendering/passivity.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include <haptic/rt/finite.hpp>

namespace haptic::rt {
namespace {

// Below this part of the allowance the budget ends smoothly and never quite: a wall that owes could else not push, take
// nothing in, and so owe for ever; and at rest the encoders' last count would switch it on and off.
constexpr double kSoftEnd = 0.1;

bool is_zero(const Wrench& wrench) HAPTIC_RT {
    return wrench.force == Vec3(0.0) && wrench.torque == Vec3(0.0);
}

/// What may be spent with `left` of the allowance: all of it, and below `soft` less and less. The slope is continuous,
/// and spending all of it tick after tick takes no more than 17 soft in a thousand ticks.
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

/// What a surface takes out of the springs as it goes, of the part `energy` of what they may keep: as large a part. One
/// that has jumped without saying so left more in the springs than ever came in, and must not owe for taking it back.
double taken_along(double surface, double energy, double keep) HAPTIC_RT {
    return surface < 0.0 && keep > 0.0 ? surface * std::clamp(energy / keep, 0.0, 1.0) : surface;
}

/// alpha that pays `debt` with a displacement in a time, at most `largest`.
double paying_damping(double debt, const Vec3& displacement, double elapsed_s, double largest) HAPTIC_RT {
    const double square = glm::dot(displacement, displacement);
    const double energy = largest * square / elapsed_s;  // that the largest alpha would take in another tick like this
    return debt >= energy ? largest : largest * debt / energy;
}

}  // namespace

double affordable_share(double power, double acceleration_power, double period_s, double ramp_s,
                        double budget) HAPTIC_RT {
    if (!(budget > 0.0)) {
        return 0.0;
    }
    const double divisor = power + std::sqrt(std::max(0.0, power * power + 2.0 * acceleration_power * budget));
    if (!(divisor > 0.0)) {
        return 1.0;  // a wrench of nothing
    }
    const double h = 2.0 * budget / divisor;
    if (h >= period_s + 0.5 * ramp_s) {
        return 1.0;
    }
    return 2.0 * h / (period_s + std::sqrt(period_s * period_s + 2.0 * ramp_s * h));
}

void Passivity::reset() HAPTIC_RT {
    energy_ = 0.0;
    tank_ = 0.0;
    translation_ = 0.0;
    rotation_ = 0.0;
    scale_ = 1.0;
    surface_power_ = 0.0;
}

void Passivity::observe(const PassivityMotion& motion, const PassivityWish& wish, bool wished) HAPTIC_RT {
    const double dt = motion.elapsed_s;
    const bool counts = motion.asked || wished;
    double translation = 0.0;
    double rotation = 0.0;
    double eaten = 0.0;  // by the device
    if (motion.asked) {
        translation -= glm::dot(motion.held.force, motion.moved);
        rotation -= glm::dot(motion.held.torque, motion.turned);
    }
    if (counts && dt > 0.0) {
        const double of_translation = settings_.damping * glm::dot(motion.moved, motion.moved) / dt;
        const double of_rotation = settings_.rotational_damping * glm::dot(motion.turned, motion.turned) / dt;
        translation += of_translation;
        rotation += of_rotation;
        eaten = of_translation + of_rotation;
    }
    const double most = settings_.surface_power;
    const double now = std::clamp(wish.surface_power, -most, most);
    const double surface = counts ? 0.5 * (surface_power_ + scale_ * now) * wish.elapsed_s : 0.0;

    const double keep = counts ? wish.stored + settings_.store : 0.0;
    const double taken = translation + rotation;
    energy_ = std::min(energy_ + taken + taken_along(surface, energy_, keep), keep);
    tank_ =
        std::min(tank_ + taken + taken_along(surface, tank_, keep) - (1.0 - settings_.damping_credit) * eaten, keep);
    translation_ = std::min(translation_ + translation + taken_along(surface, translation_, keep), keep);
    rotation_ = std::min(rotation_ + rotation, keep);
    if (!counts) {
        const double kept = 1.0 / (1.0 + wish.elapsed_s / settings_.forget_s);
        energy_ *= kept;
        tank_ *= kept;
        translation_ *= kept;
        rotation_ *= kept;
        scale_ = 1.0;
        surface_power_ = 0.0;
    } else {
        surface_power_ = now;  // as far as it will be rendered: apply() scales it
    }
}

Passivity::Result Passivity::apply(const PassivityMotion& motion, const PassivityWish& wish) HAPTIC_RT {
    if (!finite(wish.wrench) || !std::isfinite(wish.stored) || !std::isfinite(wish.surface_power) ||
        !finite(motion.moved) || !finite(motion.turned) || !finite(motion.held)) {
        return {.wrench = Wrench{}, .scale = 0.0, .acted = true};
    }
    const bool wished = !is_zero(wish.wrench);
    observe(motion, wish, wished);
    if (!wished || settings_.control == PassivityControl::Observe) {
        return {.wrench = wish.wrench};
    }
    const Result result = settings_.control == PassivityControl::Bound ? bound(motion, wish) : damp(motion, wish);
    surface_power_ *= result.scale;
    return result;
}

Passivity::Result Passivity::bound(const PassivityMotion& motion, const PassivityWish& wish) HAPTIC_RT {
    // Only what the limits of size leave of the wish has to be paid for.
    const double force = glm::length(wish.wrench.force);
    const double torque = glm::length(wish.wrench.torque);
    const double within = std::min(ratio(limits_.force, force), ratio(limits_.torque, torque));
    const double force_within = within * force;
    const double torque_within = within * torque;

    double power = 0.0;
    if (motion.elapsed_s > 0.0) {
        power = within * (glm::dot(wish.wrench.force, motion.moved) + glm::dot(wish.wrench.torque, motion.turned)) /
                motion.elapsed_s;
    }
    const double acceleration_power =
        force_within * force_within / settings_.mass + torque_within * torque_within / settings_.inertia;
    const double ramp_s = std::max(force_within / limits_.force_rate, torque_within / limits_.torque_rate);
    const double budget = budget_of(tank_ + settings_.allowance, kSoftEnd * settings_.allowance);
    const double target = affordable_share(std::max(power, 0.0), acceleration_power, wish.period_s, ramp_s, budget);
    // While the wrench does work a share that rises would push the hand out, be spent, and fall: a vibration of its
    // own.
    const double rise = power > 0.0 ? 0.0 : (1.0 - scale_) * wish.elapsed_s / (wish.elapsed_s + settings_.recovery_s);
    const double risen = scale_ + rise;
    // A scale that is all but 1 is 1, so that a wrench is soon again bit for bit what was wished.
    scale_ = std::min(target, risen > 0.999 ? 1.0 : risen);
    if (scale_ >= 1.0) {
        return {.wrench = wish.wrench};
    }
    const double share = scale_ * within;
    Result result{.wrench = {share * wish.wrench.force, share * wish.wrench.torque}, .scale = scale_, .acted = true};
    if (motion.elapsed_s > 0.0) {
        const double part = (1.0 - scale_) / motion.elapsed_s;
        const Vec3 brake = part * settings_.brake * motion.moved;
        const Vec3 turn_brake = part * settings_.rotational_brake * motion.turned;
        result.wrench.force -= brake;
        result.wrench.torque -= turn_brake;
        // What the brake will take is gone: it may not come back as intake. But a count to and fro at rest makes no
        // debt.
        const double taken = glm::dot(brake, motion.moved) + glm::dot(turn_brake, motion.turned);
        tank_ = std::max(tank_ - taken, std::min(tank_, -settings_.allowance));
    }
    return result;
}

Passivity::Result Passivity::damp(const PassivityMotion& motion, const PassivityWish& wish) const HAPTIC_RT {
    Result result{.wrench = wish.wrench};
    if (!(motion.elapsed_s > 0.0)) {
        return result;
    }
    if (translation_ < 0.0 && motion.moved != Vec3(0.0)) {
        const double alpha = paying_damping(-translation_, motion.moved, motion.elapsed_s, settings_.largest_damping);
        result.wrench.force -= alpha / motion.elapsed_s * motion.moved;
        result.acted = true;
    }
    if (rotation_ < 0.0 && motion.turned != Vec3(0.0)) {
        const double alpha =
            paying_damping(-rotation_, motion.turned, motion.elapsed_s, settings_.largest_rotational_damping);
        result.wrench.torque -= alpha / motion.elapsed_s * motion.turned;
        result.acted = true;
    }
    return result;
}

double passive_stiffness(double damping, double friction, double resolution, double period_s, double delay_s) {
    const double sampled = 2.0 * damping / (period_s + 2.0 * delay_s);
    const double quantised =
        friction > 0.0 && resolution > 0.0 ? 2.0 * friction / resolution : std::numeric_limits<double>::infinity();
    return std::min(sampled, quantised);
}

}  // namespace haptic::rt
