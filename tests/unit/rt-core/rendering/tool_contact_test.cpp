// Tool contact with many particles; tests of a single particle are in renderer_test.cpp.
#include "rendering/tool_contact.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>

#include "random.hpp"
#include "rendering/renderer.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;

constexpr double kStiffness = 300.0;  // N/m

/// `count` particles spread over a ball of 25 mm about the grip, each with the floor y = 0 as its plane.
ContactFrame ball(std::size_t count, std::uint32_t flags = 0) {
    test::Random random(7);
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.flags = flags;
    frame.proxy_count = static_cast<std::uint32_t>(count);
    for (std::size_t i = 0; i < count; ++i) {
        frame.proxies[i] = frame.proxies[0];
        store(0.025 * random.direction(), frame.proxies[i].rest_offset);
    }
    return frame;
}

/// One particle 20 mm to the side of the grip.
ContactFrame arm(std::uint32_t flags = 0) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.flags = flags;
    store(Vec3(0.02, 0.0, 0.0), frame.proxies[0].rest_offset);
    return frame;
}

Pose level(double y) {
    return {Vec3(0.0, y, 0.0), Quat(1, 0, 0, 0)};
}

TEST(ToolContact, UsesTheTorqueStiffnessForTheTorque) {
    ContactFrame frame = ball(37);
    const Pose grip{Vec3(0.0, 0.01, 0.0), glm::angleAxis(0.3, Vec3(1, 0, 0))};
    const Contact same = render(frame, grip, {}, 0);
    frame.torque_stiffness = kStiffness / 4.0;
    const Contact softer = render(frame, grip, {}, 0);
    ASSERT_GT(same.in_contact, 3u);
    ASSERT_GT(glm::length(same.wrench.torque), 1e-4);
    EXPECT_EQ(softer.wrench.force, same.wrench.force);
    EXPECT_LT(glm::length(softer.wrench.torque - same.wrench.torque / 4.0), 1e-12);
}

TEST(ToolContact, InSeriesYieldsToAMomentArmByRotating) {
    // One particle at a moment arm r perpendicular to the normal: |a|^2 = 1 + (r / rho)^2 with rho^2 = 2/3 r^2, in
    // series with the particle's own spring: F = k d / (1 + 1 + 3/2).
    const Contact contact = render(arm(HAPTIC_FRAME_SERIES_SPRINGS), level(-0.004), {}, 0);
    EXPECT_NEAR(contact.wrench.force.y, kStiffness * 0.004 / 3.5, 1e-12);
    EXPECT_NEAR(contact.wrench.torque.z, 0.02 * contact.wrench.force.y, 1e-12);
    EXPECT_NEAR(contact.stored, 0.5 * kStiffness * 0.004 * 0.004 / 3.5, 1e-12);
}

TEST(ToolContact, InSeriesDoesNotWeakenWithTheNumberOfParticles) {
    const auto force = [](std::size_t count, std::uint32_t flags) {
        return render(ball(count, flags), level(0.015), {}, 0).wrench.force.y;
    };
    EXPECT_GT(force(64, HAPTIC_FRAME_SERIES_SPRINGS), force(16, HAPTIC_FRAME_SERIES_SPRINGS));
    EXPECT_GT(force(16, HAPTIC_FRAME_SERIES_SPRINGS), 0.3 * kStiffness * 0.005);
    EXPECT_LT(force(64, HAPTIC_FRAME_SERIES_SPRINGS), kStiffness * 0.01);
    EXPECT_LT(force(64, 0), 0.3 * force(64, HAPTIC_FRAME_SERIES_SPRINGS)) << "the mean of the thesis";
}

TEST(ToolContact, DividesTheDampingAmongSpringsInSeries) {
    ContactFrame frame = ball(37, HAPTIC_FRAME_SERIES_SPRINGS);
    const Pose pressed = level(-0.03);  // all particles
    const double spring = render(frame, pressed, {}, 0).wrench.force.y;
    frame.damping = 2.0;
    EXPECT_NEAR(render(frame, pressed, {{0.1, -0.1, 0.0}, {}}, 0).wrench.force.y, spring + 0.2, 1e-12);
    EXPECT_EQ(render(frame, pressed, {{0.0, 1e3, 0.0}, {}}, 0).wrench.force, Vec3(0.0)) << "it never pulls";
}

TEST(ToolContact, GivesNoEnergyOverAClosedPath) {
    // Down while level, tilted while down, up while tilted, level again: a mean over the touching particles would give
    // energy on this path.
    for (const std::uint32_t flags : {0u, std::uint32_t{HAPTIC_FRAME_SERIES_SPRINGS}}) {
        const ContactFrame frame = ball(37, flags);
        constexpr int steps = 4000;
        double given = 0.0;
        double taken = 0.0;
        for (int i = 0; i < steps; ++i) {
            const double angle = 2.0 * std::numbers::pi * (i + 0.5) / steps;
            const double step = 2.0 * std::numbers::pi / steps;
            const Pose grip{Vec3(0.0, 0.012 - 0.012 * std::cos(angle), 0.0),
                            glm::angleAxis(0.4 * std::sin(angle), Vec3(0, 0, 1))};
            const Wrench wrench = render(frame, grip, {}, 0).wrench;
            const double work =
                wrench.force.y * 0.012 * std::sin(angle) * step + wrench.torque.z * 0.4 * std::cos(angle) * step;
            given += work;
            taken += std::max(0.0, -work);
        }
        EXPECT_GT(taken, 1e-4);
        EXPECT_LT(std::fabs(given), 1e-5 * taken) << flags;
    }
}

