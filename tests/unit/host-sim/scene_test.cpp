#include "haptic/sim/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace haptic::sim {
namespace {

using ::testing::HasSubstr;

Scene read(const std::string& toml) {
    const Config config = Config::parse(toml, "test.toml");
    return read_scene(config, "test");
}

std::string refusal(const std::string& toml) {
    try {
        (void)read(toml);
    } catch (const ConfigError& error) {
        return error.what();
    }
    return "accepted";
}

TEST(Scene, ClothDropIsTheExperimentOfTheThesis) {
    const Config config = open_scene("cloth-drop");
    const Scene scene = read_scene(config, "cloth-drop");
    EXPECT_EQ(scene.model.cloth.vertices_per_side, 33u);
    EXPECT_EQ(scene.model.cloth.side, 1.0);
    EXPECT_EQ(scene.model.cloth.centre, Vec3(0.0, 10.0, 0.0));
    EXPECT_EQ(scene.solver.step, 0.01);
    EXPECT_EQ(scene.solver.drag, 0.0);  // or it would not arrive at 14 m/s
    EXPECT_EQ(scene.proxy.radius, 0.03);
    EXPECT_EQ(scene.proxy.shrink, 0.999);
    EXPECT_GE(scene.coupling.stiffness, 10.0);
    EXPECT_LE(scene.coupling.stiffness, 20.0);
    EXPECT_EQ(scene.hand.at(0).position, Vec3(0.0));
    EXPECT_EQ(scene.hand.at(kNanosecondsPerSecond).position, Vec3(0.0));
    EXPECT_FALSE(scene.description.empty());
}

TEST(Scene, EveryBuiltInSceneCanBeRead) {
    for (const BuiltInScene& scene : built_in_scenes()) {
        EXPECT_NO_THROW((void)read_scene(open_scene(std::string(scene.name)), std::string(scene.name))) << scene.name;
    }
}

TEST(Scene, CanBeChangedKeyByKey) {
    Config config = open_scene("cloth-drop");
    config.set("model.shift=0.05");
    config.set("solver.iterations=3");
    const Scene scene = read_scene(config, "cloth-drop");
    EXPECT_EQ(scene.model.cloth.centre.y, 10.05);
    EXPECT_EQ(scene.solver.iterations, 3);
}

TEST(Scene, SaysHowTheProxyGetsClear) {
    EXPECT_EQ(read("").contact.pop_out, PopOutMethod::OrderFree);
    EXPECT_EQ(read("").contact.method, CcdMethod::Complete);
    EXPECT_EQ(read("[contact]\nmethod = \"thesis\"\n").contact.method, CcdMethod::Thesis);
    const ContactSettings contact =
        read(
            "[proxy]\nshrink = 0.99\n[contact]\npop_out = \"thesis\"\npop_out_limit = 7\npop_out_minimum = 0.02\n"
            "detection_range = 3.0\nhalf_space = true\n")
            .contact;
    EXPECT_EQ(contact.pop_out, PopOutMethod::Thesis);
    EXPECT_EQ(contact.pop_out_limit, 7);
    EXPECT_EQ(contact.pop_out_minimum, 0.02);
    EXPECT_EQ(contact.detection_range, 3.0);
    EXPECT_TRUE(contact.half_space);
    EXPECT_EQ(contact.shrink, 0.99);
}

TEST(Scene, FollowsTheScriptOfTheHand) {
    const Scene scene = read("[hand]\ntimes = [0.0, 2.0]\npositions = [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]\n");
    EXPECT_EQ(scene.hand.at(kNanosecondsPerSecond).position, Vec3(0.5, 1.0, 1.5));
}

TEST(Scene, RefusesWhatItDoesNotKnowWithTheLine) {
    EXPECT_THAT(refusal("[solver]\niteratoins = 3\n"), HasSubstr("test.toml:2"));
    EXPECT_THAT(refusal("[solver]\niteratoins = 3\n"), HasSubstr("solver.iterations"));
    EXPECT_THAT(refusal("[model]\ngenerator = \"torus\"\n"), HasSubstr("test.toml:2"));
}

TEST(Scene, RefusesValuesOutOfRange) {
    EXPECT_THAT(refusal("[solver]\nstep = -0.01\n"), HasSubstr("solver.step"));
    EXPECT_THAT(refusal("[model]\nmass = nan\n"), HasSubstr("model.mass"));
    EXPECT_THAT(refusal("[proxy]\nreach = 0.04\n"), HasSubstr("proxy.radius"));
    EXPECT_THAT(refusal("[hand]\ntimes = [0.0, 1.0]\npositions = [0.0, 0.0, 0.0]\n"), HasSubstr("hand.positions"));
    EXPECT_THAT(refusal("[hand]\ntimes = [1.0, 1.0]\npositions = [0, 0, 0, 1, 1, 1]\n"), HasSubstr("hand.times"));
    EXPECT_THAT(refusal("[workspace]\nrotation = [1.0, 1.0, 0.0, 0.0]\n"), HasSubstr("workspace.rotation"));
}

TEST(Scene, ListsTheKnownNamesForAnUnknownOne) {
    try {
        (void)open_scene("cloth-drip");
        FAIL() << "accepted";
    } catch (const ConfigError& error) {
        EXPECT_THAT(error.what(), HasSubstr("cloth-drop"));
    }
    EXPECT_THROW((void)open_scene("missing.toml"), ConfigError);
}

}  // namespace
}  // namespace haptic::sim
