#include "haptic/sim/simulation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/frames.hpp"
#include "late_drop.hpp"
#include "scene/hostile_hand.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

using test::late_drop;
using ::testing::HasSubstr;

std::int64_t time_of(int step) {
    return 10'000'000 * std::int64_t{step};
}

Scene at_step(const std::string& name, const std::string& step, const std::vector<std::string>& settings = {}) {
    Config config = open_scene(name);
    config.set("solver.step=" + step);
    for (const std::string& setting : settings) {
        config.set(setting);
    }
    return read_scene(config, name);
}

Simulation with_threads(Scene scene, int threads) {
    scene.solver.threads = threads;
    return Simulation(scene);
}

/// What a hand that darts at the surfaces gives the simulation in its next step.
StepInput next_of(HostileHand& hand, const Simulation& simulation, int step) {
    const double length = simulation.scene().solver.step;
    StepInput input;
    input.time_ns = step * nanoseconds(length);
    input.device.position = simulation.workspace().to_device(hand.advance(length, simulation.vertices()));
    input.device.orientation = hand.orientation();
    input.curl = hand.curl();
    return input;
}

TEST(Simulation, CatchesTheClothAndHoldsIt) {
    Simulation simulation(late_drop());
    simulation.set_verification(true);
    int in_contact = 0;
    double highest = 0.0;
    for (int i = 0; in_contact < 30 && i < 60; ++i) {
        const StepResult result = simulation.step(simulation.scripted_input(time_of(i)));
        EXPECT_FALSE(result.crossed) << "step " << i;
        EXPECT_TRUE(result.in_contact || in_contact == 0) << "contact lost at step " << i;
        in_contact += result.in_contact ? 1 : 0;
        highest = std::max(highest, glm::length(result.hand_force));
        if (!result.in_contact) {
            EXPECT_EQ(result.hand_force, Vec3(0.0));  // exactly zero in free space
        }
    }
    EXPECT_EQ(in_contact, 30);  // 0.3 s
    EXPECT_GT(highest, 1.0);    // N, at the hand
    EXPECT_LT(highest, 8.0);    // rt-core's limit
}

TEST(Simulation, AClothThatMissesTheHandComesToRestOnTheGround) {
    Config config = open_scene("cloth-drop");
    config.set("model.height=0.0");
    config.set("model.offset=[1.0, 0.0, 0.0]");
    Simulation simulation(read_scene(config, "aside"));
    for (int i = 0; i < 120; ++i) {  // it falls 1.5 m in 0.55 s
        EXPECT_FALSE(simulation.step(simulation.scripted_input(time_of(i))).in_contact);
    }
    const double ground = simulation.scene().collisions.ground_height;
    for (const Vec3& vertex : simulation.vertices()) {
        EXPECT_NEAR(vertex.y, ground, 0.1);  // m; folds may rise
        EXPECT_GT(vertex.y, ground);
    }
}

TEST(Simulation, HoldsOneOfTwoBodiesAsIfItWereAlone) {
    // The second cloth falls 3 m to the side and is never touched; it must not affect the first.
    Scene alone = late_drop(0.0, {"collisions.ground=false"});
    Scene with_another = alone;
    with_another.model.copies.push_back({.position = {3.0, 0.0, 0.0}});
    Simulation one(alone);
    Simulation two(with_another);
    two.set_verification(true);
    ASSERT_EQ(two.bodies().size(), 2u);
    ASSERT_EQ(two.vertices().size(), 2 * one.vertices().size());
    ASSERT_EQ(two.mesh().triangles.size(), 2 * one.mesh().triangles.size());
    for (int i = 0; i < 30; ++i) {
        const StepResult expected = one.step(one.scripted_input(time_of(i)));
        const StepResult result = two.step(two.scripted_input(time_of(i)));
        EXPECT_FALSE(result.crossed) << "step " << i;
        EXPECT_EQ(result.in_contact, expected.in_contact) << "step " << i;
        // The copies are placed with different rounding in the last bit, which conversion to float can turn into 1e-8
        // m; a contact of 16 N at 14 m/s amplifies that.
        EXPECT_LT(glm::length(result.proxy - expected.proxy), 1e-5) << "step " << i;
        EXPECT_LT(glm::length(result.force - expected.force), 2e-3) << "step " << i;
    }
}

