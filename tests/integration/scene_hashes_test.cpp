// State hashes of the built-in scenes: the simulation computes the same bits on every machine and compiler.
//
// A change that is meant to change results changes these numbers, and says so in its commit. Moves, renames and
// simplifications do not.
#include <gtest/gtest.h>

#include <algorithm>
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
    testing::Values(SceneHash{"cloth-drop", 0xa0d8d35b3560f53c}, SceneHash{"popout-fan", 0x81779f75d9ec0aae},
                    SceneHash{"fish-hold", 0xb6178edbb2a92431}, SceneHash{"fish-slide", 0x4aad84273581da56},
                    SceneHash{"four-fish", 0x0b466e10728509e0}, SceneHash{"curtain-hand", 0xef58a4cc112a0430},
                    SceneHash{"plane-slide", 0xb3a8003b50888e92}, SceneHash{"rod-gap", 0x2e08af4cbd3ae235},
                    SceneHash{"fish-grab", 0x9412656168172280, 900},  // touches from step 230 on
                    SceneHash{"gel-block", 0xae1e965be38b326c, 400}, SceneHash{"organ-lift", 0x4dd9e4539be823db, 400},
                    SceneHash{"cloth-drop", 0x489290352dd759a4, 200, true},
                    SceneHash{"curtain-hand", 0x8b6591e5005b2366, 200, true},
                    SceneHash{"fish-hold", 0x58957e76f7e699df, 200, true},
                    SceneHash{"fish-slide", 0xe582b1d92a1569ff, 200, true},
                    SceneHash{"four-fish", 0x3fb99c9f393b47a0, 200, true}),
    [](const testing::TestParamInfo<SceneHash>& scene) {
        std::string name = scene.param.scene;
        for (char& c : name) {
            c = c == '-' ? '_' : c;
        }
        return name + (scene.param.as_in_thesis ? "_as_in_thesis" : "");
    });

class ThreadsOfScenes : public testing::TestWithParam<const char*> {};

TEST_P(ThreadsOfScenes, ChangeNoBit) {
    std::uint64_t of_one = 0;
    for (const char* const threads : {"1", "2", "4"}) {
        Config config = sim::open_scene(GetParam());
        config.set(std::string("solver.threads=") + threads);
        sim::Simulation simulation(sim::read_scene(config, GetParam()));
        const auto step_ns = static_cast<std::int64_t>(std::llround(simulation.scene().solver.step * 1e9));
        for (std::int64_t step = 0; step < 250; ++step) {
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
