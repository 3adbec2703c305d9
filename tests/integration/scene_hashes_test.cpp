// State hashes of the built-in scenes: the simulation computes the same bits on every machine and compiler.
//
// A change that is meant to change results changes these numbers, and says so in its commit. Moves, renames and
// simplifications do not.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "reproduce/scene_run.hpp"

namespace haptic::test {
namespace {

struct SceneHash {
    const char* scene;
    std::uint64_t hash;
    int steps = 200;
    bool as_in_thesis = false;  // with the thesis' solver, as figures are reproduced
};

class SceneHashes : public testing::TestWithParam<SceneHash> {};

TEST_P(SceneHashes, AreTheSameOnEveryMachineAndCompiler) {
    Config config = sim::open_scene(GetParam().scene);
    if (GetParam().as_in_thesis) {
        for (const std::string& assignment : sim::reproduce::thesis_assignments(GetParam().scene)) {
            config.set(assignment);
        }
    }
    sim::Simulation simulation(sim::read_scene(config, GetParam().scene));
    const auto step_ns = static_cast<std::int64_t>(std::llround(simulation.scene().solver.step * 1e9));
    for (std::int64_t step = 0; step < GetParam().steps; ++step) {
        simulation.step(simulation.scripted_input(step * step_ns));
    }
    EXPECT_EQ(simulation.state_hash(), GetParam().hash);
}

INSTANTIATE_TEST_SUITE_P(
    OfBuiltInScenes, SceneHashes,
    testing::Values(SceneHash{"cloth-drop", 0x2c6047e3719263df}, SceneHash{"popout-fan", 0xd298087ab8795260},
                    SceneHash{"fish-hold", 0x2bff212ab8a7180f}, SceneHash{"fish-slide", 0xf6426a55b91de6dc},
                    SceneHash{"four-fish", 0xd25ad0e3a10b0c34}, SceneHash{"curtain-hand", 0xaa01e7477da9d5c9},
                    SceneHash{"plane-slide", 0xcf310d5d7e028f19}, SceneHash{"rod-gap", 0x920bdf496c32c3cf},
                    SceneHash{"fish-grab", 0x079d348bc5d16f19, 900},  // touches from step 230 on
                    SceneHash{"gel-block", 0x0e6aee5b52fe0766, 400}, SceneHash{"organ-lift", 0x4b4eea064a3b43e3, 400},
                    SceneHash{"cloth-drop", 0xadc97681a27b23de, 200, true},
                    SceneHash{"curtain-hand", 0x64a2abb1d8954980, 200, true},
                    SceneHash{"fish-hold", 0x8c8e556429608490, 200, true},
                    SceneHash{"fish-slide", 0xf538c8e73576d0fd, 200, true},
                    SceneHash{"four-fish", 0x9f2ff873e7b29ab5, 200, true}),
    [](const testing::TestParamInfo<SceneHash>& scene) {
        std::string name = scene.param.scene;
        for (char& c : name) {
            c = c == '-' ? '_' : c;
        }
        return name + (scene.param.as_in_thesis ? "_as_in_thesis" : "");
    });

// The thread sanitizer looks for races, and need not ask again whether the bits are the same.
#ifdef HAPTIC_LOOKS_FOR_RACES
constexpr std::array kThreads = {"4"};
constexpr std::int64_t kSteps = 100;
#else
constexpr std::array kThreads = {"1", "2", "4"};
constexpr std::int64_t kSteps = 250;
#endif

class ThreadsOfScenes : public testing::TestWithParam<const char*> {};

TEST_P(ThreadsOfScenes, ChangeNoBit) {
    std::uint64_t of_one = 0;
    for (const char* const threads : kThreads) {
        Config config = sim::open_scene(GetParam());
        config.set(std::string("solver.threads=") + threads);
        sim::Simulation simulation(sim::read_scene(config, GetParam()));
        const auto step_ns = static_cast<std::int64_t>(std::llround(simulation.scene().solver.step * 1e9));
        for (std::int64_t step = 0; step < kSteps; ++step) {
            simulation.step(simulation.scripted_input(step * step_ns));
        }
        of_one = of_one == 0 ? simulation.state_hash() : of_one;
        EXPECT_EQ(simulation.state_hash(), of_one) << threads << " threads";
    }
}

// Bodies in contact, a sheet, one solid body, and the thesis' solver.
INSTANTIATE_TEST_SUITE_P(OfBuiltInScenes, ThreadsOfScenes,
                         testing::Values("four-fish", "cloth-drop", "gel-block", "popout-fan"),
                         [](const testing::TestParamInfo<const char*>& scene) {
                             std::string name = scene.param;
                             name.erase(std::remove(name.begin(), name.end(), '-'), name.end());
                             return name;
                         });

}  // namespace
}  // namespace haptic::test