TEST(Simulation, VerificationCountsSurfacesThatCrossAndVerticesBelowTheGround) {
    // The second cloth stands upright in the middle of the first one, a little tilted; both fall freely.
    Config config = open_scene("cloth-drop");
    config.set("model.height=0.5");
    config.set("collisions.between_bodies=false");
    Scene scene = read_scene(config, "crossed");
    scene.model.copies = {{}, {.position = {0.0101, 0.0, 0.0}, .orientation = {0.8, 0.6, 0.0, 0.0}}};
    Simulation crossed(scene);
    EXPECT_EQ(crossed.step(crossed.scripted_input(0)).surfaces.others, 0u) << "not asked for";
    crossed.set_verification(true);
    const SurfaceCrossingCounts counts = crossed.step(crossed.scripted_input(time_of(1))).surfaces;
    EXPECT_GT(counts.others, 60u);  // 33 rows of edges of either cloth through the other
    EXPECT_EQ(counts.sheets, 0u);
    EXPECT_EQ(counts.below_ground, 0u);
    // A ground above both, too far for the collisions to undo in one step.
    scene.collisions.ground_height = 100.0;
    Simulation sunk(scene);
    sunk.set_verification(true);
    const SurfaceCrossingCounts below = sunk.step(sunk.scripted_input(0)).surfaces;
    EXPECT_EQ(below.below_ground, sunk.vertices().size());
    EXPECT_GT(below.ground_depth, 90.0);
    scene.collisions.ground = false;
    Simulation without(scene);
    without.set_verification(true);
    EXPECT_EQ(without.step(without.scripted_input(0)).surfaces.below_ground, 0u);
}

TEST(Simulation, SolidsNeverPassThroughOneAnotherWithAnyNumberOfThreads) {
    // A hand that darts at the heap 30 times a second; fish beneath it are pressed through one another.
    const Scene scene = at_step("four-fish", "0.033");
    Simulation one = with_threads(scene, 1);
    Simulation three = with_threads(scene, 3);
    one.set_verification(true);
    HostileHand hand(5, 5.0, 10.0, one.proxy());
    std::size_t near_the_heap = 0;
    for (int k = 0; k < 250; ++k) {
        const StepInput input = next_of(hand, one, k);
        const StepResult result = one.step(input);
        near_the_heap += result.in_contact ? 1 : 0;
        ASSERT_EQ(result.surfaces.solids, 0u) << k;
        ASSERT_EQ(result.surfaces.others, 0u) << k;
        three.step(input);
        ASSERT_EQ(one.vertices(), three.vertices()) << k;
    }
    EXPECT_GT(near_the_heap, 50u);
}

TEST(Simulation, BodiesStandStillWhereTheyLeaveAProxyNoRoomAndTheToolTakesTheirMomentum) {
    // A hand that darts at a liver whose surface may pass through itself folds it around the finger until no room is
    // left.
    const Scene scene = at_step("organ-lift", "0.02", {"collisions.ground=false", "collisions.surfaces=false"});
    Simulation one = with_threads(scene, 1);
    Simulation three = with_threads(scene, 3);
    one.set_verification(true);
    HostileHand hand(9, 5.0, 10.0, one.proxy());
    int stood = 0;
    for (int k = 0; k < 500; ++k) {
        Vec3 momentum(0.0);
        for (std::size_t i = 0; i < one.model().size(); ++i) {
            momentum += one.model().pinned[i] == 0 ? one.model().mass[i] * one.model().velocity[i] : Vec3(0.0);
        }
        const StepInput input = next_of(hand, one, k);
        const StepResult result = one.step(input);
        ASSERT_FALSE(result.crossed) << k;
        // What it does not get as a force.
        const Vec3 stopped = result.body_impulse - scene.solver.step * result.hand_force;
        if (glm::length(stopped) > 1e-12) {
            ++stood;
            ASSERT_TRUE(result.overconstrained) << k;
            ASSERT_TRUE(result.stood_still) << k;
            ASSERT_LT(glm::length(stopped - one.workspace().force_to_device(momentum)), 1e-12) << k;
        }
        three.step(input);
        ASSERT_EQ(one.vertices(), three.vertices()) << k;
    }
    EXPECT_GT(stood, 3);
}

