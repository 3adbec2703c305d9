#include "haptic/sim/workspace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>
#include <stdexcept>

namespace haptic::sim {
namespace {

Pose at(const Vec3& position) {
    return {.position = position};
}

class WorkspaceTest : public ::testing::Test {
  protected:
    Vec3 vector() {
        std::normal_distribution<double> normal;
        return {normal(random_), normal(random_), normal(random_)};
    }

    std::mt19937 random_{11};
    WorkspaceSettings settings{.scale = 0.04,
                               .offset = {0.01, -0.02, 0.003},
                               .rotation = glm::angleAxis(0.8, glm::normalize(Vec3(1, 2, -1))),
                               .force_scale = 0.3};
};

TEST_F(WorkspaceTest, MapsPositionsThereAndBack) {
    const Workspace workspace(settings);
    for (int i = 0; i < 100; ++i) {
        const Vec3 x = vector();
        EXPECT_LT(glm::length(workspace.to_scene(workspace.to_device(x)) - x), 1e-14);
    }
    EXPECT_EQ(workspace.to_device(Vec3(0.0)), settings.offset);
}

TEST_F(WorkspaceTest, DoesTheSameShareOfWorkInEveryDirection) {
    const Workspace workspace(settings);
    for (int i = 0; i < 100; ++i) {
        const Vec3 force = vector();
        const Vec3 from = vector();
        const Vec3 to = vector();
        const double in_scene = glm::dot(force, to - from);
        const double at_hand =
            glm::dot(workspace.force_to_device(force), workspace.to_device(to) - workspace.to_device(from));
        EXPECT_NEAR(at_hand, settings.force_scale * settings.scale * in_scene, 1e-14);
    }
}

TEST_F(WorkspaceTest, CouplingAtTheHandMakesTheForceOfTheScene) {
    const Workspace workspace(settings);
    const double stiffness = 20.0;
    for (int i = 0; i < 100; ++i) {
        const Vec3 proxy = vector();
        const Vec3 hip = vector();
        const Vec3 mapped = workspace.force_to_device(stiffness * (proxy - hip));
        const Vec3 felt =
            workspace.coupling_to_device(stiffness) * (workspace.to_device(proxy) - workspace.to_device(hip));
        EXPECT_LT(glm::length(mapped - felt), 1e-12 * glm::length(mapped));
    }
}

TEST_F(WorkspaceTest, MapsAPlaneToThePlaneOfTheMappedPoints) {
    const Workspace workspace(settings);
    for (int i = 0; i < 100; ++i) {
        SurfacePlane plane;
        plane.normal = glm::normalize(vector());
        plane.velocity = 3.0;
        const Vec3 on_plane = vector();
        plane.offset = glm::dot(plane.normal, on_plane);
        const ContactPlane mapped = workspace.to_device(plane);
        const Vec3 normal = to_vec3(mapped.normal);
        EXPECT_NEAR(glm::length(normal), 1.0, 1e-14);
        EXPECT_NEAR(glm::dot(normal, workspace.to_device(on_plane)), mapped.offset, 1e-14);
        // One second later the point has moved 3 m along the normal.
        const Vec3 moved = workspace.to_device(on_plane + 3.0 * plane.normal);
        EXPECT_NEAR(glm::dot(normal, moved), mapped.offset + mapped.velocity * 1.0, 1e-14);
    }
}

TEST_F(WorkspaceTest, RotatesTheGripWithTheScene) {
    const Workspace workspace(settings);
    const Quat grip = glm::normalize(Quat(0.3, 0.1, -0.5, 0.7));
    const Vec3 axis(0.0, 0.0, 1.0);
    const Vec3 in_scene = workspace.to_scene(Pose{Vec3(0.0), grip}).orientation * axis;
    const Vec3 back = glm::normalize(workspace.to_device(in_scene) - workspace.to_device(Vec3(0.0)));
    EXPECT_LT(glm::length(back - grip * axis), 1e-14);
}

TEST_F(WorkspaceTest, AnchorMakesOnePoseCoincideWithTheOther) {
    Workspace workspace(settings);
    workspace.anchor(at({0.02, 0.0, -0.01}), at({5.0, 6.0, 7.0}));
    EXPECT_LT(glm::length(workspace.to_scene({0.02, 0.0, -0.01}) - Vec3(5.0, 6.0, 7.0)), 1e-12);
}

TEST_F(WorkspaceTest, RejectsInvalidScales) {
    EXPECT_THROW(Workspace({.scale = 0.0}), std::invalid_argument);
    EXPECT_THROW(Workspace({.force_scale = -1.0}), std::invalid_argument);
}

/// A hand pushes into a floor at y = 0 of the scene, moves with the clutch held, and releases it.
TEST_F(WorkspaceTest, ClutchNeverJumpsTheForce) {
    Workspace workspace(settings);
    Clutch clutch;
    const double step = 0.01;
    const double stiffness = 20.0;
    const double hand_speed = 0.05;  // m/s at the device
    Vec3 device = workspace.to_device({0.0, -0.2, 0.0});
    Vec3 proxy(0.0);
    double last_force = stiffness * 0.2;
    double farthest = 0.0;
    for (int i = 0; i < 200; ++i) {
        const bool held = i >= 50 && i < 120;
        device += Vec3(hand_speed * step, 0.0, 0.0);
        const Vec3 hip = clutch.engage(held, at(device), {at(proxy)}, step, workspace).position;
        proxy = Vec3(hip.x, std::max(hip.y, 0.0), hip.z);
        const double force = clutch.gain() * stiffness * (proxy.y - hip.y);
        // The fade takes 0.1 s; in a step the hand moves hand_speed * step / scale in the scene.
        const double max_change =
            stiffness * (0.2 * 1.1 * step / settings.clutch_fade + hand_speed * step / settings.scale);
        EXPECT_LE(std::abs(force - last_force), max_change) << "step " << i;
        last_force = force;
        if (i == 110) {
            EXPECT_TRUE(clutch.uncoupled());
            EXPECT_EQ(force, 0.0);
            farthest = hip.x;
        }
        if (held) {
            EXPECT_NEAR(workspace.to_scene(device).y, hip.y, 1e-12);
        }
    }
    EXPECT_EQ(clutch.gain(), 1.0);
    EXPECT_GT(workspace.to_scene(device).x, farthest);  // it follows the hand again
}

TEST_F(WorkspaceTest, ClutchHoldsTheHipWhilePressed) {
    Workspace workspace(settings);
    Clutch clutch;
    const Vec3 held_at = workspace.to_scene({0.01, 0.0, 0.0});
    for (int i = 0; i < 5; ++i) {
        const Vec3 hip =
            clutch.engage(true, at({0.01 + 0.001 * i, 0.0, 0.0}), {at(Vec3(9.0))}, 0.01, workspace).position;
        EXPECT_LT(glm::length(hip - held_at), 1e-12);
    }
    // Released before the fade is over: the same point of the scene stays under the hand.
    const Vec3 hip = clutch.engage(false, at({0.02, 0.0, 0.0}), {at(Vec3(9.0))}, 0.01, workspace).position;
    EXPECT_LT(glm::length(hip - held_at), 1e-12);
}

/// Random valid mappings; magnitudes log-uniform.
WorkspaceSettings any_settings(std::mt19937& random) {
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    std::normal_distribution<double> normal;
    const auto decades = [&](double minimum, double maximum) {
        const double share = 0.5 * (1.0 + unit(random));
        return minimum * std::pow(maximum / minimum, share);
    };
    WorkspaceSettings any;
    any.scale = decades(1e-3, 10.0);
    any.force_scale = decades(1e-3, 100.0);
    const double x = unit(random);
    const double y = unit(random);
    any.offset = {x, y, unit(random)};
    const double w = normal(random);
    const double i = normal(random);
    const double j = normal(random);
    any.rotation = glm::normalize(Quat(w, i, j, normal(random)));
    return any;
}

TEST_F(WorkspaceTest, KeepsItsInvariantsForAnyValidMapping) {
    for (int i = 0; i < 2000; ++i) {
        const WorkspaceSettings any = any_settings(random_);
        const Workspace workspace(any);
        const Vec3 x = vector();
        const Vec3 y = vector();
        // Round trip, up to the rounding of the offset in scene units.
        const double rounding = 8e-16 * (glm::length(any.offset) / any.scale + glm::length(x)) * 4.0;
        ASSERT_LE(glm::length(workspace.to_scene(workspace.to_device(x)) - x), rounding);
        // Lengths scale, angles and handedness are preserved.
        const Vec3 dx = workspace.to_device(x) - workspace.to_device(Vec3(0.0));
        const Vec3 dy = workspace.to_device(y) - workspace.to_device(Vec3(0.0));
        const double s2 = any.scale * any.scale;
        const double small = 1e-13 * (s2 * glm::length(x) * glm::length(y) + any.scale * 10.0);
        ASSERT_NEAR(glm::dot(dx, dy), s2 * glm::dot(x, y), small);
        ASSERT_LE(glm::length(glm::cross(dx, dy) - s2 * (any.rotation * glm::cross(x, y))), small);
        // Work scales by force_scale * scale; a spring's force is the same computed in either frame.
        const Vec3 force = vector();
        const double work = glm::dot(workspace.force_to_device(force), dx);
        ASSERT_NEAR(work, any.force_scale * any.scale * glm::dot(force, x),
                    1e-13 * any.force_scale * (any.scale * glm::length(x) + 4.0) * glm::length(force));
        const Vec3 spring = workspace.force_to_device(20.0 * x);
        ASSERT_LE(glm::length(spring - workspace.coupling_to_device(20.0) * dx),
                  1e-13 * (glm::length(spring) + workspace.coupling_to_device(20.0) * 4.0));
    }
}

/// A hand that pushes into a floor at y = 0 of the scene.
class ChangeTest : public WorkspaceTest {
  protected:
    static constexpr double kStep = 0.005;