TEST(ToolContact, WithHeldPositionsUsesTheFramesPositionsAndIgnoresPlanes) {
    for (const std::uint32_t flags : {0u, std::uint32_t{HAPTIC_FRAME_SERIES_SPRINGS}}) {
        ContactFrame frame = ball(37, HAPTIC_FRAME_HOLD_POSITIONS | flags);
        const Pose below = level(-0.05);
        EXPECT_EQ(render(frame, below, {}, 0).wrench.force, Vec3(0.0)) << "the frame reports no touching particle";
        frame.proxies[4].in_contact = HAPTIC_PROXY_TOUCHES;
        const Vec3 goal = below.position + to_vec3(frame.proxies[4].rest_offset);
        store(goal + Vec3(-0.002, 0.003, 0.0), frame.proxies[4].position);
        const Contact contact = render(frame, below, {}, 0);
        EXPECT_EQ(contact.in_contact, 1u);
        EXPECT_NEAR(contact.wrench.force.x / contact.wrench.force.y, -2.0 / 3.0, 1e-9) << "the held position drags";
        if (flags == 0) {
            EXPECT_NEAR(contact.wrench.force.y, kStiffness * 0.003 / 37.0, 1e-12);
        }
    }
}

TEST(ToolContact, StaysInTheFrictionConeWithSpringsInSeries) {
    ContactFrame frame = ball(37, HAPTIC_FRAME_SERIES_SPRINGS);
    frame.static_friction = 0.8;
    frame.dynamic_friction = 0.5;
    ToolMemory memory;
    const auto push = [&](double x) {
        const Pose grip{Vec3(x, -0.03, 0.0), Quat(1, 0, 0, 0)};
        return render(frame, stiffness_of(frame), {grip, {}, grip, 0.0}, 0, memory).wrench.force;
    };
    EXPECT_EQ(push(0.0).x, 0.0);
    const Vec3 stuck = push(0.001);
    EXPECT_LT(stuck.x, 0.0);
    EXPECT_GT(stuck.x, -0.8 * stuck.y);
    const Vec3 slides = push(0.2);
    EXPECT_NEAR(slides.x, -0.5 * slides.y, 1e-9 * slides.y);
}

TEST(ToolContact, ConvergesToTheStickingPositionOfTheSimulation) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.static_friction = frame.dynamic_friction = 0.8;
    frame.step_ns = kNanosecondsPerSecond;
    const Pose grip{Vec3(0.0, -0.004, 0.0), Quat(1, 0, 0, 0)};
    for (const std::uint32_t bits : {std::uint32_t{HAPTIC_PROXY_TOUCHES},
                                     std::uint32_t{HAPTIC_PROXY_TOUCHES} | std::uint32_t{HAPTIC_PROXY_STICKS}}) {
        frame.proxies[0].in_contact = bits;
        store(Vec3(0.002, 0.0, 0.0), frame.proxies[0].position);
        ToolMemory memory;
        Contact contact;
        double before = 0.0;
        for (int i = 0; i < 1500; ++i) {
            contact = render(frame, stiffness_of(frame), {grip, {}, grip, 1e-3}, std::int64_t{1'000'000} * i, memory);
            ASSERT_LE(contact.wrench.force.x - before, kStiffness * 0.002 / 100.0 + 1e-12)
                << "pulled gradually, without a step";
            before = contact.wrench.force.x;
        }
        const bool sticks = (bits & HAPTIC_PROXY_STICKS) != 0;
        EXPECT_NEAR(contact.wrench.force.x, sticks ? kStiffness * 0.002 : 0.0, 1e-5);
    }
}

TEST(FrameRendererOfATool, LowersTheTorqueStiffnessToTheRotationalLimit) {
    for (const std::uint32_t flags : {0u, std::uint32_t{HAPTIC_FRAME_SERIES_SPRINGS}}) {
        FrameSettings settings;
        settings.max_rotational_stiffness = 0.05;
        const auto felt = [&](double torque_stiffness) {
            FrameRenderer renderer(settings);
            ContactFrame& frame = renderer.inbox();
            frame = arm(flags);
            frame.torque_stiffness = torque_stiffness;
            EXPECT_EQ(renderer.accept(0), FrameDefect::None);
            FrameRenderer::Result result;
            for (int i = 0; i < 60; ++i) {
                result = renderer.render(level(-0.004), {}, 0, 1'000'000);
            }
            return result;
        };
        const double squared_arm = flags == 0 ? 0.02 * 0.02 : 0.02 * 0.02 * 2.0 / 3.0;  // m^2
        const FrameRenderer::Result within = felt(0.05 / squared_arm * 0.99);
        EXPECT_FALSE(within.stiffness_limited);
        const FrameRenderer::Result most = felt(0.05 / squared_arm * 1.01);
        const FrameRenderer::Result more = felt(50.0 / squared_arm);
        EXPECT_TRUE(most.stiffness_limited);
        EXPECT_TRUE(more.stiffness_limited);
        EXPECT_NEAR(more.contact.wrench.torque.z, most.contact.wrench.torque.z, 1e-12);
        EXPECT_NEAR(more.contact.wrench.torque.z / within.contact.wrench.torque.z, 1.0, 0.02);
    }
}

}  // namespace
}  // namespace haptic::rt