TEST(Simulation, ASurfaceThatAHandCrushesNeverPassesThroughItself) {
    // Rounds lead its vertices far in one step, also those that the first search of the step did not look at.
    std::size_t asked = 0;
    for (const bool surfaces : {true, false}) {
        Simulation simulation(
            at_step("fish-grab", "0.033", {surfaces ? "collisions.surfaces=true" : "collisions.surfaces=false"}));
        simulation.set_verification(true);
        HostileHand hand(4, 5.0, 15.0, simulation.proxy());
        for (int k = 0; k < 75; ++k) {
            const SurfaceCrossingCounts found = simulation.step(next_of(hand, simulation, k)).surfaces;
            if (surfaces) {
                ASSERT_EQ(found.solids + found.others, 0U) << k;
            } else {
                asked += found.others;
            }
        }
    }
    EXPECT_GT(asked, 10U) << "nothing was in the way";
}

TEST(Simulation, ASheetNeverPassesThroughTheSurfaceOfASolid) {
    // A cloth falls on a fish, and a hand darts at both.
    Config config = open_scene("cloth-drop");
    for (const char* const setting :
         {"model.vertices_per_side=13", "model.side=0.3", "model.height=0.2", "proxy.radius=0.012"}) {
        config.set(setting);
    }
    const ModelSettings cloth = read_scene(config, "cloth").model;
    constexpr std::size_t cloth_vertices = 13 * 13;
    std::size_t asked = 0;
    for (const bool surfaces : {true, false}) {
        for (const char* const step : {"0.01", "0.033"}) {
            Scene scene =
                at_step("four-fish", step, {surfaces ? "collisions.surfaces=true" : "collisions.surfaces=false"});
            scene.model.copies.resize(1);
            scene.objects = {cloth};
            Simulation simulation(scene);
            simulation.set_verification(true);
            HostileHand hand(2, 5.0, 15.0, simulation.proxy());
            const int steps = static_cast<int>(1.2 / scene.solver.step);
            for (int k = 0; k < steps; ++k) {
                const StepResult result = simulation.step(next_of(hand, simulation, k));
                if (surfaces) {
                    ASSERT_EQ(result.surfaces.solids, 0U) << step << " " << k;
                    ASSERT_EQ(result.surfaces.sheets, 0U) << step << " " << k;
                    ASSERT_EQ(result.surfaces.others, 0U) << step << " " << k;
                    ASSERT_FALSE(result.crossed) << step << " " << k;
                } else {
                    asked += result.surfaces.others;
                }
            }
            const std::span<const Vec3> fallen = std::span(simulation.vertices()).last(cloth_vertices);
            EXPECT_LT(std::ranges::min(fallen, {}, &Vec3::y).y, 0.05) << step << ": it hangs in the air";
        }
    }
    EXPECT_GT(asked, 10U) << "nothing was in the way";
}

