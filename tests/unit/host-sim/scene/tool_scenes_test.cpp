// Built-in scenes with tools demonstrate what they are made for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <optional>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"
#include "scene_with.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

using test::scene_with;

/// m, height at which the line through the tool's spheres crosses the plane z = 0 of the rod; nullopt if it does not.
std::optional<double> height_at_rod(const ToolProxies& tool) {
    std::vector<ToolProxy> row(tool.particles().begin(), tool.particles().end());
    std::sort(row.begin(), row.end(),
              [](const ToolProxy& p, const ToolProxy& q) { return p.rest_offset.z < q.rest_offset.z; });
    for (std::size_t k = 1; k < row.size(); ++k) {
        const Vec3& a = row[k - 1].position;
        const Vec3& b = row[k].position;
        if ((a.z <= 0.0) != (b.z <= 0.0)) {
            return a.y + (b.y - a.y) * (0.0 - a.z) / (b.z - a.z);
        }
    }
    return std::nullopt;
}

/// m, mean height of the particles of all bodies.
double mean_height(const Simulation& simulation) {
    double sum = 0.0;
    for (const Vec3& p : simulation.model().position) {
        sum += p.y;
    }
    return sum / static_cast<double>(simulation.model().size());
}

/// Mean height after that many seconds of the script.
double height_after(Simulation& simulation, double seconds_of_script) {
    const std::int64_t step_ns = nanoseconds(simulation.scene().solver.step);
    for (std::int64_t time_ns = 0; time_ns < nanoseconds(seconds_of_script); time_ns += step_ns) {
        (void)simulation.step(simulation.scripted_input(time_ns));
    }
    return mean_height(simulation);
}

// Figure 5.9: a thin rod between two spheres of the tool.
TEST(RodGap, LetsNoThinRodThroughAtAnyDepth) {
    Simulation simulation(scene_with("rod-gap", {}));
    simulation.set_verification(true);
    int pressed = 0;
    for (int k = 0; k < 300; ++k) {
        const StepResult result = simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{k}));
        EXPECT_FALSE(result.crossed) << k;
        const std::optional<double> height = height_at_rod(simulation.tool());
        ASSERT_TRUE(height.has_value()) << k;
        ASSERT_GT(*height, 0.0) << k;  // over the rod's axis
        if (result.hip.y < -0.02) {
            ++pressed;
            EXPECT_GT(result.force.y, 0.1) << k;  // N, up
        }
    }
    EXPECT_GT(pressed, 150);
}

TEST(RodGap, LetsItThroughWithOpenGapsAsInTheThesis) {
    Simulation simulation(scene_with("rod-gap", {"tool.close_gaps=false"}));
    for (int k = 0; k < 150; ++k) {
        (void)simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{k}));
    }
    EXPECT_LT(height_at_rod(simulation.tool()).value_or(0.0), -0.02);
}

/// Continues the script until a time.
void run_until(Simulation& simulation, double seconds_of_script) {
    const std::int64_t step_ns = nanoseconds(simulation.scene().solver.step);
    for (auto time_ns = static_cast<std::int64_t>(simulation.steps()) * step_ns;
         time_ns < nanoseconds(seconds_of_script); time_ns += step_ns) {
        (void)simulation.step(simulation.scripted_input(time_ns));
    }
}

// Times in the script of fish-grab, s.
constexpr double kLifted = 2.0;
constexpr double kHeadDown = 2.8;
constexpr double kPalmUp = 3.7;
constexpr double kLetGo = 6.5;

// The script's times and positions, but the hand rolls until the palm is up, and back: farther than a grip on strings.
constexpr const char* kRollOver =
    "hand.orientations=[1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0, "
    "0.7071067811865476, 0, 0, -0.7071067811865475,  0.7071067811865476, 0, 0, -0.7071067811865475, "
    "0, 0, 0, -1,  0, 0, 0, -1,  0.7071067811865476, 0, 0, -0.7071067811865475, "
    "1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0]";

/// fish-grab with a stiff hand.
struct StiffHandCase {
    const char* young_modulus;  // Pa
    const char* stiffness;      // N/m, of the coupling
    double room;                // m, between the hand and the grip
    std::size_t touching;       // spheres at once, at least
};

class StiffHand : public testing::TestWithParam<StiffHandCase> {};

