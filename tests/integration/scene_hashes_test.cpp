// State hashes of the built-in scenes: the simulation computes the same bits on every machine and compiler.
//
// A change that is meant to change results changes these numbers, and says so in its commit. Moves, renames and
// simplifications do not.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::test {
namespace {

struct SceneHash {
    const char* scene;
    std::uint64_t after_200_steps;
};

class SceneHashes : public testing::TestWithParam<SceneHash> {};

TEST_P(SceneHashes, AreTheSameOnEveryMachineAndCompiler) {
    sim::Simulation simulation(sim::read_scene(sim::open_scene(GetParam().scene), GetParam().scene));
    const auto step_ns = static_cast<std::int64_t>(std::llround(simulation.scene().solver.step * 1e9));
    for (std::int64_t step = 0; step < 200; ++step) {
        simulation.step(simulation.scripted_input(step * step_ns));
    }
    EXPECT_EQ(simulation.state_hash(), GetParam().after_200_steps);
}

INSTANTIATE_TEST_SUITE_P(
    OfBuiltInScenes, SceneHashes,
    testing::Values(SceneHash{"cloth-drop", 0x7dba94228e87fc6b}, SceneHash{"popout-fan", 0xfa0286fca21d222c},
                    SceneHash{"fish-hold", 0xd2dd0c326e643608}, SceneHash{"fish-slide", 0x2d644d520161b7a9},
                    SceneHash{"four-fish", 0xdcb7d563cfe604d8}, SceneHash{"curtain-hand", 0xd239ef0da4d7d1d8},
                    SceneHash{"plane-slide", 0x8dee553b716559e3}, SceneHash{"rod-gap", 0xb175a41f0d005834},
                    SceneHash{"fish-grab", 0x141b9efd7ee2aae6}),
    [](const testing::TestParamInfo<SceneHash>& scene) {
        std::string name = scene.param.scene;
        for (char& c : name) {
            c = c == '-' ? '_' : c;
        }
        return name;
    });

}  // namespace
}  // namespace haptic::test
