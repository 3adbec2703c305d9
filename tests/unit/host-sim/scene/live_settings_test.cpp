// Settings that change while a scene runs: each acts, none makes the force jump.
#include "haptic/sim/live_settings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/sim/simulation.hpp"
#include "scene_with.hpp"
#include "tool/tool_proxies.hpp"
#include "view/live_parameters.hpp"

namespace haptic::sim {
namespace {

using test::scene_with;

/// A sphere of 3 cm is pressed 1 cm into a rigid plate, whose face is at y = 0, and drawn over it at 0.1 m/s.
Scene plate() {
    const char* const toml = R"(
        description = "a plate"
        duration = 4.0
        [model]
        generator = "plate"
        size = [2.0, 0.02, 2.0]
        offset = [0.0, -0.01, 0.0]
        [proxy]
        radius = 0.03
        reach = 0.025
        [coupling]
        stiffness = 100.0
        hunt_crossley_damping = 0.0
        mask_radius = 0.0
        [hand]
        times = [0.0, 0.5, 4.5]
        positions = [0.0, 0.1, 0.0,  0.0, 0.02, 0.0,  0.4, 0.02, 0.0]
        [workspace]
        scale = 0.2
        force_scale = 1.0
    )";
    return read_scene(Config::parse(toml, "plate.toml"), "plate");
}

class Runner {
  public:
    explicit Runner(const Scene& scene) : simulation(scene) {}

    StepResult step() {
        const StepResult result = simulation.step(simulation.scripted_input(time_ns_));
        time_ns_ += nanoseconds(result.step);
        return result;
    }
    StepResult until(double time) {
        StepResult result;
        while (simulation.time() < time - 1e-9) {
            result = step();
        }
        return result;
    }
    template <class Change>
    void change(Change&& change) {
        LiveSettings settings = simulation.settings();
        change(settings);
        simulation.change_settings(settings);
    }

    Simulation simulation;

