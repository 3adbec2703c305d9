#include "haptic/device/grip_mechanics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kLevel;

constexpr double kFineStep = 1e-6;  // s

/// Strings so slack that no motion of these tests straightens them: only grip and hand remain.
GripLoad without_strings() {
    GripLoad load;
    load.slack.fill(1.0);
    return load;
}

GripState run(const GripMechanics& mechanics, GripState state, const GripLoad& load, double step_s, double time_s) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    for (long k = 0; k < std::lround(time_s / step_s); ++k) {
        state = step(geometry, mechanics, state, load, step_s);
    }
    return state;
}

/// Deflection of a damped oscillator released at x0 from rest.
double oscillator(double x0, double mass, double damping, double stiffness, double time_s) {
    const double decay = damping / (2.0 * mass);
    const double rate = std::sqrt(stiffness / mass - decay * decay);
    return x0 * std::exp(-decay * time_s) * (std::cos(rate * time_s) + decay / rate * std::sin(rate * time_s));
}

GripMechanics weakly_damped() {
    GripMechanics mechanics;
    mechanics.hand_damping = 0.5;
    mechanics.hand_rotational_damping = 1e-4;
    return mechanics;
}

TEST(GripMechanics, GripOnTheHandsSpringIsADampedOscillator) {
    const GripMechanics mechanics = weakly_damped();
    const Vec3 start(0.01, -0.004, 0.007);
    GripState state = grip_at_rest(spidar_g6_x3r(), {start, kLevel});
    for (double time_s = 0.05; time_s < 0.3; time_s += 0.05) {
        state = run(mechanics, state, without_strings(), kFineStep, 0.05);
        for (int k = 0; k < 3; ++k) {
            // First-order error: phase of half a step at 63 rad/s, 3e-5 of the amplitude.
            EXPECT_NEAR(state.pose.position[k],
                        oscillator(start[k], mechanics.mass, mechanics.damping + mechanics.hand_damping,
                                   mechanics.hand_stiffness, time_s),
                        5e-5 * std::abs(start[k]));
        }
    }
}

TEST(GripMechanics, GripTurnsOnTheHandsSpringAsADampedOscillator) {
    GripMechanics mechanics = weakly_damped();
    mechanics.inertia = Vec3(2e-5, 3e-5, 4e-5);
    for (int axis = 0; axis < 3; ++axis) {
        Vec3 imaginary(0.0, 0.0, 0.0);
        constexpr double kStart = 0.01;  // rad: the spring's sine is linear to 2e-6
        imaginary[axis] = std::sin(kStart / 2.0);
        const Quat turn(std::cos(kStart / 2.0), imaginary.x, imaginary.y, imaginary.z);
        const GripState state =
            run(mechanics, grip_at_rest(spidar_g6_x3r(), {{}, turn}), without_strings(), kFineStep, 0.08);
        const Vec3 now(state.pose.orientation.x, state.pose.orientation.y, state.pose.orientation.z);
        EXPECT_NEAR(2.0 * now[axis],
                    oscillator(kStart, mechanics.inertia[axis],
                               mechanics.rotational_damping + mechanics.hand_rotational_damping,
                               mechanics.hand_rotational_stiffness, 0.08),
                    2e-4 * kStart)
            << "axis " << axis;
    }
}

TEST(GripMechanics, FreeGripKeepsItsMomentaExactlyAndItsEnergyToTheOrderOfTheStep) {
    GripMechanics mechanics;
    mechanics.hand = Hand::Free;
    mechanics.damping = 0.0;
    mechanics.rotational_damping = 0.0;
    mechanics.inertia = Vec3(1e-5, 2e-5, 4e-5);  // tumbles about all three axes
    GripState state = grip_at_rest(spidar_g6_x3r(), {});
    state.velocity = Vec3(0.1, -0.2, 0.05);
    state.angular_momentum = Vec3(1e-4, 2e-4, -1.5e-4);  // about 10 rad/s
    const auto energy = [&](const GripState& s) {
        const Twist twist = twist_of(mechanics, s);
        return 0.5 * glm::dot(s.angular_momentum, twist.angular);
    };
    const GripState end = run(mechanics, state, without_strings(), 5e-5, 1.0);
    EXPECT_EQ(end.velocity, state.velocity);
    EXPECT_EQ(end.angular_momentum, state.angular_momentum);
    EXPECT_NEAR(energy(end), energy(state), 2e-3 * energy(state));
    EXPECT_NEAR(glm::length(end.pose.position - state.velocity), 0.0, 1e-12);
    EXPECT_NEAR(glm::length(end.pose.orientation), 1.0, 1e-14);
}

