#include "haptic/device/grip_mechanics.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace haptic::device {
namespace {

// m; a shorter string has no defined direction.
constexpr double kShortest = 1e-9;

struct StringGeometry {
    Vec3 moment_arm{0.0, 0.0, 0.0};  // m, r_i: from the grip's centre to the knot, device frame
    Vec3 direction{0.0, 0.0, 0.0};   // u_i: unit, from knot to motor; zero if the knot is in the pulley
    double length = 0.0;             // m
};

StringGeometry geometry_of(const StringFacts& string, const Pose& grip) HAPTIC_RT {
    StringGeometry geometry;
    geometry.moment_arm = grip.orientation * string.grip;
    const Vec3 span = string.motor - (grip.position + geometry.moment_arm);
    geometry.length = std::sqrt(glm::dot(span, span));
    if (geometry.length > kShortest) {
        geometry.direction = span / geometry.length;
    }
    return geometry;
}

/// w = R I^-1 R^T L, with the inertia I diagonal in the grip frame.
Vec3 angular_velocity(const GripMechanics& mechanics, const GripState& state) HAPTIC_RT {
    const Vec3 in_grip = glm::conjugate(state.pose.orientation) * state.angular_momentum;
    return state.pose.orientation * (in_grip / mechanics.inertia);
}

/// T = max(0, k e + c e') of a string whose unloaded length, slack included, is `unloaded`.
double tension_of(const GripMechanics& mechanics, const StringGeometry& geometry, const Twist& twist, double unloaded,
                  double unloaded_rate) HAPTIC_RT {
    // e: a string that is not stretched is slack and cannot push.
    const double stretch = geometry.length - unloaded;
    if (!(stretch > 0.0)) {
        return 0.0;
    }
    // e': the string shortens by the knot's velocity toward the motor and lengthens as the motor reels in.
    const Vec3 knot_velocity = twist.linear + glm::cross(twist.angular, geometry.moment_arm);
    const double rate = -glm::dot(geometry.direction, knot_velocity) - unloaded_rate;
    return std::max(0.0, mechanics.string_stiffness * stretch + mechanics.string_damping * rate);
}

/// Semi-implicit Euler: momenta from the wrench, then the pose from the new momenta.
void move_grip(const GripMechanics& mechanics, const Wrench& wrench, double step_s, GripState& state) HAPTIC_RT {
    state.velocity += wrench.force * (step_s / mechanics.mass);
    state.angular_momentum += wrench.torque * step_s;
    state.pose.position += state.velocity * step_s;
    state.pose.orientation = rotated(state.pose.orientation, angular_velocity(mechanics, state) * step_s);
}

/// m s'' = T - pull - b s' - friction sign(s'), where `force` is T - pull.
void move_motor(const GripMechanics& mechanics, double force, double step_s, double& length, double& rate) HAPTIC_RT {
    // Coulomb friction reduces the frictionless velocity toward zero and never beyond, so that it cannot reverse it.
    const double frictionless = rate + (force - mechanics.motor_drag * rate) * (step_s / mechanics.motor_mass);
    const double max_reduction = mechanics.motor_friction * (step_s / mechanics.motor_mass);
    rate = std::copysign(std::max(0.0, std::fabs(frictionless) - max_reduction), frictionless);
    length += rate * step_s;
    if (length < 0.0) {  // the knot has reached the pulley
        length = 0.0;
        rate = 0.0;
    }
}

void require(bool valid, const char* name, const char* what) {
    if (!valid) {
        throw std::invalid_argument(std::string("grip mechanics: ") + name + " must be " + what);
    }
}

double square(double value) HAPTIC_RT {
    return value * value;
}

}  // namespace

void validate(const GripMechanics& m) {
    const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
    const auto not_negative = [](double value) { return std::isfinite(value) && value >= 0.0; };
    require(positive(m.mass), "mass", "finite and above 0");
    require(positive(m.inertia.x) && positive(m.inertia.y) && positive(m.inertia.z), "inertia", "finite and above 0");
    require(positive(m.motor_mass), "motor_mass", "finite and above 0");
    require(positive(m.string_stiffness), "string_stiffness", "finite and above 0");
    for (const auto& [value, name] :
         {std::pair{m.damping, "damping"}, std::pair{m.rotational_damping, "rotational_damping"},
          std::pair{m.string_damping, "string_damping"}, std::pair{m.motor_drag, "motor_drag"},
          std::pair{m.motor_friction, "motor_friction"}, std::pair{m.hand_stiffness, "hand_stiffness"},
          std::pair{m.hand_damping, "hand_damping"},
          std::pair{m.hand_rotational_stiffness, "hand_rotational_stiffness"},
          std::pair{m.hand_rotational_damping, "hand_rotational_damping"}}) {
        require(not_negative(value), name, "finite and not negative");
    }
}

GripState grip_at_rest(const DeviceGeometry& geometry, const Pose& pose) HAPTIC_RT {
    GripState state;
    state.pose = pose;
    for (std::size_t i = 0; i < kStrings; ++i) {
        state.length[i] = geometry_of(geometry.strings[i], pose).length;
    }
    return state;
}

Twist twist_of(const GripMechanics& mechanics, const GripState& state) HAPTIC_RT {
    return {state.velocity, angular_velocity(mechanics, state)};
}

std::array<double, kStrings> string_tensions(const DeviceGeometry& geometry, const GripMechanics& mechanics,
                                             const GripState& state,
                                             const std::array<double, kStrings>& slack) HAPTIC_RT {
    const Twist twist = twist_of(mechanics, state);
    std::array<double, kStrings> tensions{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        tensions[i] = tension_of(mechanics, geometry_of(geometry.strings[i], state.pose), twist,
                                 state.length[i] + slack[i], state.length_rate[i]);
    }
    return tensions;
}