    /// One step with the hand at a position; the virtual proxy stays above the floor.
    double step(const Vec3& device, bool held = false) {
        hip = clutch.engage(held, at(device), {at(proxy)}, kStep, workspace).position;
        proxy = Vec3(hip.x, std::max(hip.y, 0.0), hip.z);
        force = clutch.gain() * workspace.coupling_to_device(20.0) * workspace.settings().scale * (proxy.y - hip.y);
        return force;
    }

    Workspace workspace{settings};
    Clutch clutch;
    Vec3 proxy{0.0};
    Vec3 hip{0.0};
    double force = 0.0;
};

TEST_F(ChangeTest, FadesTheForceThenChangesTheMappingAndRestartsFromZeroForceAtTheTool) {
    const Vec3 device = workspace.to_device({0.3, -0.2, 0.1});
    double before = step(device);
    const double initial = before;
    ASSERT_GT(initial, 0.0);
    WorkspaceSettings next = settings;
    next.scale = 0.1;
    next.rotation = glm::angleAxis(-1.2, glm::normalize(Vec3(0, 1, 3)));
    next.force_scale = 1.5;
    clutch.change_mapping(Workspace(next));
    int uncoupled = 0;
    for (int i = 0; i < 100; ++i) {
        const Vec3 stood = proxy;
        const double now = step(device);
        EXPECT_LE(std::abs(now - before), initial * kStep / settings.clutch_fade * (1.0 + 1e-9)) << i;
        EXPECT_LT(glm::length(proxy - stood), 1e-12) << "the tool stays in place";
        uncoupled += clutch.uncoupled() ? 1 : 0;
        before = now;
    }
    EXPECT_GE(uncoupled * kStep, 0.02);
    EXPECT_FALSE(clutch.changing());
    EXPECT_EQ(clutch.gain(), 1.0);
    EXPECT_EQ(workspace.settings().scale, next.scale);
    EXPECT_EQ(workspace.settings().force_scale, next.force_scale);
    EXPECT_LT(glm::length(workspace.to_scene(device) - proxy), 1e-12);
    // It follows the hand by the new mapping.
    const Vec3 from = hip;
    step(device + Vec3(0.0, 0.01, 0.0));
    EXPECT_LT(glm::length((hip - from) - glm::inverse(next.rotation) * Vec3(0.0, 0.01, 0.0) / next.scale), 1e-12);
}

TEST_F(ChangeTest, MovesTheToolToANewOffsetUntilSurfacesStopIt) {
    for (const double height : {0.4, -0.4}) {  // m, scene: height of the hand by the new offset
        workspace = Workspace(settings);
        clutch = Clutch();
        proxy = Vec3(0.0);
        const Vec3 device = workspace.to_device({0.0, -0.1, 0.0});
        step(device);
        WorkspaceSettings next = settings;
        next.offset = device - settings.rotation * (settings.scale * Vec3(0.2, height, 0.0));
        clutch.change_mapping(Workspace(next));
        double largest = 0.0;
        for (int i = 0; i < 60; ++i) {
            const double before = force;
            step(device);
            largest = i > 20 ? std::max(largest, std::abs(force - before)) : 0.0;  // the old force has faded by then
        }
        EXPECT_LE(largest, 1e-12) << "no force at the new position";
        EXPECT_LT(glm::length(proxy - Vec3(0.2, std::max(height, 0.0), 0.0)), 1e-12);
        EXPECT_FALSE(clutch.changing());
        EXPECT_EQ(clutch.gain(), 1.0);
    }
}

TEST_F(ChangeTest, TheLastRequestedMappingCountsAndAHeldButtonKeepsItUncoupled) {
    const Vec3 device = workspace.to_device({0.0, -0.2, 0.0});
    step(device);
    WorkspaceSettings next = settings;
    next.scale = 0.2;
    clutch.change_mapping(Workspace(next));
    step(device);
    next.scale = 0.3;
    clutch.change_mapping(Workspace(next));
    for (int i = 0; i < 100; ++i) {
        step(device, true);
    }
    EXPECT_EQ(workspace.settings().scale, 0.3);
    EXPECT_TRUE(clutch.uncoupled());
    EXPECT_FALSE(clutch.changing());
    step(device, false);
    EXPECT_EQ(clutch.gain(), 1.0);
    EXPECT_EQ(force, 0.0);
}

}  // namespace
}  // namespace haptic::sim