/// Energy of grip, strings and motors; motors with constant tension contribute a potential. Losses in drag, friction
/// and dampers are counted separately. Derived from the equations, without the kernel's tensions.
struct Ledger {
    const DeviceGeometry geometry = spidar_g6_x3r();
    GripMechanics m;
    GripLoad load;

    double stretch(const GripState& s, std::size_t i) const {
        return glm::length(geometry.strings[i].motor - s.pose.position -
                           s.pose.orientation * geometry.strings[i].grip) -
               s.length[i] - load.slack[i];
    }
    double energy(const GripState& s) const {
        const Twist twist = twist_of(m, s);
        double sum =
            0.5 * m.mass * glm::dot(s.velocity, s.velocity) + 0.5 * glm::dot(s.angular_momentum, twist.angular);
        for (std::size_t i = 0; i < kStrings; ++i) {
            sum += 0.5 * m.motor_mass * s.length_rate[i] * s.length_rate[i] + load.pull[i] * s.length[i];
            const double e = stretch(s, i);
            sum += e > 0.0 ? 0.5 * m.string_stiffness * e * e : 0.0;
        }
        if (m.hand == Hand::Impedance) {
            const Vec3 displacement = load.hand.position - s.pose.position;
            const double half = std::acos(std::min(1.0, std::abs(glm::dot(load.hand.orientation, s.pose.orientation))));
            sum += 0.5 * m.hand_stiffness * glm::dot(displacement, displacement) +
                   4.0 * m.hand_rotational_stiffness * (1.0 - std::cos(half));
        }
        return sum;
    }
    /// W, from two states one step apart.
    double loss(const GripState& a, const GripState& b, double step_s) const {
        const Twist twist = twist_of(m, b);
        const bool hand = m.hand == Hand::Impedance;
        double sum =
            (m.damping + (hand ? m.hand_damping : 0.0)) * glm::dot(twist.linear, twist.linear) +
            (m.rotational_damping + (hand ? m.hand_rotational_damping : 0.0)) * glm::dot(twist.angular, twist.angular);
        for (std::size_t i = 0; i < kStrings; ++i) {
            const double speed = b.length_rate[i];
            sum += m.motor_drag * speed * speed + m.motor_friction * std::abs(speed);
            const double rate = (stretch(b, i) - stretch(a, i)) / step_s;
            // A damper that would push is inactive; the spring then only returns its stored energy.
            if (stretch(a, i) > 0.0) {
                const double push = std::max(m.string_damping * rate, -m.string_stiffness * stretch(a, i));
                sum += push * rate;
            }
        }
        return sum;
    }
};

Ledger shaken(Hand hand) {
    Ledger ledger;
    ledger.m.hand = hand;
    ledger.load.pull = {1.0, 0.4, 2.0, 0.3, 0.7, 1.5, 0.3, 0.9};
    return ledger;
}

GripState struck() {
    const Quat turn = glm::normalize(Quat(1.0, 0.05, -0.1, 0.07));
    GripState state = grip_at_rest(spidar_g6_x3r(), {{0.008, -0.012, 0.004}, turn});
    state.velocity = Vec3(0.6, -0.3, 0.4);
    state.angular_momentum = Vec3(2e-4, -3e-4, 1e-4);
    return state;
}

