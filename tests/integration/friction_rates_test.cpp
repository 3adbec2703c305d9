// Friction at two rates: the simulation's tool and rt-core's local proxy must agree.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "rendering/loaded_tool.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic {
namespace {

constexpr double kRadius = 0.03;     // m
constexpr double kDepth = 0.01;      // m, mean
constexpr double kMaxDepth = 0.013;  // m, see hand_at()
constexpr double kTick = 1e-3;       // s
constexpr int kTicksPerStep = 10;
constexpr double kSpeed = 0.1;  // m/s, maximum of the hand along the floor

/// A floor of two triangles that moves along x.
struct Floor {
    std::vector<Vec3> start{{-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5}};
    std::vector<Vec3> end = start;
    std::vector<sim::Triangle> triangles{{0, 1, 2}, {0, 2, 3}};
    sim::SweptTree tree{start, triangles};

    void move(double travel) {
        start = end;
        for (Vec3& v : end) {
            v.x += travel;
        }
        tree.refit({start, end, triangles});
    }
};

/// Presses, moves along the floor, stops, and moves on.
Vec3 hand_at(double t) {
    const double x = kSpeed / 4.0 * std::sin(4.0 * t);
    const double z = t < 2.0 ? 0.03 * std::sin(2.0 * t) : 0.03 * std::sin(4.0);
    return {x, kRadius - kDepth - 0.003 * std::sin(3.0 * t), z};
}

void compare(double floor_speed) {
    sim::ToolProxies::Settings settings;
    settings.step = kTick * kTicksPerStep;
    settings.springs.stiffness = 100.0;
    settings.contact.static_friction = 0.8;
    settings.contact.dynamic_friction = 0.5;
    // The same floor as a contact frame, whose horizon no tick reaches.
    const auto frame = std::make_unique<ContactFrame>();
    frame->stiffness = settings.springs.stiffness;
    frame->step_ns = kNanosecondsPerSecond;
    frame->static_friction = settings.contact.static_friction;
    frame->dynamic_friction = settings.contact.dynamic_friction;
    frame->proxy_count = 1;
    frame->proxies[0].plane_count = 1;
    frame->proxies[0].planes[0].normal[1] = 1.0;
    frame->proxies[0].planes[0].offset = kRadius;
    frame->proxies[0].surface_velocity[0] = floor_speed;
    const auto felt = std::make_unique<haptic::test::LoadedTool>();
    felt->load(*frame);
    Floor floor;
    Pose start{hand_at(0.0), Quat(1, 0, 0, 0)};
    start.position.y = kRadius;
    sim::ToolProxies tool(sim::one_sphere(kRadius), settings, start);
    double max_error = 0.0;
    double sum = 0.0;
    int sliding = 0;
    int sticking = 0;
    for (int tick = 0; tick < 4000; ++tick) {
        const Vec3 hand = hand_at(tick * kTick);
        const Pose pose{hand, Quat(1, 0, 0, 0)};
        const GripMotion motion{.pose = pose, .previous = pose, .elapsed_s = tick == 0 ? 0.0 : kTick};
        const Vec3 local = felt->render(frame->stiffness, motion, 0).proxy;
        if (tick % kTicksPerStep != 0) {
            continue;
        }
        floor.move(tick == 0 ? 0.0 : floor_speed * kTick * kTicksPerStep);
        const std::array<sim::MovingSurface, 1> surfaces{
            sim::MovingSurface{{floor.start, floor.end, floor.triangles}, &floor.tree}};
        tool.set_goals(pose);
        tool.collect(surfaces);
        EXPECT_TRUE(tool.find_secure_positions());
        tool.pop_out();
        tool.find_equilibrium();
        const double error = glm::length(tool.particles()[0].position - local);
        max_error = std::max(max_error, error);
        sum += error;
        (felt->friction(0).sliding ? sliding : sticking) += 1;
    }
    // Each samples the hand at its own times. Where one starts to slip and the other just does not, they differ by the
    // distance between the two friction cones, until the next slip.
    const double travel = (kSpeed + std::abs(floor_speed)) * kTick * kTicksPerStep;
    const double between = (settings.contact.static_friction - settings.contact.dynamic_friction) * kMaxDepth;
    EXPECT_LE(max_error, between + travel);
    EXPECT_LE(sum / (sliding + sticking), travel);
    EXPECT_GT(sliding, 50);
    EXPECT_GT(sticking, 50);
}

TEST(FrictionRates, TheHandIsHeldWhereTheSimulationHoldsItsProxy) {
    compare(0.0);
}

TEST(FrictionRates, AlsoOnAMovingFloor) {
    compare(0.05);
}

}  // namespace
}  // namespace haptic
