// Neither a step of any scene nor its capture for viewers allocates or frees memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "../rt-core/guards/allocation_guard.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "scene/hostile_hand.hpp"
#include "view/capture.hpp"

namespace haptic::sim {
namespace {

using haptic::test::AllocationGuard;

Scene scene_with(const std::string& name, const std::vector<std::string>& assignments) {
    Config config = open_scene(name);
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return read_scene(config, name);
}

/// Number of allocations in some steps, and numbers of steps without and with contact.
struct Count {
    std::size_t calls = 0;
    std::uint64_t free = 0;
    std::uint64_t in_contact = 0;

    void step(Simulation& simulation, const StepInput& input) {
        StepResult result;
        {
            const AllocationGuard guard;
            result = simulation.step(input);
            calls += guard.calls();
        }
        (result.in_contact ? in_contact : free) += 1;
    }
};

/// The whole script.
Count by_script(const Scene& scene) {
    Simulation simulation(scene);
    const std::int64_t step_ns = nanoseconds(scene.solver.step);
    Count count;
    for (std::int64_t t = 0; t < nanoseconds(scene.duration_s); t += step_ns) {
        count.step(simulation, simulation.scripted_input(t));
    }
    return count;
}

constexpr double kMaxSpeed = 5.0;  // m/s
constexpr double kMaxTurn = 15.0;  // rad/s
constexpr int kSteps = 250;

class StepAllocations : public testing::TestWithParam<std::string_view> {};

TEST_P(StepAllocations, AreNoneWithTheScriptedHandFreeAndInContact) {
    const Count count = by_script(scene_with(std::string(GetParam()), {}));
    EXPECT_EQ(count.calls, 0u);
    EXPECT_GT(count.free, 10u);
    EXPECT_GT(count.in_contact, 10u);
}

TEST_P(StepAllocations, AreNoneWithAHostileHandAndTheClutch) {
    Simulation simulation(scene_with(std::string(GetParam()), {}));
    HostileHand hand(3, kMaxSpeed, kMaxTurn, simulation.proxy());
    const Scene& scene = simulation.scene();
    const std::int64_t step_ns = nanoseconds(scene.solver.step);
    WorkspaceSettings narrower = scene.workspace;
    narrower.scale *= 0.5;
    Count count;
    for (int k = 0; k < kSteps; ++k) {
        StepInput input;
        input.time_ns = k * step_ns;
        input.device.position =
            simulation.workspace().to_device(hand.advance(scene.solver.step, simulation.vertices()));
        input.device.orientation = hand.orientation();
        input.buttons = k % 50 > 40 ? ~0u : 0u;
        if (k == kSteps / 2) {
            simulation.change_workspace(narrower);
        }
        count.step(simulation, input);
    }
    EXPECT_EQ(count.calls, 0u);
    EXPECT_GT(count.in_contact, 5u);
}

TEST_P(StepAllocations, AreNoneWhileItsSettingsChangeAndItIsShown) {
    Simulation simulation(scene_with(std::string(GetParam()), {}));
    view::SceneSnapshot moment;
    view::make_room(simulation, moment);
    std::int64_t time_ns = 0;
    std::size_t calls = 0;
    for (int k = 0; k < kSteps; ++k) {
        LiveSettings settings = simulation.settings();
        settings.stiffness *= k % 20 == 0 ? 1.1 : 1.0;
        settings.radius *= k % 30 == 0 ? 1.2 : 1.0;
        settings.static_friction = settings.dynamic_friction = k < kSteps / 2 ? 0.3 : 0.0;
        settings.iterations = 3 + k % 4;
        const AllocationGuard guard;
        simulation.change_settings(settings);
        const StepResult result = simulation.step(simulation.scripted_input(time_ns));
        view::capture(simulation, result, moment);
        calls += guard.calls();
        time_ns += nanoseconds(result.step);
    }
    EXPECT_EQ(calls, 0u);
}

INSTANTIATE_TEST_SUITE_P(Scenes, StepAllocations, testing::ValuesIn([] {
                             std::vector<std::string_view> names;
                             for (const BuiltInScene& scene : built_in_scenes()) {
                                 names.push_back(scene.name);
                             }
                             return names;
                         }()),
                         [](const auto& scene) {
                             std::string name(scene.param);
                             std::erase(name, '-');
                             return name;
                         });

TEST(StepAllocations, AreNoneWithTheThesisMethodsNorWithFriction) {
    for (const auto& settings : {std::vector<std::string>{"contact.method=thesis", "contact.pop_out=thesis"},
                                 {"contact.pop_out=thesis"},
                                 {"proxy.static_friction=0.6", "proxy.dynamic_friction=0.4", "solver.substeps=2"}}) {
        const Count count = by_script(scene_with("popout-fan", settings));
        EXPECT_EQ(count.calls, 0u) << settings[0];
        EXPECT_GT(count.in_contact, 10u) << settings[0];
    }
}

TEST(StepAllocations, AreNoneWithLoads) {
    const Count count = by_script(scene_with(
        "gel-block", {"duration=1",
                      "model.regions=[{low = [-1, -1, -1], high = [1, -0.018, 1], fixed = true}, {low = [-1, 0, -1], "
                      "high = [1, 1, 1], force = [0, 1, 0], pressure = 500.0, load_times = [0, 0.5], load_factors = "
                      "[0, 1], load_repeat = true}]"}));
    EXPECT_EQ(count.calls, 0u);
}

}  // namespace
}  // namespace haptic::sim
