// Algorithm 4 as a whole: a tool of many spheres among the bodies of a scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <string>
#include <vector>

#include "few_spheres.hpp"
#include "haptic/config.hpp"
#include "haptic/frames.hpp"
#include "haptic/sim/simulation.hpp"
#include "scene/hostile_hand.hpp"
#include "scene_with.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

using test::scene_with;

constexpr double kToolSphereRadius = 0.03;   // m
constexpr double kToolSphereSpacing = 0.07;  // m

/// A fixed plate whose upper face is at y = 0.
Scene plate_with(const std::vector<std::string>& more = {}) {
    std::vector<std::string> all{"model.generator=plate", "model.material=none", "model.size=[2.0, 0.2, 2.0]",
                                 "model.cells=4",         "model.height=-0.1",   "hand.positions=[0.0, 0.1, 0.0]"};
    all.insert(all.end(), more.begin(), more.end());
    return scene_with("cloth-drop", all);
}

StepInput at(const Simulation& simulation, std::int64_t step, const Pose& tool) {
    StepInput input;
    input.time_ns = step * nanoseconds(simulation.scene().solver.step);
    input.device = simulation.workspace().to_device(tool);
    return input;
}

Quat turn(double angle, const Vec3& axis) {
    return glm::angleAxis(angle, glm::normalize(axis));
}

TEST(ToolStep, FreeMotionHasExactlyZeroForceAndTorqueAtAnySpeed) {
    const Scene scene = plate_with({"model.height=-5.0"});
    Simulation simulation(scene, test::square_of_spheres(6, kToolSphereSpacing, kToolSphereRadius));
    simulation.set_verification(true);
    for (int i = 0; i < 200; ++i) {
        // Swings of up to 1.5 m/s and 20 m/s^2 at the hand, and 6 rad/s.
        const double t = 0.01 * i;
        const Vec3 device(0.1 * std::sin(14.0 * t), 0.05 * std::sin(9.0 * t + 1.0), 0.02 * t);
        StepInput input;
        input.time_ns = 10'000'000 * std::int64_t{i};
        input.device = {device, turn(1.5 * std::sin(4.0 * t), {1, 2, 3})};
        const StepResult result = simulation.step(input);
        ASSERT_EQ(result.force, Vec3(0.0)) << i;
        ASSERT_EQ(result.torque, Vec3(0.0)) << i;
        ASSERT_EQ(result.hand_torque, Vec3(0.0)) << i;
        ASSERT_EQ(result.collided, 0u) << i;
        const Pose hip = simulation.workspace().to_scene(input.device);
        for (const ToolProxy& p : simulation.tool().particles()) {
            ASSERT_LT(glm::length(p.position - (hip.position + hip.orientation * p.rest_offset)),
                      1e-6 * kToolSphereRadius)
                << i;
        }
    }
    EXPECT_EQ(simulation.frame().proxy_count, 36u);
}

TEST(ToolStep, PressedFlatItHasTheStiffnessOfTheWholeSpring) {
    Simulation simulation(plate_with({"coupling.hunt_crossley_damping=0.0"}),
                          test::square_of_spheres(4, kToolSphereSpacing, kToolSphereRadius));
    const double k = simulation.scene().coupling.stiffness;
    simulation.set_verification(true);
    for (int i = 0; i < 30; ++i) {
        const double depth = 0.002 * (i - 5);  // from above the plate into it
        const StepResult result =
            simulation.step(at(simulation, i, {{0.01, kToolSphereRadius - depth, -0.02}, turn(0.3, {0, 1, 0})}));
        EXPECT_FALSE(result.crossed) << i;
        const double expected = std::max(0.0, k * depth);
        EXPECT_LE(glm::length(result.force - Vec3(0.0, expected, 0.0)), 1e-9 + 1e-7 * expected) << i;
        EXPECT_LT(glm::length(result.torque), 1e-9) << i;
        EXPECT_EQ(result.collided, depth > 1e-9 ? 16u : 0u) << i;
    }
}