TEST(Simulation, AHandThatClosesInAFreeBodyMakesNoMoreForceThanItsSpringsAtAnyStep) {
    // Springs with a lever on a light body: k r^2 h^2 / I is far beyond what an explicit rotation bears.
    const Scene scene = at_step("fish-grab", "0.033");
    for (const std::uint64_t seed : {4U, 5U}) {
        Simulation simulation(scene);
        HostileHand hand(seed, 5.0, 10.0, simulation.proxy());
        double highest = 0.0;
        for (int k = 0; k < 150; ++k) {
            const StepInput input = next_of(hand, simulation, k);
            highest = std::max(highest, glm::length(simulation.step(input).force));
        }
        EXPECT_GT(highest, 5.0) << seed;
        EXPECT_LT(highest, 150.0) << seed << ": N; the coupling has 750 N/m, and the hand is in reach of the fish";
    }
}

TEST(Simulation, SolidsThatCrossAtTheStartAreCountedApart) {
    Scene scene = read_scene(open_scene("four-fish"), "four-fish");
    scene.model.copies = {{.position = {0.0, 0.2, 0.0}, .orientation = {1.0, 0.0, 0.0, 0.0}},
                          {.position = {0.01, 0.2, 0.0}, .orientation = {0.8, 0.0, 0.6, 0.0}}};
    Simulation crossed(scene);
    crossed.set_verification(true);
    const SurfaceCrossingCounts counts = crossed.step(crossed.scripted_input(0)).surfaces;
    EXPECT_EQ(counts.solids, 0u);
    EXPECT_GT(counts.others, 10u);
}

TEST(Simulation, SurfacesOfSolidsAreFlattenedOnTheGroundFromTheStart) {
    // The fin under the fish reaches 13 mm below the table.
    const auto lowest = [](const Simulation& simulation) {
        return std::ranges::min(simulation.vertices(), {}, &Vec3::y).y;
    };
    for (const bool ground : {true, false}) {
        Scene scene = read_scene(open_scene("fish-hold"), "fish-hold");
        scene.collisions.ground = ground;
        const double height = scene.collisions.ground_height;
        Simulation simulation(scene);
        simulation.set_verification(true);
        for (int k = 0; k < 30; ++k) {
            EXPECT_EQ(lowest(simulation) < height - 0.01, !ground) << k;
            EXPECT_EQ(lowest(simulation) < height, !ground) << k;
            EXPECT_EQ(simulation.step(simulation.scripted_input(time_of(k))).surfaces.below_ground, 0u) << k;
            // Both sides of the fin keep some of their distance.
            EXPECT_LT(std::ranges::count(simulation.vertices(), height, &Vec3::y), 8) << k;
        }
    }
    // What is fixed may be built into it.
    Scene built = read_scene(open_scene("plane-slide"), "built");
    built.collisions.ground = true;
    built.collisions.ground_height = 1.0;
    Simulation simulation(built);
    simulation.set_verification(true);
    EXPECT_LT(lowest(simulation), 0.5);
    EXPECT_EQ(simulation.step(simulation.scripted_input(0)).surfaces.below_ground, 0u);
}

TEST(Simulation, AppliesTheForceToTheTouchedBody) {
    // The touched cloth is the second body here: the force must reach its particles.
    Scene scene = late_drop(0.0, {"collisions.ground=false"});
    scene.model.copies = {{.position = {3.0, 0.0, 0.0}}, {}};
    Simulation simulation(scene);
    const double mass = 0.12;  // kg, a square metre of cotton
    double pushed = 0.0;
    for (int i = 0; i < 30; ++i) {
        const std::size_t first = simulation.bodies()[1].first_particle;
        const ParticleModel before = simulation.model();
        const StepResult result = simulation.step(simulation.scripted_input(time_of(i)));
        Vec3 gained[2] = {Vec3(0.0), Vec3(0.0)};
        for (std::size_t p = 0; p < before.size(); ++p) {
            gained[p < first ? 0 : 1] += before.mass[p] * (simulation.model().velocity[p] - before.velocity[p]);
        }
        const Vec3 weight(0.0, -9.81 * mass * scene.solver.step, 0.0);
        EXPECT_LT(glm::length(gained[0] - weight), 1e-12) << "step " << i;
        EXPECT_LT(glm::length(gained[1] - weight + scene.solver.step * result.force), 1e-12) << "step " << i;
        pushed = std::max(pushed, glm::length(result.force));
    }
    EXPECT_GT(pushed, 1.0);
}