  private:
    std::int64_t time_ns_ = 0;
};

TEST(LiveSettings, StiffnessGoesToTheNewOneInATenthOfASecondByEqualSteps) {
    Runner run(plate());
    const StepResult before = run.until(1.0);
    ASSERT_NEAR(glm::length(before.force) / before.depth, 100.0, 1e-9);
    run.change([](LiveSettings& s) { s.stiffness = 300.0; });
    for (int k = 1; k <= 10; ++k) {
        const StepResult now = run.step();
        EXPECT_NEAR(glm::length(now.force) / now.depth, 100.0 + 20.0 * k, 1e-9) << k;
    }
    EXPECT_EQ(run.simulation.scene().coupling.stiffness, 300.0);
    const StepResult after = run.until(2.0);
    EXPECT_NEAR(glm::length(after.force) / after.depth, 300.0, 1e-9);
    // As the hand is told: force_scale / scale times that.
    EXPECT_NEAR(run.simulation.frame().stiffness, 1500.0, 1e-9);
}

TEST(LiveSettings, RadiusCarriesTheProxyOutOfTheSurfaceBitByBitAndBack) {
    Runner run(plate());
    ASSERT_NEAR(run.until(1.0).proxy.y, 0.03, 1e-4);
    run.change([](LiveSettings& s) { s.radius = 0.09; });
    double height = 0.03;
    for (int k = 0; k < 100; ++k) {
        const StepResult now = run.step();
        EXPECT_LE(now.proxy.y, height * (1.0 + SettingsFade::kMaxGrowth) * 1.001) << k;
        height = now.proxy.y;
    }
    EXPECT_NEAR(height, 0.09, 1e-4);
    EXPECT_EQ(run.simulation.tool().particles()[0].radius, 0.09);
    run.change([](LiveSettings& s) { s.radius = 0.01; });  // less than what is sent ahead
    EXPECT_NEAR(run.until(4.0).proxy.y, 0.02, 1e-4);       // where the hand is: it touches no more
    EXPECT_EQ(run.simulation.scene().proxy.radius, 0.01);
}

TEST(LiveSettings, FrictionHoldsBackWhatWasSmooth) {
    Runner run(plate());
    const StepResult smooth = run.until(1.0);
    EXPECT_NEAR(smooth.force.x, 0.0, 1e-9);
    run.change([](LiveSettings& s) {
        s.static_friction = 0.5;
        s.dynamic_friction = 0.4;
    });
    const StepResult rough = run.until(3.0);
    EXPECT_NEAR(rough.force.x, -0.4 * rough.force.y, 1e-3 * rough.force.y);  // it slides at 0.1 m/s
    run.change([](LiveSettings& s) { s.static_friction = s.dynamic_friction = 0.0; });
    const StepResult again = run.until(3.5);
    EXPECT_NEAR(again.force.x, 0.0, 1e-9);
    EXPECT_FALSE(run.simulation.tool().particles()[0].sticks());
}

TEST(LiveSettings, FrictionSwitchedOnInContactHoldsTheProxyWhereItIs) {
    // A still hand, half a metre from the origin.
    Scene scene = plate();
    const Quat upright(1.0, 0.0, 0.0, 0.0);
    scene.hand = PoseTrack({0.0, 0.5}, {Pose{{0.5, 0.1, 0.0}, upright}, Pose{{0.5, 0.02, 0.0}, upright}});
    Runner run(scene);
    ASSERT_TRUE(run.until(1.0).in_contact);
    run.change([](LiveSettings& s) {
        s.static_friction = 0.5;
        s.dynamic_friction = 0.4;
    });
    for (int k = 0; k < 15; ++k) {  // friction fades in over ten steps
        const StepResult now = run.step();
        EXPECT_LT(std::abs(now.proxy.x - now.hip.x), 1e-6) << k;  // m
        EXPECT_LT(std::abs(now.force.x), 1e-6 * now.force.y) << k;
    }
    EXPECT_TRUE(run.simulation.tool().particles()[0].sticks());
}

TEST(LiveSettings, StepChangesHowOftenNotWhatFalls) {
    Runner run(scene_with("cloth-drop"));
    const auto height = [&] {
        const ParticleModel& model = run.simulation.model();
        double sum = 0.0;
        for (const Vec3& p : model.position) {
            sum += p.y;
        }
        return sum / static_cast<double>(model.size());
    };
    run.until(0.5);
    run.change([](LiveSettings& s) { s.step = 0.002; });
    run.until(0.8);
    run.change([](LiveSettings& s) { s.step = 0.02; });
    run.until(1.0);
    // 50, 150 and 10 steps; where the step fades from one length to the next, some fewer and some more.
    EXPECT_GT(run.simulation.steps(), 50u + 120u + 10u);
    EXPECT_LT(run.simulation.steps(), 50u + 150u + 20u);
    const double time = run.simulation.time();
    EXPECT_NEAR(time, 1.0, 0.02);
    // x = 10 - g t^2 / 2; the semi-implicit scheme adds g h t / 2 at most.
    EXPECT_NEAR(height(), 10.0 - 0.5 * 9.81 * time * time, 0.5 * 9.81 * 0.02);
    EXPECT_EQ(run.simulation.frame().step_ns, 20'000'000);
}

TEST(LiveSettings, WhatIsLedGoesOnWhereItWasWhenTheStepChanges) {
    Runner run(scene_with("fish-hold"));
    run.until(0.15);
    run.change([](LiveSettings& s) { s.step = 0.004; });
    run.until(0.25);
    // The neck: 15 mm at 0.1 s and back at 0.2 s, linear between (the scene's motion_offsets).
    const ParticleModel& model = run.simulation.model();
    const double t = run.simulation.time() - 0.2;
    double maximum = 0.0;
    for (std::size_t i = 0; i < model.size(); ++i) {
        const double x = model.rest_position[i].x;
        if (model.pinned[i] != 0 && x > 0.065 && x < 0.085) {
            maximum = std::max(maximum, glm::length(model.position[i] - model.rest_position[i]));
        }
    }
    EXPECT_NEAR(maximum, 0.015 * t / 0.1, 1e-9);
}

/// What a change makes of a scene's state in so many steps.
std::uint64_t hash_after(const Scene& scene, int before, int after, const char* change) {
    Runner run(scene);
    for (int k = 0; k < before + after; ++k) {
        if (k == before && change != nullptr) {
            run.simulation.change_settings(view::assigned(run.simulation.settings(), change));
        }
        (void)run.step();
    }
    return run.simulation.state_hash();
}

TEST(LiveSettings, EachHasAnEffectOnTheStateAndTheSameOneEachTime) {
    struct Case {
        const char* scene;
        int before;
        const char* change;
        std::vector<std::string> assignments = {};  // that leave something to do for the change
    };
    for (const Case& c :
         {Case{"cloth-drop", 150, "coupling.stiffness=20"},
          {"cloth-drop", 150, "proxy.radius=0.05"},
          {"cloth-drop", 150, "proxy.shrink=0.95"},
          {"cloth-drop", 150, "solver.iterations=3", {"model.material=none"}},
          {"cloth-drop", 150, "proxy.static_friction=0.5", {"model.offset=[0.05, 0.0, 0.0]"}},  // it slides off
          {"cloth-drop", 20, "solver.step=0.005"},
          {"popout-fan", 60, "contact.method=thesis"},
          {"popout-fan", 90, "contact.pop_out=thesis", {"contact.method=thesis"}}}) {
        const Scene scene = scene_with(c.scene, c.assignments);
        const std::uint64_t changed = hash_after(scene, c.before, 40, c.change);
        EXPECT_NE(changed, hash_after(scene, c.before, 40, nullptr)) << c.change;
        EXPECT_EQ(changed, hash_after(scene, c.before, 40, c.change)) << c.change;
    }
}

TEST(LiveSettings, StiffnessOfTheTorqueHoldsTheHandAgainstTurning) {
    // Both stiffnesses are of one energy, so the force may change too.
    Runner as_it_was(scene_with("curtain-hand"));
    Runner changed(scene_with("curtain-hand"));
    changed.change([](LiveSettings& s) { s.torque_stiffness *= 3.0; });
    const auto turned_by = [](const StepResult& result) {
        return glm::angle(glm::conjugate(result.hip_orientation) * result.proxy_orientation);
    };
    double before = 0.0;  // rad, sums over the steps
    double after = 0.0;
    for (int k = 0; k < 100; ++k) {
        before += turned_by(as_it_was.step());
        after += turned_by(changed.step());
    }
    EXPECT_GT(before, 0.1);
    EXPECT_LT(after, 0.9 * before) << "it bends as well";
}

TEST(LiveSettings, WhatIsTheSameChangesNoBit) {
    const Scene scene = scene_with("cloth-drop");
    EXPECT_EQ(hash_after(scene, 150, 40, "coupling.stiffness=10"), hash_after(scene, 150, 40, nullptr));
}

TEST(LiveSettings, RefusesWhatASceneFileMayNotSay) {
    Simulation simulation(plate());
    const LiveSettings settings = simulation.settings();
    for (const char* wrong :
         {"coupling.stiffness=-1", "proxy.radius=11", "proxy.shrink=1", "solver.iterations=1001", "solver.step=0.2",
          "proxy.static_friction=11", "contact.method=magic", "proxy.reach=0.01", "solver.step", "proxy.radius=wide"}) {
        EXPECT_THROW(simulation.change_settings(view::assigned(settings, wrong)), std::invalid_argument) << wrong;
    }
    EXPECT_EQ(simulation.settings(), settings);
}

TEST(LiveSettings, AfterRecouplingTheForceStartsAtZero) {
    Runner run(plate());
    const double full = glm::length(run.until(1.0).force);
    run.simulation.recouple();
    double last = 0.0;
    for (int k = 0; k < 10; ++k) {  // the clutch's fade is 0.1 s
        const double now = glm::length(run.step().force);
        EXPECT_LE(now - last, 0.11 * full) << k;
        last = now;
    }
    EXPECT_NEAR(last, full, 1e-3 * full);
}

}  // namespace
}  // namespace haptic::sim