TEST(ToolStep, OfALimpToolForceAndTorqueAreSumsOverContactsDividedByTheNumberOfParticles) {
    // Thesis, section 5.2.2, with each sphere's depth below the plate computed independently.
    Simulation simulation(plate_with({"coupling.hunt_crossley_damping=0.0"}),
                          test::square_of_spheres(4, kToolSphereSpacing, kToolSphereRadius, {.young_modulus = 0.0}));
    const double k = simulation.scene().coupling.stiffness;
    simulation.set_verification(true);
    std::size_t fewest = 16;
    for (int i = 0; i < 40; ++i) {
        const Pose hip{{0.0, 0.05 - 0.002 * i, 0.0}, turn(0.01 * i, {1, 0, 2})};
        const StepResult result = simulation.step(at(simulation, i, hip));
        EXPECT_FALSE(result.crossed) << i;
        Vec3 force(0.0);
        Vec3 torque(0.0);
        std::size_t touching = 0;
        for (const ToolProxy& p : simulation.tool().particles()) {
            const Vec3 moment_arm = hip.orientation * p.rest_offset;
            const double depth = kToolSphereRadius - (hip.position + moment_arm).y;
            if (depth > 0.0) {
                ++touching;
                force += Vec3(0.0, k * depth / 16.0, 0.0);
                torque += glm::cross(moment_arm, Vec3(0.0, k * depth / 16.0, 0.0));
            }
        }
        EXPECT_EQ(result.collided, touching) << i;
        EXPECT_LT(glm::length(result.force - force), 1e-8) << i;
        EXPECT_LT(glm::length(result.torque - torque), 1e-8) << i;
        const Workspace& workspace = simulation.workspace();
        const double work = workspace.settings().scale * workspace.settings().force_scale;
        EXPECT_NEAR(glm::length(result.hand_torque), work * glm::length(result.torque), 1e-12) << i;
        fewest = touching > 0 ? std::min(fewest, touching) : fewest;
    }
    EXPECT_LT(fewest, 4u) << "the tilted tool touches with its corner first";
}

TEST(ToolStep, TheForceOfARigidToolDoesNotDependOnTheNumberOfSpheres) {
    // A square tool of side 0.21 m with 4, 16 and 64 spheres, pressed flat.
    const double depth = 0.01;
    double first = 0.0;
    for (const int side : {2, 4, 8}) {
        Simulation simulation(plate_with({"coupling.hunt_crossley_damping=0.0"}),
                              test::square_of_spheres(side, 0.21 / (side - 1), kToolSphereRadius, {.rigid = true}));
        StepResult result;
        for (int i = 0; i < 3; ++i) {
            result = simulation.step(at(simulation, i, {{0.0, kToolSphereRadius - depth, 0.0}, turn(0.1, {0, 1, 0})}));
        }
        first = side == 2 ? result.force.y : first;
        const double expected = simulation.scene().coupling.stiffness * depth;
        EXPECT_NEAR(result.force.y, expected, 1e-7 * expected) << side;
        EXPECT_NEAR(result.force.y, first, 1e-7 * expected) << side;
        EXPECT_LT(glm::length(result.torque), 1e-9) << side;
    }
}

TEST(ToolStep, TheThesisSchemeUsesTheFullDistanceToTheGoals) {
    // Section 5.2.2 literally: F = k / N sum (p_i - g_i) over the particles in contact.
    Simulation simulation(plate_with({"coupling.hunt_crossley_damping=0.0", "coupling.multi_rate=positions"}),
                          test::square_of_spheres(4, kToolSphereSpacing, kToolSphereRadius));
    const double k = simulation.scene().coupling.stiffness;
    double along = 0.0;
    for (int i = 0; i < 30; ++i) {
        const Pose hip{{0.001 * i, 0.08 - 0.004 * i, 0.0}, turn(0.3, {1, 0, 2})};
        const StepResult result = simulation.step(at(simulation, i, hip));
        Vec3 force(0.0);
        Vec3 torque(0.0);
        for (const ToolProxy& p : simulation.tool().particles()) {
            if (p.in_contact() && p.position.y - p.goal.y > 0.0) {
                force += k / 16.0 * (p.position - p.goal);
                torque += glm::cross(p.goal - hip.position, k / 16.0 * (p.position - p.goal));
            }
        }
        EXPECT_LT(glm::length(result.force - force), 1e-9) << i;
        EXPECT_LT(glm::length(result.torque - torque), 1e-9) << i;
        along = std::max(along, std::abs(result.force.x) + std::abs(result.force.z));
    }
    EXPECT_GT(along, 1e-4) << "the bent tool is drawn along the plate";
    EXPECT_EQ(simulation.frame().flags & HAPTIC_FRAME_HOLD_POSITIONS, HAPTIC_FRAME_HOLD_POSITIONS);
}