TEST(Simulation, LetsAFastClothPassThePlaceOfTheBallWithinAStep) {
    // So that only continuous collision detection can catch it: one of its corners, beside the ball, is on one side of
    // it before a step and clear of it on the other after.
    Simulation simulation(late_drop());
    bool passed_between = false;
    for (int i = 0; i < 10; ++i) {
        const double before = simulation.vertices()[544].y;
        (void)simulation.step(simulation.scripted_input(time_of(i)));
        const double after = simulation.vertices()[544].y;
        passed_between = passed_between || (before > 0.03 && after < -0.03);
    }
    EXPECT_TRUE(passed_between);
}

TEST(Simulation, DragsARoughClothAndFeelsTheOppositeForce) {
    // The hand moves sideways at 0.2 m/s once the cloth lies on it, so gently that a smooth one hardly folds around it.
    const auto push = [](const std::string& friction) {
        Simulation simulation(late_drop(
            0.0,
            {"model.height=0.05", "model.velocity=[0.0, -1.0, 0.0]", "solver.gravity=[0.0, 0.0, 0.0]",
             "collisions.ground=false", "proxy.static_friction=" + friction, "proxy.dynamic_friction=" + friction}));
        const double step = simulation.scene().solver.step;
        for (int i = 0; i < 25; ++i) {
            StepInput input = simulation.scripted_input(time_of(i));
            const Vec3 aside(std::max(0.0, 0.2 * step * (i - 5)), 0.0, 0.0);
            input.device.position = simulation.workspace().to_device(aside);
            const Vec3 before = linear_momentum(simulation.model());
            const StepResult result = simulation.step(input);
            const Vec3 gained = linear_momentum(simulation.model()) - before;
            EXPECT_LT(glm::length(gained + step * result.force), 1e-12) << "step " << i;  // kg m/s
        }
        return linear_momentum(simulation.model()).x;
    };
    // Without damping, by which planes lead the surface.
    Simulation simulation(late_drop(
        0.0, {"proxy.static_friction=0.7", "proxy.dynamic_friction=0.4", "coupling.hunt_crossley_damping=0.0"}));
    for (int i = 0; i < 5; ++i) {
        (void)simulation.step(simulation.scripted_input(time_of(i)));
    }
    // The frame's planes carry the surface's velocity. At the last step one plane touches: its point carries the proxy.
    const ContactFrame& frame = simulation.frame();
    EXPECT_EQ(frame.static_friction, 0.7);
    EXPECT_EQ(frame.dynamic_friction, 0.4);
    ASSERT_EQ(simulation.tool().particles()[0].contacts.count, 1u);
    const ContactPlane& plane = frame.proxies[0].planes[0];
    EXPECT_GT(plane.velocity, 0.05);  // m/s, device frame
    const double along = glm::dot(to_vec3(frame.proxies[0].surface_velocity), to_vec3(plane.normal));
    EXPECT_NEAR(along, plane.velocity, 1e-9) << "device frame and scale";

    const double smooth = push("0.0");
    const double rough = push("0.5");
    EXPECT_GT(rough, 0.01);
    EXPECT_GT(rough, 5.0 * smooth);
}

TEST(Simulation, GivesTheParticlesTheOppositeOfTheForceOnTheTool) {
    // No other force acts: the model's gain in momentum is the opposite of the tool's impulse.
    Simulation simulation(late_drop(0.0, {"solver.gravity=[0.0, 0.0, 0.0]"}));
    const double step = simulation.scene().solver.step;
    int compared = 0;
    for (int i = 0; i < 40; ++i) {
        const Vec3 before = linear_momentum(simulation.model());
        const StepResult result = simulation.step(simulation.scripted_input(time_of(i)));
        const Vec3 gained = linear_momentum(simulation.model()) - before;
        EXPECT_LT(glm::length(gained + step * result.force), 1e-12) << "step " << i;  // kg m/s
        compared += result.in_contact ? 1 : 0;
    }
    EXPECT_GT(compared, 20);
}

