#include <haptic/device/grip_mechanics.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace haptic::device {
namespace {

// A string shorter than this has no direction, m.
constexpr double kShortest = 1e-9;

struct StringGeometry {
    Vec3 arm{0.0, 0.0, 0.0};        // m, from the grip's centre to the knot, device frame
    Vec3 direction{0.0, 0.0, 0.0};  // unit, from knot to motor; zero if the knot is in the pulley
    double length = 0.0;            // m
};

StringGeometry geometry_of(const StringFacts& string, const Pose& grip) HAPTIC_RT {
    StringGeometry geometry;
    geometry.arm = grip.orientation * string.grip;
    const Vec3 span = string.motor - (grip.position + geometry.arm);
    geometry.length = std::sqrt(glm::dot(span, span));
    if (geometry.length > kShortest) {
        geometry.direction = span / geometry.length;
    }
    return geometry;
}

Vec3 angular_velocity(const GripMechanics& mechanics, const GripState& state) HAPTIC_RT {
    const Vec3 in_grip = glm::conjugate(state.pose.orientation) * state.angular_momentum;
    return state.pose.orientation * (in_grip / mechanics.inertia);
}

double tension_of(const GripMechanics& mechanics, const StringGeometry& geometry, const Twist& twist, double unloaded,
                  double unloaded_rate) HAPTIC_RT {
    const double stretch = geometry.length - unloaded;
    if (!(stretch > 0.0)) {
        return 0.0;
    }
    const Vec3 knot = twist.linear + glm::cross(twist.angular, geometry.arm);
    const double rate = -glm::dot(geometry.direction, knot) - unloaded_rate;
    return std::max(0.0, mechanics.string_stiffness * stretch + mechanics.string_damping * rate);
}

void move_grip(const GripMechanics& mechanics, const Wrench& wrench, double step_s, GripState& state) HAPTIC_RT {
    state.velocity += wrench.force * (step_s / mechanics.mass);
    state.angular_momentum += wrench.torque * step_s;
    state.pose.position += state.velocity * step_s;
    state.pose.orientation = turned(state.pose.orientation, angular_velocity(mechanics, state) * step_s);
}

void move_motor(const GripMechanics& mechanics, double force, double step_s, double& length, double& rate) HAPTIC_RT {
    const double pushed = rate + (force - mechanics.motor_drag * rate) * (step_s / mechanics.motor_mass);
    const double stopped_by = mechanics.motor_friction * (step_s / mechanics.motor_mass);
    rate = std::copysign(std::max(0.0, std::fabs(pushed) - stopped_by), pushed);
    length += rate * step_s;
    if (length < 0.0) {  // the knot is in the pulley
        length = 0.0;
        rate = 0.0;
    }
}

void require(bool holds, const char* name, const char* what) {
    if (!holds) {
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

GripState grip_at_rest(const Variant& variant, const Pose& pose) HAPTIC_RT {
    GripState state;
    state.pose = pose;
    for (std::size_t i = 0; i < kStrings; ++i) {
        state.length[i] = geometry_of(variant.strings[i], pose).length;
    }
    return state;
}

Twist twist_of(const GripMechanics& mechanics, const GripState& state) HAPTIC_RT {
    return {state.velocity, angular_velocity(mechanics, state)};
}

std::array<double, kStrings> string_tensions(const Variant& variant, const GripMechanics& mechanics,
                                             const GripState& state,
                                             const std::array<double, kStrings>& slack) HAPTIC_RT {
    const Twist twist = twist_of(mechanics, state);
    std::array<double, kStrings> tensions{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        tensions[i] = tension_of(mechanics, geometry_of(variant.strings[i], state.pose), twist,
                                 state.length[i] + slack[i], state.length_rate[i]);
    }
    return tensions;
}

Wrench wrench_of_strings(const Variant& variant, const Pose& grip,
                         const std::array<double, kStrings>& tensions) HAPTIC_RT {
    Wrench sum;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec3 arm = grip.orientation * variant.strings[i].grip;
        const Vec3 span = variant.strings[i].motor - (grip.position + arm);
        const double length = std::sqrt(glm::dot(span, span));
        if (length > 0.0) {
            const Vec3 pull = span * (tensions[i] / length);
            sum.force += pull;
            sum.torque += glm::cross(arm, pull);
        }
    }
    return sum;
}

Wrench wrench_of_hand(const GripMechanics& mechanics, const GripState& state, const Pose& hand,
                      const Twist& hand_velocity) HAPTIC_RT {
    const Twist twist = twist_of(mechanics, state);
    return {(hand.position - state.pose.position) * mechanics.hand_stiffness +
                (hand_velocity.linear - twist.linear) * mechanics.hand_damping,
            small_turn_between(state.pose.orientation, hand.orientation) * mechanics.hand_rotational_stiffness +
                (hand_velocity.angular - twist.angular) * mechanics.hand_rotational_damping};
}

Vec3 small_turn_between(const Quat& from, const Quat& to) HAPTIC_RT {
    const Quat apart = to * glm::conjugate(from);
    return Vec3(apart.x, apart.y, apart.z) * (apart.w < 0.0 ? -2.0 : 2.0);
}

Quat turned(const Quat& orientation, const Vec3& by) HAPTIC_RT {
    const Quat sum = orientation + 0.5 * (Quat(0.0, by.x, by.y, by.z) * orientation);
    const double norm = std::sqrt(sum.w * sum.w + sum.x * sum.x + sum.y * sum.y + sum.z * sum.z);
    return norm > 0.0 ? sum * (1.0 / norm) : orientation;
}

GripState step(const Variant& variant, const GripMechanics& mechanics, const GripState& state, const GripLoad& load,
               double step_s) HAPTIC_RT {
    const Twist twist = twist_of(mechanics, state);
    GripState next = state;
    Wrench wrench{twist.linear * -mechanics.damping, twist.angular * -mechanics.rotational_damping};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringGeometry geometry = geometry_of(variant.strings[i], state.pose);
        const double tension =
            tension_of(mechanics, geometry, twist, state.length[i] + load.slack[i], state.length_rate[i]);
        const Vec3 pull = geometry.direction * tension;
        wrench.force += pull;
        wrench.torque += glm::cross(geometry.arm, pull);
        move_motor(mechanics, tension - load.pull[i], step_s, next.length[i], next.length_rate[i]);
    }
    if (load.held) {
        next.velocity = Vec3(0.0, 0.0, 0.0);
        next.angular_momentum = Vec3(0.0, 0.0, 0.0);
        return next;
    }
    if (mechanics.hand == Hand::Impedance) {
        const Wrench hand = wrench_of_hand(mechanics, state, load.hand, load.hand_velocity);
        wrench.force += hand.force;
        wrench.torque += hand.torque;
    }
    move_grip(mechanics, wrench, step_s, next);
    return next;
}

double longest_step_s(const Variant& variant, const GripMechanics& m) {
    // Bounds of stiffness and damping by mass, over all poses: a string's row of the Jacobian has a direction of length
    // one and an arm no longer than the knot's.
    const double inertia = std::min({m.inertia.x, m.inertia.y, m.inertia.z});
    double strings = 1.0 / m.motor_mass;
    for (const StringFacts& string : variant.strings) {
        strings += 1.0 / m.mass + glm::dot(string.grip, string.grip) / inertia;
    }
    const bool hand = m.hand == Hand::Impedance;
    double stiffness = m.string_stiffness * strings;
    double damping = m.string_damping * strings +
                     std::max({m.damping / m.mass, m.rotational_damping / inertia, m.motor_drag / m.motor_mass});
    if (hand) {
        stiffness += std::max(m.hand_stiffness / m.mass, m.hand_rotational_stiffness / inertia);
        damping += std::max(m.hand_damping / m.mass, m.hand_rotational_damping / inertia);
    }
    // The positive root of 4 - 2 h damping - h^2 stiffness; there h damping < 2 as well.
    const double longest = (std::sqrt(square(damping) + 4.0 * stiffness) - damping) / stiffness;
    return 0.5 * longest;
}

}  // namespace haptic::device