TEST(ToolStep, ASceneWithAToolRunsWithItsSpheresAndSkin) {
    Simulation simulation(
        plate_with({"tool.generator=probe", "tool.length=0.3", "proxy.reach=0.005", "hand.positions=[0.0, 1.0, 0.0]"}));
    const Pose hip{{0.3, 0.9, 0.1}, turn(1.0, {1, 2, 0})};
    (void)simulation.step(at(simulation, 0, hip));
    const ToolProxies& tool = simulation.tool();
    EXPECT_GT(tool.particles().size(), 3u);
    EXPECT_EQ(simulation.frame().proxy_count, tool.particles().size());
    const std::vector<Vec3> vertices = tool.vertices();
    ASSERT_EQ(vertices.size(), tool.mesh().vertices.size());
    ASSERT_GT(vertices.size(), 100u);
    for (std::size_t j = 0; j < vertices.size(); ++j) {
        ASSERT_LT(glm::length(vertices[j] - (hip.position + hip.orientation * tool.mesh().vertices[j])), 1e-6);
    }
}

TEST(ToolStep, FrameHasEachSphereWithItsOffsetInTheGripAndItsPlanes) {
    Scene scene = plate_with({"proxy.reach=0.02", "workspace.rotation=[0.5, 0.5, 0.5, 0.5]"});
    scene.workspace.offset = {0.01, -0.02, 0.03};
    Simulation simulation(scene,
                          test::square_of_spheres(8, kToolSphereSpacing, kToolSphereRadius, {.young_modulus = 0.0}));
    const Pose hip{{0.0, 0.02, 0.0}, turn(0.2, {1, 0, 0})};
    StepInput input;
    for (int i = 0; i < 3; ++i) {
        input = at(simulation, i, hip);
        (void)simulation.step(input);
    }
    const ContactFrame& frame = simulation.frame();
    ASSERT_EQ(find_defect(frame), FrameDefect::None);
    ASSERT_EQ(frame.proxy_count, 64u);
    const std::span<const ToolProxy> particles = simulation.tool().particles();
    std::size_t planes = 0;
    for (std::size_t i = 0; i < 64; ++i) {
        const ProxyContact& sent = frame.proxies[i];
        // Goal by the frame's offset and by the simulation.
        const Vec3 goal = input.device.position + input.device.orientation * to_vec3(sent.rest_offset);
        EXPECT_LT(glm::length(goal - simulation.workspace().to_device(particles[i].goal)), 1e-15);
        const double height = particles[i].goal.y - kToolSphereRadius;
        EXPECT_EQ(sent.in_contact != 0, height < 0.0) << i;
        EXPECT_EQ(sent.plane_count, height < 0.019 ? 1u : 0u) << i;
        if (sent.plane_count > 0) {
            ++planes;
            const double above = glm::dot(to_vec3(sent.planes[0].normal), goal) - sent.planes[0].offset;
            EXPECT_NEAR(above, height * simulation.workspace().settings().scale, 1e-12) << i;
        }
    }
    EXPECT_GT(planes, 8u);
    EXPECT_LT(planes, 64u);
}

TEST(ToolStep, BodiesGetTheOppositeOfTheToolsForce) {
    Simulation simulation(scene_with("cloth-drop", {"model.height=0.1", "model.velocity=[0.0, -3.0, 0.0]",
                                                    "solver.gravity=[0.0, 0.0, 0.0]"}),
                          test::square_of_spheres(3, kToolSphereSpacing, kToolSphereRadius));
    simulation.set_verification(true);
    const double step = simulation.scene().solver.step;
    int compared = 0;
    for (int i = 0; i < 40; ++i) {
        const Vec3 before = linear_momentum(simulation.model());
        const StepResult result =
            simulation.step(at(simulation, i, {{0.0, 0.002 * i, 0.0}, turn(0.02 * i, {1, 1, 0})}));
        const Vec3 gained = linear_momentum(simulation.model()) - before;
        EXPECT_LT(glm::length(gained + step * result.force), 1e-12) << "step " << i;  // kg m/s
        EXPECT_FALSE(result.crossed) << i;
        compared += result.collided > 3 ? 1 : 0;
    }
    EXPECT_GT(compared, 10);
}