TEST(Simulation, IsDeterministicToTheBit) {
    Simulation first(late_drop());
    Simulation second(late_drop());
    for (int i = 0; i < 40; ++i) {
        (void)first.step(first.scripted_input(time_of(i)));
        (void)second.step(second.scripted_input(time_of(i)));
        ASSERT_EQ(first.state_hash(), second.state_hash()) << "step " << i;
    }
    Simulation other(late_drop(0.001));
    (void)other.step(other.scripted_input(0));
    EXPECT_NE(other.state_hash(), first.state_hash());
}

TEST(Simulation, SendsPlanesBeforeContactWithTheVelocityOfTheSurface) {
    Simulation simulation(late_drop());
    const Workspace workspace(simulation.scene().workspace);
    for (int i = 0; i < 10; ++i) {
        const StepResult result = simulation.step(simulation.scripted_input(time_of(i)));
        const ContactFrame& frame = simulation.frame();
        ASSERT_EQ(find_defect(frame), FrameDefect::None);
        EXPECT_EQ(frame.plane_time_ns, time_of(i));
        if (result.in_contact) {
            FAIL() << "touched without a preceding plane";
        }
        if (frame.proxies[0].plane_count == 0) {
            continue;
        }
        // The sheet is still flat: its plane at plane_time is one radius above where it will be a step later, less the
        // radius of the ball.
        const ContactPlane& plane = frame.proxies[0].planes[0];
        // In free fall the velocities of the sub-steps increase by g h to that of the last one.
        const SolverSettings& solver = simulation.scene().solver;
        const int substeps = simulation.substeps();
        const double substep = solver.step / substeps;
        const double speed = simulation.model().velocity[544].y - 0.5 * (substeps - 1) * solver.gravity.y * substep;
        EXPECT_NEAR(plane.normal[1], -1.0, 1e-9);
        EXPECT_NEAR(plane.velocity, -speed * workspace.settings().scale, 1e-9);
        const double at_end = plane.offset + plane.velocity * seconds(frame.step_ns);
        const double surface = simulation.vertices()[544].y;
        EXPECT_NEAR(at_end, (-surface + simulation.scene().proxy.radius) * workspace.settings().scale, 1e-4 * 0.03);
        return;
    }
    FAIL() << "never came into reach";
}

TEST(Simulation, FramesCarryTheCouplingFeltAtTheHand) {
    const Scene scene = late_drop();
    Simulation simulation(scene);
    StepInput input = simulation.scripted_input(time_of(0));
    input.state_sequence = 77;
    input.state_time_ns = 123;
    (void)simulation.step(input);
    const ContactFrame& frame = simulation.frame();
    EXPECT_EQ(frame.state_sequence, 77u);
    EXPECT_EQ(frame.state_time_ns, 123);
    EXPECT_EQ(frame.step_ns, 10'000'000);
    EXPECT_EQ(frame.proxy_count, 1u);
    EXPECT_DOUBLE_EQ(frame.stiffness, scene.workspace.force_scale * scene.coupling.stiffness / scene.workspace.scale);
    EXPECT_EQ(frame.flags, 0u);
}

TEST(Simulation, UncouplesWhileTheClutchIsHeld) {
    Simulation simulation(late_drop());
    for (int i = 0; i < 30; ++i) {
        StepInput input = simulation.scripted_input(time_of(i));
        input.buttons = 1;
        (void)simulation.step(input);
    }
    EXPECT_EQ(simulation.frame().flags & HAPTIC_FRAME_CLUTCHED, HAPTIC_FRAME_CLUTCHED);
    EXPECT_EQ(simulation.frame().stiffness, 0.0);
}