TEST_P(StiffHand, ClosesRoundTheFishAndStaysAtTheGrip) {
    // Its fingers leave the fish little room: they press with many times the force that the hand feels. The hand is
    // displaced by what it holds, 40 mm thick, and the 19 mm by which it moves meanwhile, and by no more unless its
    // springs are soft: then by 18 to 102 mm, in 20 runs of the stiffest hand whose springs differ by 1e-11. In
    // one of four it does not lift the fish, but touches it with five spheres at least. Without skin
    // (contact_coupling.hpp) the fish was thrown off, with up to 10^20 N.
    constexpr double kEnd = 2.0;  // s of the script: the fish is lifted
    // N at the hand, where a soft one feels 0.6. The peak depends on the last bits: from 0.9 to 4.3 N in 50 runs of
    // the stiffest hand whose springs differ by a billionth.
    constexpr double kMaxForce = 6.0;
    Simulation simulation(
        scene_with("fish-grab", {std::string("tool.material.young_modulus=") + GetParam().young_modulus,
                                 std::string("coupling.stiffness=") + GetParam().stiffness}));
    const std::int64_t step_ns = nanoseconds(simulation.scene().solver.step);
    double largest = 0.0;
    std::size_t touching = 0;
    for (std::int64_t time_ns = 0; time_ns < nanoseconds(kEnd); time_ns += step_ns) {
        const StepResult result = simulation.step(simulation.scripted_input(time_ns));
        largest = std::max(largest, glm::length(result.hand_force));
        const ToolProxies& tool = simulation.tool();
        ASSERT_LT(glm::length(tool.pose().position - tool.hip().position), GetParam().room) << time_ns << " ns";
        const auto in_contact = [](const ToolProxy& p) { return p.in_contact(); };
        touching = std::max(touching, static_cast<std::size_t>(
                                          std::count_if(tool.particles().begin(), tool.particles().end(), in_contact)));
    }
    EXPECT_GE(touching, GetParam().touching) << "it does not hold the fish";
    EXPECT_GT(largest, 0.4) << "it does not meet the fish";
    EXPECT_LT(largest, kMaxForce);
}

INSTANTIATE_TEST_SUITE_P(ModuliAndStiffnesses, StiffHand,
                         testing::Values(StiffHandCase{"1e7", "300", 0.08, 4}, StiffHandCase{"1e7", "600", 0.06, 6},
                                         StiffHandCase{"1e8", "300", 0.12, 5}, StiffHandCase{"1e8", "750", 0.06, 6}),
                         [](const testing::TestParamInfo<StiffHandCase>& hand) {
                             return std::string(hand.param.young_modulus) + "Pa_" + hand.param.stiffness;
                         });

TEST(FishGrab, HoldsTheFishFromBothSidesWithThePalmOverBesideAndUnderIt) {
    Simulation simulation(scene_with("fish-grab", {kRollOver}));
    const double lay_at = height_after(simulation, 0.1);
    run_until(simulation, kLifted);
    const auto over_palm = [&] { return mean_height(simulation) - simulation.tool().hip().position.y; };
    EXPECT_GT(mean_height(simulation), lay_at + 0.1);  // m
    EXPECT_LT(over_palm(), -0.03) << "the palm is not over the fish";
    double from_fingers = 0.0;  // m, sum of the depths of goals beyond surfaces that push along z
    double from_thumb = 0.0;
    for (const ToolProxy& p : simulation.tool().particles()) {
        if (p.in_contact()) {
            const double z = p.constrained_goal.z - p.goal.z;
            (z < 0.0 ? from_fingers : from_thumb) += std::abs(z);
        }
    }
    EXPECT_GT(from_fingers, 0.01);
    EXPECT_GT(from_thumb, 0.01);
    run_until(simulation, kHeadDown);
    EXPECT_GT(mean_height(simulation), lay_at + 0.1);
    EXPECT_LT(std::abs(over_palm()), 0.03) << "the fish does not hang beside the palm";
    run_until(simulation, kPalmUp);
    EXPECT_GT(over_palm(), 0.03) << "the palm is not under the fish";
    run_until(simulation, kLetGo);
    EXPECT_LT(mean_height(simulation), lay_at + 0.03);
}

TEST(FishGrab, SlipsFromASmoothHand) {
    Simulation smooth(scene_with("fish-grab", {"proxy.static_friction=0", "proxy.dynamic_friction=0"}));
    const double lay_at = height_after(smooth, 0.1);
    run_until(smooth, kLifted);
    EXPECT_LT(mean_height(smooth), lay_at + 0.03);
}

TEST(FishGrab, IsNotLiftedByAHandThatStaysOpen) {
    Scene scene = scene_with("fish-grab", {});
    scene.curl = {};
    Simulation open(scene);
    const double lay_at = height_after(open, 0.1);
    run_until(open, kLifted);
    EXPECT_LT(mean_height(open), lay_at + 0.03);
}

TEST(FishGrab, ClosesByAButtonWithoutAScript) {
    Simulation simulation(scene_with("fish-grab", {"tool.close_speed=1.0"}));
    StepInput input = simulation.scripted_input(0);
    const double open = simulation.tool().curl();
    EXPECT_NEAR(open, 0.12, 1e-12);
    input.curl.reset();
    input.buttons = 2;
    for (int k = 0; k < 100; ++k) {
        (void)simulation.step(input);
    }
    EXPECT_NEAR(simulation.tool().curl(), open + 0.2, 1e-9);  // in 0.2 s
    for (int k = 0; k < 500; ++k) {
        (void)simulation.step(input);
    }
    EXPECT_NEAR(simulation.tool().curl(), 0.5, 1e-12);
    input.buttons = 1;
    for (int k = 0; k < 600; ++k) {
        (void)simulation.step(input);
    }
    EXPECT_NEAR(simulation.tool().curl(), open, 1e-12);
}

}  // namespace
}  // namespace haptic::sim