Wrench wrench_of_strings(const DeviceGeometry& geometry, const Pose& grip,
                         const std::array<double, kStrings>& tensions) HAPTIC_RT {
    Wrench sum;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec3 moment_arm = grip.orientation * geometry.strings[i].grip;
        // u_i from knot to motor; a string of zero length has no direction and no effect.
        const Vec3 span = geometry.strings[i].motor - (grip.position + moment_arm);
        const double length = std::sqrt(glm::dot(span, span));
        if (length > 0.0) {
            const Vec3 pull = span * (tensions[i] / length);  // T_i u_i
            sum.force += pull;
            sum.torque += glm::cross(moment_arm, pull);
        }
    }
    return sum;
}

Wrench wrench_of_hand(const GripMechanics& mechanics, const GripState& state, const Pose& hand,
                      const Twist& hand_velocity) HAPTIC_RT {
    // Spring and damper between grip and hand, for position and for orientation.
    const Twist twist = twist_of(mechanics, state);
    return {(hand.position - state.pose.position) * mechanics.hand_stiffness +
                (hand_velocity.linear - twist.linear) * mechanics.hand_damping,
            small_rotation_between(state.pose.orientation, hand.orientation) * mechanics.hand_rotational_stiffness +
                (hand_velocity.angular - twist.angular) * mechanics.hand_rotational_damping};
}

Vec3 small_rotation_between(const Quat& from, const Quat& to) HAPTIC_RT {
    // The imaginary part is axis * sin(angle / 2). q and -q are the same rotation; w >= 0 selects the shorter one.
    const Quat difference = to * glm::conjugate(from);
    return Vec3(difference.x, difference.y, difference.z) * (difference.w < 0.0 ? -2.0 : 2.0);
}

Quat rotated(const Quat& orientation, const Vec3& rotation) HAPTIC_RT {
    // First order: q + (0, rotation) q / 2, normalised.
    const Quat sum = orientation + 0.5 * (Quat(0.0, rotation.x, rotation.y, rotation.z) * orientation);
    const double norm = std::sqrt(sum.w * sum.w + sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    return norm > 0.0 ? sum * (1.0 / norm) : orientation;
}

GripState step(const DeviceGeometry& geometry, const GripMechanics& mechanics, const GripState& state,
               const GripLoad& load, double step_s) HAPTIC_RT {
    const Twist twist = twist_of(mechanics, state);
    GripState next = state;
    // Drag of the grip: -d v and -d_r w.
    Wrench wrench{twist.linear * -mechanics.damping, twist.angular * -mechanics.rotational_damping};
    // Each tension acts on the grip (sum T_i u_i, sum r_i x T_i u_i) and, together with the pull, on its motor.
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringGeometry string_geometry = geometry_of(geometry.strings[i], state.pose);
        const double tension =
            tension_of(mechanics, string_geometry, twist, state.length[i] + load.slack[i], state.length_rate[i]);
        const Vec3 pull = string_geometry.direction * tension;
        wrench.force += pull;
        wrench.torque += glm::cross(string_geometry.moment_arm, pull);
        move_motor(mechanics, tension - load.pull[i], step_s, next.length[i], next.length_rate[i]);
    }
    // A held grip stays where it is: the strings act on the motors only.
    if (load.held) {
        next.velocity = Vec3(0.0, 0.0, 0.0);
        next.angular_momentum = Vec3(0.0, 0.0, 0.0);
        return next;
    }
    // The hand's spring and damper, then the equations of motion.
    if (mechanics.hand == Hand::Impedance) {
        const Wrench hand = wrench_of_hand(mechanics, state, load.hand, load.hand_velocity);
        wrench.force += hand.force;
        wrench.torque += hand.torque;
    }
    move_grip(mechanics, wrench, step_s, next);
    return next;
}

double longest_step_s(const DeviceGeometry& geometry, const GripMechanics& m) {
    // Upper bounds, over all poses, of the largest eigenvalues of M^-1 K and M^-1 C. A string adds J^T k J with the row
    // J = [u, r x u, 1], where |u| = 1 and |r x u| <= |knot|: 1/mass + |knot|^2/inertia for each string. The motors are
    // not coupled with each other, so that 1/motor_mass counts once.
    const double inertia = std::min({m.inertia.x, m.inertia.y, m.inertia.z});
    double strings = 1.0 / m.motor_mass;
    for (const StringFacts& string : geometry.strings) {
        strings += 1.0 / m.mass + glm::dot(string.grip, string.grip) / inertia;
    }
    // Add the largest drag rate, and the hand's spring and damper.
    const bool hand = m.hand == Hand::Impedance;
    double stiffness = m.string_stiffness * strings;
    double damping = m.string_damping * strings +
                     std::max({m.damping / m.mass, m.rotational_damping / inertia, m.motor_drag / m.motor_mass});
    if (hand) {
        stiffness += std::max(m.hand_stiffness / m.mass, m.hand_rotational_stiffness / inertia);
        damping += std::max(m.hand_damping / m.mass, m.hand_rotational_damping / inertia);
    }
    // Stability limit: the positive root h of 4 - 2 h damping - h^2 stiffness = 0. At it h damping < 2 holds as well.
    const double longest = (std::sqrt(square(damping) + 4.0 * stiffness) - damping) / stiffness;
    return 0.5 * longest;
}

}  // namespace haptic::device