TEST(Simulation, FollowsTheHandInFreeSpaceWithoutForce) {
    Simulation simulation(late_drop(5.0));
    for (int i = 0; i < 20; ++i) {
        StepInput input;
        input.time_ns = time_of(i);
        input.device.position = {0.001 * i, 0.0005 * i, 0.0};
        const StepResult result = simulation.step(input);
        EXPECT_EQ(result.force, Vec3(0.0));
        EXPECT_LT(glm::length(simulation.workspace().to_device(result.proxy) - input.device.position), 1e-15);
    }
}

TEST(Simulation, MovesTheSameAtAnotherRateWithEqualSubsteps) {
    const std::vector<std::string> fine{"solver.step=0.001", "solver.substeps=1"};
    Simulation reference(late_drop(0.0, fine));
    Simulation changed(late_drop(0.0, fine));
    const auto run = [](Simulation& simulation, int ms, int steps) {
        for (int i = 0; i < steps; ++i) {
            (void)simulation.step(simulation.scripted_input(1'000'000 * std::int64_t{ms + i}));
        }
    };
    run(reference, 0, 25);
    run(changed, 0, 5);
    changed.change_rate(0.02, 20);
    run(changed, 5, 1);
    EXPECT_NEAR(changed.time(), reference.time(), 1e-12);
    // The cloth still falls freely; 20 parts of 0.02 are not 0.001 to the bit.
    ASSERT_EQ(changed.model().size(), reference.model().size());
    for (std::size_t i = 0; i < changed.model().size(); ++i) {
        ASSERT_LT(glm::length(changed.model().position[i] - reference.model().position[i]), 1e-9) << i;  // m
    }
}

TEST(Simulation, NamesTheStepAtWhichTheStateHasDiverged) {
    Scene scene = late_drop(0.0, {"collisions.ground=false"});
    scene.solver.gravity.y = -1e12;  // the cloth is 1e8 m away after two steps
    Simulation simulation(scene);
    try {
        for (int i = 0; i < 400; ++i) {
            (void)simulation.step(simulation.scripted_input(time_of(i)));
        }
        FAIL() << "did not throw";
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("step "));
        EXPECT_THAT(error.what(), HasSubstr("has diverged"));
    }
}

std::int64_t fake_ns = 0;
std::int64_t fake_clock() {
    return fake_ns += 1000;
}

TEST(Simulation, TimesItsStagesByTheCallersClock) {
    Simulation simulation(late_drop(0.0, {"collisions.ground=false", "collisions.surfaces=false"}), fake_clock);
    const StepResult result = simulation.step(simulation.scripted_input(0));
    const StageTimes& t = result.times;
    for (const std::int64_t stage : {t.popout_ns, t.tool_ns, t.skin_ns}) {
        EXPECT_EQ(stage, 1000);
    }
    EXPECT_EQ(t.ccd_ns, 2000);  // secure positions, and the refit of the body's tree
    // What runs within the bodies' step reads the clock at both ends of each of its calls: the coupling before and
    // after it, whose time counts as that of the proxies, skin and refit at its end.
    EXPECT_EQ(t.proxy_ns, 3000);   // speculative planes, and the coupling
    EXPECT_EQ(t.deform_ns, 5000);  // between and around these calls
    EXPECT_EQ(t.collide_ns, 0);    // one body, no ground, not with itself
    EXPECT_EQ(t.total_ns, 14000);  // plus one for the frame
    Simulation without(late_drop());
    EXPECT_EQ(without.step(without.scripted_input(0)).times.total_ns, 0);
}

TEST(Simulation, SaysHowFarItsBuildingIs) {
    std::vector<double> shares;
    // A tool and a body, each made of particles.
    const Scene scene = read_scene(open_scene("fish-grab"), "fish-grab");
    const Simulation simulation(scene, nullptr, [&](double share) { shares.push_back(share); });
    ASSERT_GT(shares.size(), 100u);
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_GE(shares.front(), 0.0);
    EXPECT_LE(shares.back(), 1.0);
}

}  // namespace
}  // namespace haptic::sim
