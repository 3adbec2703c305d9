// A tool of 37 spheres slides over a rigid plate, host-sim at 50 steps/s under rt-core at 1 kHz: the slow simulation
// must not be felt. Claim AT9; figure 5.7 of the thesis shows the other scheme.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <span>
#include <string>
#include <vector>

#include "lockstep.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::test {
namespace {

constexpr double kSpeed = 0.3;       // m/s
constexpr double kStep = 0.02;       // s, of the simulation
constexpr double kSlideTick = 1e-3;  // s
constexpr double kRamp = 0.4;        // s, down to the plane and to the start of the slide
constexpr double kSlide = 0.1;       // s: 30 mm, a range in which the strings can make every wrench
constexpr double kPlane = -0.007;    // m, scene, at scale 1
constexpr double kDepth = 0.003;     // m, of the rod below the plate's face

struct SlideCase {
    double stiffness;        // N/m
    Quat device_from_scene;  // tilts the plate relative to the device
    double turn;             // rad/s, of the grip about the plate's normal during the slide
    std::string multi_rate;
};

sim::Scene scene_of(const SlideCase& c) {
    const Quat& q = c.device_from_scene;
    const std::string k = std::to_string(c.stiffness);
    return sim::read_scene(
        Config::parse("[model]\ngenerator = \"plate\"\nsize = [0.3, 0.02, 0.3]\ncells = 8\noffset = [0.0, " +
                          std::to_string(kPlane - 0.01) +
                          ", 0.0]\n[solver]\nstep = 0.02\niterations = 1\n"
                          "[tool]\ngenerator = \"rod\"\nlength = 0.05\nthickness = 0.01\nspheres = 37\n"
                          "[proxy]\nreach = 0.002\n[coupling]\nhunt_crossley_damping = 0.0\nmulti_rate = \"" +
                          c.multi_rate + "\"\nstiffness = " + k + "\ntorque_stiffness = " + k +
                          "\n[hand]\ntimes = [0.0, 1.0]\npositions = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
                          "[workspace]\nscale = 1.0\nforce_scale = 1.0\nrotation = [" +
                          std::to_string(q.w) + ", " + std::to_string(q.x) + ", " + std::to_string(q.y) + ", " +
                          std::to_string(q.z) + "]\n",
                      "slide.toml"),
        "slide");
}

PoseTrack hand_of(const SlideCase& c) {
    std::vector<double> times;
    std::vector<Pose> poses;
    const Vec3 along = c.device_from_scene * Vec3(1, 0, 0);
    const Vec3 normal = c.device_from_scene * Vec3(0, 1, 0);
    const double height = kPlane + 0.005 - kDepth;
    for (int i = 0; i * kSlideTick <= kRamp + kSlide + 2 * kStep; ++i) {
        const double t = i * kSlideTick;
        const double ramp = std::min(t / kRamp, 1.0);
        const double into = ramp * ramp * (3.0 - 2.0 * ramp);
        const double slid = std::clamp(t - kRamp, 0.0, kSlide);
        times.push_back(t);
        poses.push_back(
            {into * (height * normal - 0.5 * kSpeed * kSlide * along) + kSpeed * slid * along,
             glm::angleAxis(c.turn * slid, normal) * glm::slerp(Quat(1, 0, 0, 0), c.device_from_scene, into)});
    }
    return {std::move(times), std::move(poses)};
}

/// Rendered force at constant speed, compared with the thesis' law for the plate.
struct FeltSlide {
    double tangential = 0.0;       // N, most
    double mean_tangential = 0.0;  // N, opposite to the slide
    double ripple = 0.0;           // N, greatest error of the normal force
    double torque_error = 0.0;     // N*m
    double normal = 0.0;           // N, mean
    double host_error = 0.0;       // N, greatest difference between the force on the plate and the rendered one
    int particles = 0;             // greatest number in contact
    int late_ticks = 0;            // ticks in which the plate was pressed without a rendered force
};

Wrench expected_at(const Pose& grip, std::span<const sim::ToolProxy> particles, const SlideCase& c) {
    Wrench wrench;
    const Vec3 normal = c.device_from_scene * Vec3(0, 1, 0);
    for (const sim::ToolProxy& p : particles) {
        const Vec3 moment_arm = grip.orientation * p.rest_offset;
        const double depth = kPlane + p.radius * 0.999 - glm::dot(normal, grip.position + moment_arm);
        const Vec3 force = c.stiffness / static_cast<double>(particles.size()) * std::max(0.0, depth) * normal;
        wrench.force += force;
        wrench.torque += glm::cross(moment_arm, force);
    }
    return wrench;
}

FeltSlide run(const SlideCase& c) {
    Lockstep chain({.scene = scene_of(c), .hand = hand_of(c), .tick = {}});
    const Vec3 normal = c.device_from_scene * Vec3(0, 1, 0);
    const Vec3 along = c.device_from_scene * Vec3(1, 0, 0);
    FeltSlide felt;
    int ticks = 0;
    int measured = 0;
    while (ticks * kSlideTick < kRamp + kSlide) {
        Vec3 rendered(0.0);
        const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            const double t = ticks++ * kSlideTick;
            rendered = tick.rendered.force;
            const Wrench expected = expected_at(tick.pose, chain.simulation().tool().particles(), c);
            const double pressed = glm::dot(tick.rendered.force, normal);
            felt.late_ticks += glm::length(expected.force) > 1e-3 && pressed == 0.0 ? 1 : 0;
            if (t < kRamp + 0.01 || t > kRamp + kSlide) {
                return;
            }
            const Vec3 tangential = tick.rendered.force - pressed * normal;
            felt.tangential = std::max(felt.tangential, glm::length(tangential));
            felt.mean_tangential -= glm::dot(tangential, along);
            felt.ripple = std::max(felt.ripple, std::fabs(pressed - glm::dot(expected.force, normal)));
            felt.torque_error = std::max(felt.torque_error, glm::length(tick.rendered.torque - expected.torque));
            felt.normal += pressed;
            felt.particles = std::max(felt.particles, static_cast<int>(tick.in_contact));
            ++measured;
        });
        if (ticks * kSlideTick > kRamp + 2 * kStep) {
            felt.host_error = std::max(felt.host_error, glm::length(result.hand_force - rendered));
        }
    }
    felt.normal /= measured;
    felt.mean_tangential /= measured;
    return felt;
}

