// host-sim check: what it writes of a scene's old keys.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "app/commands.hpp"
#include "haptic/sim/scene.hpp"
#include "program/exit_status.hpp"
#include "program/run_program.hpp"
#include "reproduce/scene_run.hpp"
#include "temporary_file.hpp"

namespace haptic::sim {
namespace {

struct Checked {
    int status = 0;
    std::string output;
    std::string errors;
};

Checked check_scene(std::vector<const char*> arguments) {
    CLI::App app("host-sim", "host-sim");
    const Command check = add_check_command(*app.add_subcommand("check", ""));
    arguments.insert(arguments.begin(), {"host-sim", "check"});
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    Checked checked;
    checked.status = run_program(app, static_cast<int>(arguments.size()), arguments.data(), check);
    checked.output = ::testing::internal::GetCapturedStdout();
    checked.errors = ::testing::internal::GetCapturedStderr();
    return checked;
}

TEST(CheckCommand, WritesOneLineForAnOldKeyAndAcceptsIt) {
    const test::TemporaryDirectory folder;
    const std::string file =
        folder.write("cloth.toml", "[model]\nvertices_per_side = 4\nlink_stiffness = 0.5\n").string();
    const Checked checked = check_scene({file.c_str()});
    EXPECT_EQ(checked.status, kExitDone);
    EXPECT_EQ(checked.errors, file +
                                  ":3: model.link_stiffness: depends on step and iterations; membrane_stiffness (N/m) "
                                  "of [model.material] replaces it (model.material = \"none\" keeps this method and "
                                  "ends this notice)\n");
    EXPECT_EQ(check_scene({file.c_str(), "--set", "model.material=none"}).errors, "");
}

TEST(CheckCommand, NamesTheMaterialWithWhichABodyCannotBeSolved) {
    const Checked checked =
        check_scene({"four-fish", "--set", "model.material.young_modulus=1e12", "--set", "model.material.density=0.001",
                     "--set", "model.material.poisson_ratio=0.48", "--set", "model.neighbours=6", "--set",
                     "solver.step=0.1", "--set", "solver.substeps=1"});
    EXPECT_EQ(checked.status, kExitFailed);
    EXPECT_THAT(checked.errors,
                ::testing::StartsWith("host-sim: four-fish.toml (built in):14: model.material: the body "
                                      "is too stiff for its mass with sub-steps of 100.0 ms"));
}

TEST(CheckCommand, WarnsOfVibrationsThatTheSubStepsDoNotResolveAsRunDoes) {
    const Checked checked = check_scene({"gel-block", "--set", "model.material.young_modulus=1e9"});
    EXPECT_EQ(checked.status, kExitDone);
    EXPECT_THAT(checked.errors, ::testing::StartsWith("warning: a body is as stiff as its material says, but vibrates "
                                                      "less than it: "));
    EXPECT_EQ(check_scene({"gel-block"}).errors, "");
}

TEST(CheckCommand, WritesALineForIterationsOfBodiesThatNeedNone) {
    const Checked checked = check_scene({"cloth-drop", "--set", "solver.iterations=5"});
    EXPECT_EQ(checked.status, kExitDone);
    EXPECT_EQ(checked.errors, "--set solver.iterations: has no effect where all bodies have a material; remove it\n");
    EXPECT_THAT(checked.output, ::testing::Not(::testing::HasSubstr("iterations")));
    const Checked without = check_scene({"cloth-drop", "--set", "model.material=none", "--set", "solver.iterations=5"});
    EXPECT_EQ(without.errors, "");
    EXPECT_THAT(without.output, ::testing::HasSubstr("iterations 5"));
}

TEST(CheckCommand, HasNothingToSayOfTheScenesOfTheThesis) {
    for (const BuiltInScene& scene : built_in_scenes()) {
        const std::string name(scene.name);
        Config config = open_scene(name);
        for (const std::string& assignment : reproduce::thesis_assignments(name)) {
            config.set(assignment);
        }
        EXPECT_THAT(read_scene(config, name).notices, ::testing::IsEmpty()) << name;
    }
}

}  // namespace
}  // namespace haptic::sim
