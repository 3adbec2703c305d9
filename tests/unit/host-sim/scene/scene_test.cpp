#include "haptic/sim/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "haptic/sim/live_settings.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
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
    EXPECT_EQ(scene.solver.drag, 0.0);  // so that it arrives at 14 m/s
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

TEST(Scene, KnowsItsTrianglesBeforeItMakesThem) {
    for (const char* model :
         {"generator = 'cloth'\nvertices_per_side = 5", "generator = 'curtain'\nvertices_per_side = 4",
          "generator = 'fan'\nrim_vertices = 9", "generator = 'fish'\nrefinements = 0",
          "generator = 'plate'\ncells = 3", "generator = 'rod'\nlength = 3.0", "generator = 'block'\ncells = 7",
          "generator = 'organ'\nrefinements = 1"}) {
        const Scene scene = read("[model]\n" + std::string(model) + "\n[[model.copies]]\n[[model.copies]]\n");
        std::size_t triangles = 0;
        for (const DeformableBody& body : make_bodies(scene.model)) {
            triangles += body.mesh.triangles.size();
        }
        EXPECT_EQ(expected_triangles(scene.model), triangles) << model;
    }
}

TEST(Scene, RefusesWhatWouldFillTheMemory) {
    std::string copies;
    for (int i = 0; i < 8; ++i) {
        copies += "[[model.copies]]\n";
    }
    const std::string large = "[model]\nvertices_per_side = 257\n";  // 262,144 triangles
    EXPECT_THAT(refusal(large + copies), HasSubstr("2097152 triangles, more than the 2000000"));
    EXPECT_EQ(refusal(large + copies.substr(17)), "accepted");
    EXPECT_THAT(refusal(large + copies.substr(17) + "[[objects]]\nvertices_per_side = 257\n"), HasSubstr("triangles"));
    std::string objects;
    for (int i = 0; i < 256; ++i) {
        objects += "[[objects]]\nvertices_per_side = 2\n";
    }
    EXPECT_THAT(refusal(objects), HasSubstr("257 bodies, more than the 256"));
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

TEST(Scene, MakesSurfacesRoughWhereAsked) {
    EXPECT_EQ(read("").contact.static_friction, 0.0);
    EXPECT_EQ(read("").contact.dynamic_friction, 0.0);
    const ContactSettings contact = read("[proxy]\nstatic_friction = 0.8\ndynamic_friction = 0.5\n").contact;
    EXPECT_EQ(contact.static_friction, 0.8);
    EXPECT_EQ(contact.dynamic_friction, 0.5);
    EXPECT_THAT(refusal("[proxy]\nstatic_friction = 0.2\ndynamic_friction = 0.3\n"), HasSubstr("dynamic_friction"));
}

TEST(Scene, FollowsTheScriptOfTheHand) {
    const Scene scene = read("[hand]\ntimes = [0.0, 2.0]\npositions = [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]\n");
    EXPECT_EQ(scene.hand.at(kNanosecondsPerSecond).position, Vec3(0.5, 1.0, 1.5));
    EXPECT_EQ(scene.hand.at(kNanosecondsPerSecond).orientation, Quat(1.0, 0.0, 0.0, 0.0));
}

TEST(Scene, TurnsTheHandAsItsScriptSays) {
    const std::string hand = "[hand]\ntimes = [0.0, 2.0]\npositions = [0, 0, 0, 0, 0, 0]\norientations = ";
    // From 0 to 180 degrees about y: 90 degrees at half the time.
    const Scene scene = read(hand + "[1, 0, 0, 0, 0, 0, 1, 0]\n");
    const Vec3 turned = scene.hand.at(kNanosecondsPerSecond).orientation * Vec3(1.0, 0.0, 0.0);
    EXPECT_NEAR(glm::length(turned - Vec3(0.0, 0.0, -1.0)), 0.0, 1e-12);
    EXPECT_THAT(refusal(hand + "[1, 0, 0, 0]\n"), HasSubstr("test.toml:4"));
    EXPECT_THAT(refusal(hand + "[1, 0, 0, 0]\n"), HasSubstr("four numbers"));
    EXPECT_THAT(refusal(hand + "[1, 0, 0, 0, 0.5, 0, 0, 0.5]\n"), HasSubstr("quaternion 1 must be of unit length"));
}

TEST(Scene, RefusesWhatItDoesNotKnowWithTheLine) {
    EXPECT_THAT(refusal("[solver]\niteratoins = 3\n"), HasSubstr("test.toml:2"));
    EXPECT_THAT(refusal("[solver]\niteratoins = 3\n"), HasSubstr("solver.iterations"));
    EXPECT_THAT(refusal("[model]\ngenerator = \"torus\"\n"), HasSubstr("test.toml:2"));
}

TEST(Scene, RefusesValuesOutOfRange) {
    EXPECT_THAT(refusal("[solver]\nstep = -0.01\n"), HasSubstr("solver.step"));
    EXPECT_THAT(refusal("[model]\nmass = nan\n"), HasSubstr("model.mass"));
    // Removed keys name what replaces them, or why nothing does.
    EXPECT_THAT(refusal("[coupling]\nshare = \"series\"\n"), HasSubstr("tool.material.rigid"));
    EXPECT_THAT(refusal("[coupling]\ntied_mass = 0.1\n"), HasSubstr("coupling.tied_mass: was removed: the damping"));
    EXPECT_THAT(refusal("[tool]\ngroup_stiffness = 0.3\n"), HasSubstr("tool.material.young_modulus"));
    EXPECT_THAT(refusal("[tool]\nmass = 1.0\n"), HasSubstr("tool.mass: was removed: a tool has no mass"));
    EXPECT_THAT(refusal("[coupling]\nstiffness = 0.0\ntorque_stiffness = 1.0\n"),
                HasSubstr("coupling.torque_stiffness"));
    EXPECT_THAT(refusal("[hand]\ntimes = [0.0, 1.0]\npositions = [0.0, 0.0, 0.0]\n"), HasSubstr("hand.positions"));
    EXPECT_THAT(refusal("[hand]\ntimes = [1.0, 1.0]\npositions = [0, 0, 0, 1, 1, 1]\n"), HasSubstr("hand.times"));
    EXPECT_THAT(refusal("[hand]\ncurl = [0.5]\n"), HasSubstr("tool.generator = \"hand\""));
    EXPECT_THAT(refusal("[tool]\ngenerator = \"rod\"\n[hand]\ncurl = [0.5]\n"), HasSubstr("test.toml:4"));
    EXPECT_THAT(refusal("[tool]\ngenerator = \"hand\"\n[hand]\ncurl = [0.5, 0.5]\n"), HasSubstr("hand.curl"));
    EXPECT_THAT(refusal("[tool]\ngenerator = \"hand\"\n[hand]\ncurl = [1.5]\n"), HasSubstr("hand.curl"));
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

TEST(SceneReference, DescribesExactlyTheKeysThatAreRead) {
    Config config = open_scene("cloth-drop");
    config.set("model.material=none");
    config.set("model.regions=[{low=[-1, -1, -1], high=[1, 1, 1], fixed=true}]");
    config.set("model.copies=[{position=[0, 0, 0]}]");
    config.set("tool.generator=sphere");
    (void)read_scene(config, "every key");
    // A body with a material has neither masses nor stiffnesses of its own.
    Config with_material = Config::parse("[model.material]\nname = \"silk\"\n", "test.toml");
    (void)read_scene(with_material, "material");
    std::vector<std::string> known = config.known_keys();
    for (const std::string& key : with_material.known_keys()) {
        if (key.starts_with("model.material")) {
            known.push_back(key);
        }
    }
    std::vector<std::string> read;
    for (std::string key : known) {
        if (const std::size_t index = key.find(".0."); index != std::string::npos) {
            key.erase(index, 2);  // "model.regions.0.low" is described as "model.regions.low"
        }
        // Neither lists of tables nor a table that may be a name are settings.
        if (key != "model.regions" && key != "model.copies" && key != "objects" && key != "model.material") {
            read.push_back(key);
        }
    }
    std::vector<std::string> described;
    for (const SettingSection& section : scene_reference()) {
        for (const SettingDescription& setting : section.settings) {
            described.push_back(full_key(section, setting));
            EXPECT_FALSE(setting.meaning.empty()) << described.back();
        }
    }
    EXPECT_THAT(described, testing::UnorderedElementsAreArray(read));
}

TEST(SceneReference, WritesAFileThatReadsBackToTheDefaults) {
    const Scene written = read(default_scene_text());
    const Scene built_in = read("[model]\ngenerator = \"cloth\"\n");
    EXPECT_EQ(written.duration_s, built_in.duration_s);
    EXPECT_EQ(written.model.mass, built_in.model.mass);
    EXPECT_EQ(written.model.file_scale, built_in.model.file_scale);
    EXPECT_EQ(written.model.cloth.centre, built_in.model.cloth.centre);
    EXPECT_EQ(written.model.builder.particles, built_in.model.builder.particles);
    EXPECT_EQ(written.solver.shape_damping, built_in.solver.shape_damping);
    EXPECT_EQ(written.solver.gravity, built_in.solver.gravity);
    EXPECT_EQ(written.collisions.push_out_speed, built_in.collisions.push_out_speed);
    EXPECT_EQ(written.contact.method, built_in.contact.method);
    EXPECT_EQ(written.workspace, built_in.workspace);
    EXPECT_EQ(live_settings_of(written), live_settings_of(built_in));
    EXPECT_FALSE(written.tool) << "an optional table is commented out";
    EXPECT_TRUE(written.model.regions.empty());
}

TEST(Scene, AcceptsFormerNamesOfKeys) {
    testing::internal::CaptureStderr();
    const Scene scene = read("[solver]\nsettling = 3.0\n[collisions]\nmost_substeps = 4\n[coupling]\nloss = 0.5\n");
    EXPECT_EQ(scene.solver.shape_damping, 3.0);
    EXPECT_EQ(scene.collisions.max_substeps, 4);
    EXPECT_EQ(scene.coupling.hunt_crossley_damping, 0.5);
    EXPECT_THAT(testing::internal::GetCapturedStderr(),
                AllOf(HasSubstr("test.toml:2: solver.settling: is the former name of solver.shape_damping"),
                      HasSubstr("test.toml:6: coupling.loss: is the former name of coupling.hunt_crossley_damping")));
}

TEST(Scene, ClosesTheHandAsItsScriptSays) {
    const Scene scene = read(
        "[tool]\ngenerator = \"hand\"\ncurl = 0.3\n[hand]\ntimes = [1.0, 3.0]\npositions = [0, 0, 0, 0, 0, 0]\n"
        "curl = [0.2, 0.6]\n");
    ASSERT_TRUE(scene.curl.known());
    EXPECT_EQ(scene.curl.at(0), 0.2);
    EXPECT_NEAR(scene.curl.at(nanoseconds(1.5)), 0.3, 1e-12);
    EXPECT_NEAR(scene.curl.at(nanoseconds(2.5)), 0.5, 1e-12);
    EXPECT_EQ(scene.curl.at(nanoseconds(9.0)), 0.6);
    EXPECT_FALSE(read("[tool]\ngenerator = \"hand\"\n").curl.known());
}

}  // namespace
}  // namespace haptic::sim