TEST(ToolStep, BodiesGetTheOppositeWithFrictionToo) {
    Simulation simulation(scene_with("cloth-drop", {"model.height=0.1", "model.velocity=[0.0, -3.0, 0.0]",
                                                    "solver.gravity=[0.0, 0.0, 0.0]", "proxy.static_friction=0.5",
                                                    "proxy.dynamic_friction=0.4"}),
                          test::square_of_spheres(3, kToolSphereSpacing, kToolSphereRadius));
    const double step = simulation.scene().solver.step;
    int compared = 0;
    for (int i = 0; i < 40; ++i) {
        const Vec3 before = linear_momentum(simulation.model());
        const StepResult result =
            simulation.step(at(simulation, i, {{0.003 * i, 0.002 * i, 0.0}, turn(0.02 * i, {1, 1, 0})}));
        const Vec3 gained = linear_momentum(simulation.model()) - before;
        EXPECT_LT(glm::length(gained + step * result.force), 1e-12) << "step " << i;  // kg m/s
        compared += result.collided > 3 ? 1 : 0;
    }
    EXPECT_GT(compared, 10);
}

TEST(ToolStep, LiftsABodyAndCarriesItAsideByFriction) {
    // A cloth of 20 g settles on a tray of spheres, which then moves up by 0.3 m and sideways by 0.3 m.
    const auto carry = [](const std::string& friction) {
        Simulation simulation(
            scene_with("cloth-drop",
                       {"model.side=0.25", "model.vertices_per_side=13", "model.material=none", "model.mass=0.02",
                        "solver.substeps=8", "solver.iterations=1", "solver.shape_damping=5.0", "model.height=0.05",
                        "coupling.stiffness=40.0", "coupling.mask_radius=0.05", "proxy.static_friction=" + friction,
                        "proxy.dynamic_friction=" + friction}),
            test::square_of_spheres(4, 0.07, kToolSphereRadius));
        simulation.set_verification(friction != "0.0");
        const double dt = simulation.scene().solver.step;
        for (int i = 0; i < 220; ++i) {
            const double up = 0.3 * std::clamp((i - 40) * dt, 0.0, 1.0);
            const double aside = 0.5 * std::clamp((i - 140) * dt, 0.0, 0.6);
            const StepResult result =
                simulation.step(at(simulation, i, {{aside, up - 0.02, 0.0}, turn(0.0, {0, 1, 0})}));
            EXPECT_FALSE(result.crossed) << i;
        }
        const ParticleModel& cloth = simulation.model();
        Vec3 centre(0.0);
        for (const Vec3& p : cloth.position) {
            centre += p / static_cast<double>(cloth.size());
        }
        return centre;
    };
    // With a friction of 0.97 or more its place depends on the last bits: 0.28 to 0.37 m.
    const Vec3 rough = carry("0.9");
    EXPECT_GT(rough.y, 0.25);
    EXPECT_NEAR(rough.x, 0.3, 0.08);
    const Vec3 smooth = carry("0.0");
    EXPECT_LT(smooth.x, rough.x - 0.03) << "a smooth cloth is left behind";
}

TEST(ToolStep, AHostileHandDragsNoSphereThroughTheCloth) {
    const Scene scene =
        scene_with("cloth-drop", {"model.height=0.3", "collisions.ground=true", "collisions.ground_height=-0.5"});
    Simulation simulation(scene, test::square_of_spheres(3, kToolSphereSpacing, kToolSphereRadius));
    simulation.set_verification(true);
    HostileHand hand(5, 5.0, 10.0, simulation.proxy());
    std::size_t collided = 0;
    for (int i = 0; i < 250; ++i) {
        const Vec3 aim = hand.advance(scene.solver.step, simulation.vertices());
        const Pose hip{aim, hand.orientation()};
        const StepResult result = simulation.step(at(simulation, i, hip));
        EXPECT_EQ(result.crossings, 0u) << i;
        collided = std::max(collided, result.collided);
    }
    EXPECT_GT(collided, 3u);
}

