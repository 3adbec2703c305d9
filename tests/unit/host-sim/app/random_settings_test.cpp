// Settings that change at random while a scene runs: nothing gets through, and a recorded run can be played again.
#include "app/random_settings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "app/recorded_run.hpp"
#include "app/replay.hpp"
#include "app/run.hpp"
#include "app/run_options.hpp"
#include "scene_with.hpp"
#include "temporary_file.hpp"
#include "view/live_parameters.hpp"

namespace haptic::sim {
namespace {

using test::scene_with;

struct Change {
    LiveSettings settings;
    std::string assignment;
};

/// Changes of the settings of a scene that stands, in so many steps of 10 ms.
std::vector<Change> changes_of(std::uint64_t seed, int steps, const char* scene = "cloth-drop",
                               const std::vector<std::string>& given = {}) {
    Simulation simulation(scene_with(scene));
    const LiveSettings own = simulation.settings();
    RandomSettings random(seed, simulation, own, given);
    const view::LiveParameters parameters(simulation, own);
    std::vector<Change> changes;
    for (int k = 0; k < steps; ++k) {
        if (const auto change = random.advance(0.01)) {
            const LiveSettings next = parameters.with(simulation.settings(), change->parameter, change->value);
            // What a viewer can ask for.
            const std::array<double, view::kMaxParameters> values = parameters.values(next);
            for (std::size_t p = 0; p < parameters.descriptions().size(); ++p) {
                const view::ParameterDescription& control = parameters.descriptions()[p];
                EXPECT_GE(values[p], control.min * (1.0 - 1e-12)) << control.key;
                EXPECT_LE(values[p], control.max * (1.0 + 1e-12)) << control.key;
            }
            if (next != simulation.settings()) {
                simulation.change_settings(next);
                changes.push_back({next, parameters.assignment(next, change->parameter)});
            }
        }
    }
    return changes;
}

TEST(RandomSettings, ChangeEverythingButTheMethods) {
    const std::vector<Change> changes = changes_of(1, 4000);
    std::set<std::string> keys;
    for (const Change& change : changes) {
        keys.insert(change.assignment.substr(0, change.assignment.find('=')));
        EXPECT_EQ(change.settings.method, CcdMethod::Complete);
        EXPECT_EQ(change.settings.pop_out, PopOutMethod::OrderFree);
    }
    EXPECT_EQ(keys, (std::set<std::string>{"coupling.stiffness", "proxy.radius", "proxy.shrink",
                                           "proxy.static_friction", "proxy.dynamic_friction", "solver.step"}));
    EXPECT_GT(changes.size(), 300u);  // in 40 s
}

TEST(RandomSettings, ChangeTheIterationsOfBodiesWithoutAMaterial) {
    const std::vector<Change> changes = changes_of(1, 1000, "plane-slide");
    EXPECT_TRUE(std::ranges::any_of(
        changes, [](const Change& change) { return change.assignment.starts_with("solver.iterations="); }));
}

TEST(RandomSettings, ChangeTheTorqueOfAToolOfSeveralSpheres) {
    const std::vector<Change> changes = changes_of(1, 1000, "curtain-hand");
    EXPECT_TRUE(std::ranges::any_of(
        changes, [](const Change& change) { return change.assignment.starts_with("coupling.torque_stiffness="); }));
}

TEST(RandomSettings, LeaveAloneWhatWasGiven) {
    const std::vector<Change> changes =
        changes_of(1, 4000, "cloth-drop", {"solver.step=0.01", " proxy.radius = 0.02", "model.shift=0.05"});
    const Scene scene = scene_with("cloth-drop");
    EXPECT_GT(changes.size(), 200u);
    for (const Change& change : changes) {
        EXPECT_EQ(change.settings.step, scene.solver.step);
        EXPECT_EQ(change.settings.radius, scene.proxy.radius);
    }
}

TEST(RandomSettings, AreForRunsInLockstepWithAValidSeed) {
    RunOptions options;
    options.scene = "cloth-drop";
    options.settings = "random:18446744073709551615";
    EXPECT_EQ(Plan(options).settings_seed, 18446744073709551615u);
    options.clock = "real";
    EXPECT_THROW((void)Plan(options), std::runtime_error);
    options.clock.clear();
    for (const char* wrong : {"random:", "random:x", "random:1.5", "random:-1", "hostile", ""}) {
        options.settings = wrong;
        EXPECT_THROW((void)Plan(options), std::runtime_error) << wrong;
    }
}

TEST(RandomSettings, AreTheSameForTheSameSeedOnly) {
    const std::vector<Change> one = changes_of(1, 1000);
    const std::vector<Change> again = changes_of(1, 1000);
    const std::vector<Change> other = changes_of(2, 1000);
    ASSERT_EQ(one.size(), again.size());
    std::size_t same = 0;
    for (std::size_t k = 0; k < one.size(); ++k) {
        EXPECT_EQ(one[k].assignment, again[k].assignment);
        same += k < other.size() && one[k].assignment == other[k].assignment ? 1U : 0U;
    }
    EXPECT_LT(same, one.size() / 4);
}

class UnderRandomSettings : public testing::TestWithParam<const char*> {
  protected:
    UnderRandomSettings() {
        options.scene = GetParam();
        options.duration_s = 1.5;
        options.hand = "hostile:1";
        options.settings = "random:1";
        options.record = folder_.file("run.csv");
        options.verify = true;
    }
    RunOptions options;

  private:
    haptic::test::TemporaryDirectory folder_;
};

TEST_P(UnderRandomSettings, NothingPassesAndTheRecordOfARunRepeatsIt) {
    EXPECT_EQ(sim::Run(options, Plan(options), nullptr).execute(), 0) << "something passed through";
    const RecordedRun record = RecordedRun::load(options.record);
    ASSERT_TRUE(record.notes());
    EXPECT_GT(record.notes()->changes.size(), 8u);
    Replay replay(scene_with(GetParam()), record, true);
    std::uint64_t in_contact = 0;
    for (StepResult result; replay.step(result);) {
        in_contact += result.in_contact ? 1u : 0u;
    }
    EXPECT_NEAR(replay.simulation().time(), 1.5, 0.05);  // the longest step
    EXPECT_FALSE(replay.diverged_at());
    EXPECT_GT(in_contact, 15u);
}

INSTANTIATE_TEST_SUITE_P(Scenes, UnderRandomSettings, testing::Values("cloth-drop", "four-fish", "curtain-hand"),
                         [](const auto& scene) {
                             std::string name(scene.param);
                             std::erase(name, '-');
                             return name;
                         });

}  // namespace
}  // namespace haptic::sim
