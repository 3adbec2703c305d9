#include "haptic/sim/workspace.hpp"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>
#include <stdexcept>

namespace haptic::sim {
namespace {

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

TEST_F(WorkspaceTest, TakesAPositionThereAndBack) {
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
        // A second later the point has moved three metres along the normal.
        const Vec3 moved = workspace.to_device(on_plane + 3.0 * plane.normal);
        EXPECT_NEAR(glm::dot(normal, moved), mapped.offset + mapped.velocity * 1.0, 1e-14);
    }
}

TEST_F(WorkspaceTest, TurnsTheGripWithTheScene) {
    const Workspace workspace(settings);
    const Quat grip = glm::normalize(Quat(0.3, 0.1, -0.5, 0.7));
    const Vec3 axis(0.0, 0.0, 1.0);
    const Vec3 in_scene = workspace.orientation_to_scene(grip) * axis;
    const Vec3 back = glm::normalize(workspace.to_device(in_scene) - workspace.to_device(Vec3(0.0)));
    EXPECT_LT(glm::length(back - grip * axis), 1e-14);
}

TEST_F(WorkspaceTest, AnchorLaysOnePositionOnTheOther) {
    Workspace workspace(settings);
    workspace.anchor({0.02, 0.0, -0.01}, {5.0, 6.0, 7.0});
    EXPECT_LT(glm::length(workspace.to_scene({0.02, 0.0, -0.01}) - Vec3(5.0, 6.0, 7.0)), 1e-12);
}

TEST_F(WorkspaceTest, RefusesScalesThatAreNone) {
    EXPECT_THROW(Workspace({.scale = 0.0}), std::invalid_argument);
    EXPECT_THROW(Workspace({.force_scale = -1.0}), std::invalid_argument);
}

/// A hand that pushes into a floor at y = 0 of the scene, travels with the clutch held, and lets go of it.
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
        const Vec3 hip = clutch.engage(held, device, proxy, step, workspace);
        proxy = Vec3(hip.x, std::max(hip.y, 0.0), hip.z);
        const double force = clutch.gain() * stiffness * (proxy.y - hip.y);
        // The fade takes a tenth of a second, and the hand moves hand_speed * step / scale in a step.
        const double most = stiffness * (0.2 * 1.1 * step / settings.clutch_fade + hand_speed * step / settings.scale);
        EXPECT_LE(std::abs(force - last_force), most) << "step " << i;
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

TEST_F(WorkspaceTest, ClutchStandsWhileItIsHeld) {
    Workspace workspace(settings);
    Clutch clutch;
    const Vec3 held_at = workspace.to_scene({0.01, 0.0, 0.0});
    for (int i = 0; i < 5; ++i) {
        const Vec3 hip = clutch.engage(true, {0.01 + 0.001 * i, 0.0, 0.0}, Vec3(9.0), 0.01, workspace);
        EXPECT_LT(glm::length(hip - held_at), 1e-12);
    }
    // Let go before the fade was over: the scene's point stays under the hand.
    const Vec3 hip = clutch.engage(false, {0.02, 0.0, 0.0}, Vec3(9.0), 0.01, workspace);
    EXPECT_LT(glm::length(hip - held_at), 1e-12);
}

}  // namespace
}  // namespace haptic::sim