TEST(GripMechanics, EnergyThatIsLostIsWhatDampersAndFrictionTook) {
    for (const Hand hand : {Hand::Impedance, Hand::Free}) {
        const Ledger ledger = shaken(hand);
        GripState state = struck();
        const double before = ledger.energy(state);
        double lost = 0.0;
        for (int k = 0; k < 100'000; ++k) {
            const GripState next = step(ledger.geometry, ledger.m, state, ledger.load, kFineStep);
            lost += kFineStep * ledger.loss(state, next, kFineStep);
            state = next;
        }
        // About 40 mJ are exchanged; the method is of first order.
        EXPECT_GT(lost, 0.01);
        EXPECT_NEAR(ledger.energy(state) + lost, before, 0.005 * lost);
    }
}

TEST(GripMechanics, EnergyNeverRisesUnderConstantMotors) {
    for (const Hand hand : {Hand::Impedance, Hand::Free}) {
        const Ledger ledger = shaken(hand);
        GripState state = struck();
        double lowest = ledger.energy(state);
        const double swing = 0.05 * 0.5 * ledger.m.mass * glm::dot(state.velocity, state.velocity);
        for (int k = 0; k < 40'000; ++k) {  // 2 s at a device's step
            state = step(ledger.geometry, ledger.m, state, ledger.load, 5e-5);
            const double energy = ledger.energy(state);
            // Semi-implicit Euler conserves a modified energy; the true energy oscillates with the step.
            ASSERT_LT(energy, lowest + swing) << "step " << k;
            lowest = std::min(lowest, energy);
        }
    }
}

TEST(GripMechanics, RestsWhereTheMotorsPullsAndTheHandsSpringAreInBalance) {
    Ledger ledger = shaken(Hand::Impedance);
    ledger.m.motor_friction = 0.0;
    const GripState state = run(ledger.m, struck(), ledger.load, 5e-5, 5.0);
    EXPECT_LT(glm::length(state.velocity), 1e-9);
    // Oracle: force and torque from the strings' directions and the motors' tensions.
    Vec3 force(0.0, 0.0, 0.0);
    Vec3 torque(0.0, 0.0, 0.0);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec3 arm = state.pose.orientation * ledger.geometry.strings[i].grip;
        const Vec3 span = ledger.geometry.strings[i].motor - state.pose.position - arm;
        force += glm::normalize(span) * ledger.load.pull[i];
        torque += glm::cross(arm, glm::normalize(span)) * ledger.load.pull[i];
        EXPECT_NEAR(glm::length(span) - state.length[i], ledger.load.pull[i] / ledger.m.string_stiffness, 1e-10);
    }
    const double half =
        std::asin(glm::length(Vec3(state.pose.orientation.x, state.pose.orientation.y, state.pose.orientation.z)));
    EXPECT_GT(glm::length(force), 0.3);
    EXPECT_NEAR(glm::length(force - state.pose.position * ledger.m.hand_stiffness), 0.0, 1e-6);
    EXPECT_NEAR(glm::length(torque), 2.0 * std::sin(half) * ledger.m.hand_rotational_stiffness, 1e-8);
}

TEST(GripMechanics, SlackStringsPullNothing) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    const GripMechanics mechanics;
    GripState state = grip_at_rest(geometry, {});
    state.pose.position = Vec3(-0.01, 0.0, 0.0);  // toward motors 0 and 4
    state.velocity = Vec3(-5.0, 0.0, 0.0);        // any speed
    const auto tensions = string_tensions(geometry, mechanics, state, {});
    EXPECT_EQ(tensions[0], 0.0);
    EXPECT_EQ(tensions[4], 0.0);
    EXPECT_GT(tensions[2], 100.0);
    EXPECT_GT(tensions[6], 100.0);
}

TEST(GripMechanics, DamperNeverPushes) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    GripMechanics mechanics;
    mechanics.string_damping = 100.0;
    GripState state = grip_at_rest(geometry, {});
    for (double& length : state.length) {
        length -= 1e-6;  // taut with 20 mN
    }
    state.velocity = Vec3(-1.0, 0.0, 0.0);
    for (const double tension : string_tensions(geometry, mechanics, state, {})) {
        EXPECT_GE(tension, 0.0);
    }
}

