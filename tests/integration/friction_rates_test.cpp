// The simulation moves its proxy by friction at its rate, rt-core its local proxy at the hand's: do they agree?
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <vector>

#include "haptic/rt/surface_grip.hpp"
#include "contact/friction.hpp"
#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"

namespace haptic {
namespace {

constexpr double kRadius = 0.03;    // m
constexpr double kDepth = 0.01;     // m, mean
constexpr double kDeepest = 0.013;  // m, see hand_at()
constexpr double kTick = 1e-3;      // s
constexpr int kTicksPerStep = 10;
constexpr double kSpeed = 0.1;  // m/s, largest, of the hand along the floor

/// A floor of two triangles that goes along x at a speed of its own.
struct Floor {
    std::vector<Vec3> start{{-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5}};
    std::vector<Vec3> end = start;
    std::vector<sim::Triangle> triangles{{0, 1, 2}, {0, 2, 3}};
    sim::SweptTree tree{start, triangles};

    void go(double way) {
        start = end;
        for (Vec3& v : end) {
            v.x += way;
        }
        tree.refit({start, end, triangles});
    }
};

/// Presses, wanders along the floor, stops, and wanders on.
Vec3 hand_at(double t) {
    const double x = kSpeed / 4.0 * std::sin(4.0 * t);
    const double z = t < 2.0 ? 0.03 * std::sin(2.0 * t) : 0.03 * std::sin(4.0);
    return {x, kRadius - kDepth - 0.003 * std::sin(3.0 * t), z};
}

void compare(double floor_speed) {
    sim::ContactSettings settings;
    settings.static_friction = 0.8;
    settings.dynamic_friction = 0.5;
    const rt::Friction friction{settings.static_friction, settings.dynamic_friction};
    Floor floor;
    Vec3 proxy = hand_at(0.0);
    proxy.y = kRadius;
    sim::ProxyGrip grip;
    rt::SurfaceGrip local;
    double most = 0.0;
    double sum = 0.0;
    int sliding = 0;
    int sticking = 0;
    for (int tick = 0; tick < 4000; ++tick) {
        const Vec3 hand = hand_at(tick * kTick);
        const std::array<HalfSpace, 1> planes{HalfSpace{Vec3(0, 1, 0), kRadius}};
        const rt::LocalProxy smooth = rt::project(hand, planes);
        const Vec3 carried(tick == 0 ? 0.0 : floor_speed * kTick, 0.0, 0.0);
        const Vec3 felt = smooth.position + rt::hold(smooth, hand, planes, friction, carried, local);
        if (tick % kTicksPerStep != 0) {
            continue;
        }
        floor.go(tick == 0 ? 0.0 : floor_speed * kTick * kTicksPerStep);
        const std::array<sim::MovingSurface, 1> surfaces{
            sim::MovingSurface{{floor.start, floor.end, floor.triangles}, &floor.tree}};
        const Vec3 secure = sim::secure_position(surfaces, proxy, kRadius, settings).position;
        const Vec3 popped = sim::pop_out(surfaces, secure, kRadius, settings).position;
        proxy =
            sim::move_proxy(surfaces, {proxy, popped, hand}, kRadius, kTick * kTicksPerStep, settings, grip).position;
        most = std::max(most, glm::length(proxy - felt));
        sum += glm::length(proxy - felt);
        (local.slides ? sliding : sticking) += 1;
    }
    // Each looks at the hand at its own times. Where one breaks away and the other just does not, they differ by what
    // lies between the two cones, until the next slide.
    const double way = (kSpeed + std::abs(floor_speed)) * kTick * kTicksPerStep;
    const double between = (settings.static_friction - settings.dynamic_friction) * kDeepest;
    EXPECT_LE(most, between + way);
    EXPECT_LE(sum / (sliding + sticking), way);
    EXPECT_GT(sliding, 50);
    EXPECT_GT(sticking, 50);
}

TEST(FrictionRates, TheHandIsHeldWhereTheSimulationHoldsItsProxy) {
    compare(0.0);
}

TEST(FrictionRates, AlsoOnAFloorThatTakesBothAlong) {
    compare(0.05);
}

}  // namespace
}  // namespace haptic