double drag_of(const SlideCase& c) {
    return c.stiffness * kSpeed * kStep;
}

void print_result(const char* name, const SlideCase& c, const FeltSlide& felt) {
    std::printf(
        "%s, k %g: %d in contact, normal %.4g N, tangential at most %.2g, mean %.2g of k v T, ripple %.2g, host %.2g "
        "N\n",
        name, c.stiffness, felt.particles, felt.normal, felt.tangential / drag_of(c), felt.mean_tangential / drag_of(c),
        felt.ripple / felt.normal, felt.host_error);
}

TEST(SlidingTool, HasNeitherDragNorRippleFromASimulationAt50StepsPerSecond) {
    const Quat level(1, 0, 0, 0);
    const Quat tilted = glm::angleAxis(0.25, glm::normalize(Vec3(0.6, 0.0, -0.8)));
    for (const double stiffness : {20.0, 500.0}) {
        for (const SlideCase& c :
             {SlideCase{stiffness, level, 0.0, "planes"}, SlideCase{stiffness, tilted, 1.5, "planes"}}) {
            const FeltSlide felt = run(c);
            print_result("planes", c, felt);
            EXPECT_EQ(felt.particles, 37);
            EXPECT_LE(felt.tangential, 0.01 * drag_of(c));
            EXPECT_LE(felt.ripple, 0.01 * felt.normal);
            EXPECT_LE(felt.torque_error, 0.01 * felt.normal * 0.05);
            EXPECT_EQ(felt.late_ticks, 0);
            EXPECT_LE(felt.host_error, 0.02 * felt.normal);
        }
    }
}

TEST(SlidingTool, IsDraggedIfOnlyPositionsAndFlagsAreSent) {
    const SlideCase c{20.0, Quat(1, 0, 0, 0), 0.0, "positions"};
    const FeltSlide felt = run(c);
    print_result("positions", c, felt);
    EXPECT_GT(felt.mean_tangential, 0.3 * drag_of(c));
    EXPECT_GT(felt.tangential, 0.8 * drag_of(c));
}

TEST(StickingTool, SticksAtTheSamePointInBothProcesses) {
    // Obliquely down onto a rough plate, along it by a millimetre, then at rest: each process finds the contact at its
    // own time.
    const sim::Scene scene = sim::read_scene(
        Config::parse(
            "[model]\ngenerator = \"plate\"\nsize = [0.3, 0.02, 0.3]\ncells = 8\noffset = [0.0, -0.017, 0.0]\n"
            "[solver]\nstep = 0.02\niterations = 1\n"
            "[proxy]\nradius = 0.005\nreach = 0.002\nstatic_friction = 0.9\ndynamic_friction = 0.9\n"
            "[coupling]\nhunt_crossley_damping = 0.0\nstiffness = 100.0\n"
            "[hand]\ntimes = [0.0, 1.0]\npositions = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
            "[workspace]\nscale = 1.0\nforce_scale = 1.0\n",
            "stick.toml"),
        "stick");
    const std::vector<double> times{0.0, 0.055, 0.11, 2.0};
    const Quat still(1, 0, 0, 0);
    const std::vector<Pose> poses{
        {}, {Vec3(0.004, -0.0035, 0.0), still}, {Vec3(0.005, -0.007, 0.0), still}, {Vec3(0.005, -0.007, 0.0), still}};
    Lockstep chain({.scene = scene, .hand = {times, poses}, .tick = {}});
    double first = -1.0;  // m, between the two positions
    double last = 0.0;
    double force = 0.0;
    for (int i = 0; i < 50; ++i) {
        const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            last = tick.in_contact > 0 ? glm::length(tick.proxy - chain.simulation().proxy()) : 0.0;
            force = tick.rendered.force.x;
        });
        first = first < 0.0 && result.in_contact ? last : first;
    }
    std::printf("sticks %.3g m apart at first, %.3g m in the end; %.4g N along the plate\n", first, last, force);
    EXPECT_GT(first, 1e-4);
    EXPECT_LT(last, 1e-5);
    EXPECT_LT(force, -0.01);
}

}  // namespace
}  // namespace haptic::test