TEST(GripMechanics, MotorReelsASlackStringInWithFiniteSpeed) {
    const GripMechanics mechanics;
    GripLoad load = without_strings();
    load.held = true;
    load.pull.fill(0.3);
    const GripState start = grip_at_rest(spidar_g6_x3r(), {});
    // m v' = -(pull - friction) - b v has the solution below.
    const double final_speed = (0.3 - mechanics.motor_friction) / mechanics.motor_drag;
    const double time_constant = mechanics.motor_mass / mechanics.motor_drag;
    constexpr double kTime = 0.05;
    const GripState end = run(mechanics, start, load, kFineStep, kTime);
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_NEAR(end.length_rate[i], -final_speed * (1.0 - std::exp(-kTime / time_constant)), 1e-4);
        EXPECT_NEAR(start.length[i] - end.length[i],
                    final_speed * (kTime - time_constant * (1.0 - std::exp(-kTime / time_constant))), 1e-5);
    }
    EXPECT_EQ(end.pose.position, start.pose.position);
}

TEST(GripMechanics, FrictionHoldsAMotorThatPullsLess) {
    const GripMechanics mechanics;
    GripLoad load = without_strings();
    load.pull.fill(0.9 * mechanics.motor_friction);
    const GripState start = grip_at_rest(spidar_g6_x3r(), {});
    EXPECT_EQ(run(mechanics, start, load, 5e-5, 0.1).length, start.length);
}

TEST(GripMechanics, StringIsNeverReeledInBeyondItsPulley) {
    const GripMechanics mechanics;
    GripLoad load = without_strings();
    load.pull.fill(27.0);
    for (const double length : run(mechanics, grip_at_rest(spidar_g6_x3r(), {}), load, 5e-5, 1.0).length) {
        EXPECT_EQ(length, 0.0);
    }
}

TEST(GripMechanics, LongestStepIsStableForAnyPoseAndALargerOneIsNot) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (const double stiffness : {5e3, 2e4, 2e5}) {
        for (int k = 0; k < 20; ++k) {
            GripMechanics mechanics;
            mechanics.string_stiffness = stiffness;
            mechanics.string_damping = 1.0 + unit(random);
            mechanics.hand = k % 2 == 0 ? Hand::Impedance : Hand::Free;
            GripLoad load;
            load.pull.fill(20.0);
            load.hand.position = 0.02 * Vec3{unit(random), unit(random), unit(random)};
            load.hand.orientation =
                glm::normalize(Quat(1.0, 0.3 * unit(random), 0.3 * unit(random), 0.3 * unit(random)));
            const double longest = longest_step_s(geometry, mechanics);
            const auto fastest = [&](double step_s) {
                GripState state = grip_at_rest(geometry, load.hand);
                double speed = 0.0;
                for (int n = 0; n < 4000; ++n) {
                    state = step(geometry, mechanics, state, load, step_s);
                    speed = std::max(speed, glm::length(state.velocity));
                }
                return std::isfinite(speed) ? speed : std::numeric_limits<double>::infinity();
            };
            EXPECT_LT(fastest(longest), 5.0) << stiffness << " N/m, case " << k;
            EXPECT_GT(fastest(12.0 * longest), 50.0) << stiffness << " N/m, case " << k;
        }
    }
}

TEST(GripMechanics, RefusesWhatCannotBe) {
    GripMechanics wrong;
    wrong.mass = 0.0;
    EXPECT_THROW(validate(wrong), std::invalid_argument);
    wrong = {};
    wrong.inertia.y = -1.0;
    EXPECT_THROW(validate(wrong), std::invalid_argument);
    wrong = {};
    wrong.hand_damping = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(validate(wrong), std::invalid_argument);
    wrong = {};
    wrong.motor_friction = -0.1;
    try {
        validate(wrong);
        FAIL() << "a negative friction was taken";
    } catch (const std::invalid_argument& error) {
        EXPECT_STREQ(error.what(), "grip mechanics: motor_friction must be finite and not negative");
    }
    EXPECT_NO_THROW(validate(GripMechanics{}));
}

}  // namespace
}  // namespace haptic::device
