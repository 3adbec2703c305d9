// Notices on keys of stiffness and mass that a material has replaced.
#include "model/old_keys.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "haptic/sim/scene.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

std::vector<std::string> notices(const std::string& toml, const std::vector<std::string>& assignments = {}) {
    Config config = Config::parse(toml, "scene.toml");
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return read_scene(config, "scene").notices;
}

TEST(OldKeys, AreNamedWithTheirPlaceAndTheirSuccessor) {
    EXPECT_THAT(notices("[model]\ngenerator = \"cloth\"\nlink_stiffness = 0.5\nmass = 0.2\n"),
                ElementsAre("scene.toml:3: model.link_stiffness: depends on step and iterations; membrane_stiffness "
                            "(N/m) of [model.material] replaces it (model.material = \"none\" keeps this method and "
                            "ends this notice)",
                            AllOf(StartsWith("scene.toml:4: model.mass: "), HasSubstr("areal_density (kg/m^2)"))));
    EXPECT_THAT(notices("[model]\ngenerator = \"curtain\"\ngroup_compliance = 1e-4\nlink_compliance = 1e-4\n"),
                ElementsAre(AllOf(HasSubstr("membrane_stiffness"), HasSubstr("bending_stiffness")),
                            AllOf(HasSubstr("membrane_stiffness"), Not(HasSubstr("bending_stiffness")))));
}

TEST(OldKeys, HaveASuccessorForTheKindOfBody) {
    for (const char* generator : {"block", "fish", "organ"}) {
        EXPECT_THAT(
            notices("[model]\ngenerator = \"" + std::string(generator) + "\"\ngroup_stiffness = 0.5\nmass = 0.2\n"),
            ElementsAre(AllOf(HasSubstr("; young_modulus (Pa) of [model.material]"), Not(HasSubstr("membrane"))),
                        AllOf(HasSubstr("; density (kg/m^3) of [model.material]"), Not(HasSubstr("areal")))));
    }
}

TEST(OldKeys, OfRegionsAndObjectsAreNamedOnceEach) {
    const std::string region = "low = [-1, -1, -1]\nhigh = [1, 1, 1]\nstiffness = 0.9\n";
    const std::string toml = "[model]\ngenerator = \"fish\"\n[[model.regions]]\n" + region + "[[model.regions]]\n" +
                             region + "[[objects]]\ngenerator = \"block\"\n[[objects]]\ngenerator = \"cloth\"\n" +
                             "mass = 0.1\n";
    EXPECT_THAT(notices(toml),
                ElementsAre(AllOf(StartsWith("scene.toml:6: model.regions.0.stiffness: "),
                                  HasSubstr("[model.material] and [model.regions.material]")),
                            AllOf(StartsWith("scene.toml:15: objects.1.mass: "), HasSubstr("[objects.material]"),
                                  HasSubstr("material = \"none\" in [[objects]]"))));
}

TEST(OldKeys, OfTheCommandLineAreNamedToo) {
    EXPECT_THAT(notices("[model]\ngenerator = \"fish\"\n", {"model.group_stiffness=0.5"}),
                ElementsAre(StartsWith("--set model.group_stiffness: depends on step and iterations")));
}

TEST(OldKeys, HaveNoNoticeWithTheMaterialNoneNorForRigidBodies) {
    const std::string keys = "group_stiffness = 0.5\nlink_stiffness = 0.5\nmass = 0.2\n";
    EXPECT_THAT(notices("[model]\ngenerator = \"cloth\"\nmaterial = \"none\"\n" + keys), IsEmpty());
    EXPECT_THAT(notices("[model]\ngenerator = \"cloth\"\n" + keys, {"model.material=none"}), IsEmpty());
    EXPECT_THAT(notices("[model]\ngenerator = \"plate\"\nmass = 2\n[[objects]]\ngenerator = \"rod\"\nmass = 1\n"),
                IsEmpty());
}

TEST(OldKeys, WithAMaterialAreRefused) {
    EXPECT_THROW((void)notices("[model]\ngenerator = \"cloth\"\nmass = 0.2\n[model.material]\nname = \"cotton\"\n"),
                 ConfigError);
}

TEST(OldKeys, AreInNoBuiltInScene) {
    for (const BuiltInScene& scene : built_in_scenes()) {
        const std::string name(scene.name);
        EXPECT_THAT(read_scene(open_scene(name), name).notices, IsEmpty()) << name;
    }
}

}  // namespace
}  // namespace haptic::sim