TEST(ToolStep, IsDeterministicToTheBit) {
    const auto run = [] {
        Simulation simulation(scene_with("cloth-drop", {"model.height=0.2", "model.velocity=[0.0, -8.0, 0.0]"}),
                              test::square_of_spheres(3, kToolSphereSpacing, kToolSphereRadius));
        for (int i = 0; i < 30; ++i) {
            (void)simulation.step(at(simulation, i, {{0.0, 0.0, 0.0}, turn(0.05 * i, {1, 0, 0})}));
        }
        return simulation.state_hash();
    };
    EXPECT_EQ(run(), run());
}

TEST(ToolStep, ClutchLetsTheGripRotateAloneAndContinuesFromThere) {
    const Scene scene = plate_with({"model.height=-5.0"});
    Simulation simulation(scene, test::square_of_spheres(3, kToolSphereSpacing, kToolSphereRadius));
    const Quat begin = turn(0.4, {0, 0, 1});
    StepInput input;
    Pose grip{{0.01, 0.0, 0.0}, begin};
    const auto step = [&](int i, bool held) {
        input.time_ns = 10'000'000 * std::int64_t{i};
        input.device = grip;
        input.buttons = held ? 1 : 0;
        return simulation.step(input);
    };
    const StepResult before = step(0, false);
    EXPECT_LT(std::abs(std::abs(glm::dot(before.proxy_orientation, begin)) - 1.0), 1e-12);
    for (int i = 1; i < 40; ++i) {
        grip.orientation = turn(0.02 * (i - 1), {1, 0, 0}) * begin;  // from the step after the button is pressed
        grip.position.y = 0.001 * (i - 1);
        const StepResult held = step(i, true);
        EXPECT_LT(glm::length(held.proxy - before.proxy), 1e-12) << i;
        EXPECT_LT(std::abs(std::abs(glm::dot(held.proxy_orientation, begin)) - 1.0), 1e-12) << i;
    }
    (void)step(40, false);
    // A rotation of the hand about an axis of the room rotates the tool about the same axis.
    const Quat more = turn(0.3, {0, 1, 1});
    grip.orientation = more * grip.orientation;
    const StepResult after = step(41, false);
    EXPECT_LT(std::abs(std::abs(glm::dot(after.proxy_orientation, more * begin)) - 1.0), 1e-12);
    // The frame's offsets fit the grip, whose orientation differs from the tool's.
    const ContactFrame& frame = simulation.frame();
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        const Vec3 goal = grip.position + grip.orientation * to_vec3(frame.proxies[i].rest_offset);
        EXPECT_LT(glm::length(goal - to_vec3(frame.proxies[i].position)), 1e-12);
    }
}

TEST(ToolStep, ClutchNeverMakesForceOrTorqueJump) {
    // Pressed into the plate at a tilt; the coupling fades out and in, per step by at most the fade's share.
    Simulation simulation(plate_with({"workspace.clutch_fade=0.1"}),
                          test::square_of_spheres(4, kToolSphereSpacing, kToolSphereRadius));
    const Pose hip{{0.0, 0.01, 0.0}, turn(0.2, {1, 0, 1})};
    StepInput input = at(simulation, 0, hip);
    Vec3 force(0.0);
    Vec3 torque(0.0);
    double max_force = 0.0;
    double max_torque = 0.0;
    for (int i = 0; i < 120; ++i) {
        input.time_ns = 10'000'000 * std::int64_t{i};
        input.buttons = i >= 20 && i < 60 ? 1 : 0;
        const StepResult result = simulation.step(input);
        if (i == 19) {
            max_force = glm::length(result.force);
            max_torque = glm::length(result.torque);
            ASSERT_GT(max_force, 0.1);
            ASSERT_GT(max_torque, 1e-4);
        } else if (i > 19) {
            EXPECT_LE(glm::length(result.force - force), 0.11 * max_force) << i;
            EXPECT_LE(glm::length(result.torque - torque), 0.11 * max_torque) << i;
        }
        if (i == 59) {
            EXPECT_EQ(result.force, Vec3(0.0));
        }
        force = result.force;
        torque = result.torque;
    }
}

}  // namespace
}  // namespace haptic::sim
