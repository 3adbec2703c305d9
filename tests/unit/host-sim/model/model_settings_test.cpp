#include "haptic/sim/model_settings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/sim/mesh_check.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {
namespace {

ModelSettings read_settings(const std::string& toml) {
    const Config config = Config::parse(toml, "scene.toml");
    ModelSettings settings = read_model(config, "model");
    config.reject_unknown();
    return settings;
}

std::string settings_refusal(const std::string& toml) {
    try {
        (void)make_bodies(read_settings(toml));
    } catch (const ConfigError& error) {
        return error.what();
    }
    return "";
}

TEST(ModelSettings, MakeEachGeneratedBody) {
    const auto count = [](const std::string& generator) {
        const DeformableBody body = make_body(read_settings("[model]\ngenerator = \"" + generator + "\"\n"));
        EXPECT_EQ(body.name, generator);
        EXPECT_NO_THROW(body.particles.check());
        return body.particles.size();
    };
    EXPECT_EQ(count("block"), 137u);
    EXPECT_EQ(count("cloth"), 1089u);
    EXPECT_EQ(count("curtain"), 1089u);
    EXPECT_EQ(count("fan"), 33u);
    EXPECT_EQ(count("fish"), 137u);
    EXPECT_EQ(count("organ"), 137u);
    EXPECT_EQ(count("plate"), 162u);
    EXPECT_EQ(count("rod"), 24u);
}

TEST(ModelSettings, GiveEachGeneratorItsOwnDefaultsOfSharedKeys) {
    const auto settings = [](const std::string& keys) { return read_settings("[model]\ngenerator = " + keys + "\n"); };
    EXPECT_EQ(settings("\"block\"").block.size, Vec3(0.12, 0.04, 0.08));
    EXPECT_EQ(settings("\"block\"").block.cells, 12u);
    EXPECT_EQ(settings("\"plate\"").plate.size, Vec3(1.0, 0.05, 1.0));
    EXPECT_EQ(settings("\"plate\"").plate.cells, 8u);
    EXPECT_EQ(settings("\"fish\"").fish.length, 0.3);
    EXPECT_EQ(settings("\"organ\"").organ.length, 0.2);
    EXPECT_EQ(settings("\"rod\"").rod.length, 1.0);
    const ModelSettings block = settings("\"block\"\nsize = [0.1, 0.2, 0.3]\ncells = 5");
    EXPECT_EQ(block.block.size, Vec3(0.1, 0.2, 0.3));
    EXPECT_EQ(block.block.cells, 5u);
    const ModelSettings organ = settings("\"organ\"\nlength = 0.1\nrefinements = 2");
    EXPECT_EQ(organ.organ.length, 0.1);
    EXPECT_EQ(organ.organ.refinements, 2u);
}

TEST(ModelSettings, PlaceCopiesOfOneBody) {
    const std::vector<DeformableBody> bodies = make_bodies(read_settings(
        "[model]\ngenerator = \"fan\"\nvelocity = [0, 1, 0]\n[[model.copies]]\n[[model.copies]]\nposition = [0, 0, "
        "9]\nvelocity = [1, 0, 0]\n"));
    ASSERT_EQ(bodies.size(), 2u);
    EXPECT_EQ(bodies[1].particles.position[0], bodies[0].particles.position[0] + Vec3(0.0, 0.0, 9.0));
    EXPECT_EQ(bodies[0].particles.velocity[0], Vec3(0.0, 1.0, 0.0));
    EXPECT_EQ(bodies[1].particles.velocity[0], Vec3(1.0, 1.0, 0.0));
    EXPECT_EQ(bodies[1].particles.velocity[1], Vec3(0.0));  // of the rim, which is fixed
}

TEST(ModelSettings, GiveRegionsTheirStiffnessAndMotion) {
    const std::string toml = R"([model]
generator = "fish"
particles_count = 40
orientation = [0.0, 0.0, 1.0, 0.0]
offset = [5.0, 0.0, 0.0]
[[model.regions]]
low = [0.05, -1, -1]
high = [1, 1, 1]
stiffness = 0.9
[[model.regions]]
low = [-0.03, -1, -1]
high = [0.03, 1, 1]
fixed = true
[[model.regions]]
low = [-1, -1, -1]
high = [-0.1, 1, 1]
motion_times = [0.0, 0.5]
motion_offsets = [0, 0, 0,  0.1, 0, 0]
motion_repeat = true
)";
    const DeformableBody body = make_bodies(read_settings(toml)).front();
    const ParticleModel& model = body.particles;
    ASSERT_EQ(body.motions.size(), 1u);
    EXPECT_TRUE(body.motions[0].repeat);
    EXPECT_EQ(body.motions[0].offsets[1], Vec3(-0.1, 0.0, 0.0));  // turned with the body
    std::size_t head = 0;
    for (const Group& group : model.groups) {
        const std::uint32_t i = group.centre;
        const double x = 5.0 - model.rest_position[i].x;  // of the fish, which is turned about y by half a turn
        EXPECT_EQ(group.stiffness, x >= 0.05 ? 0.9 : 0.6);
        EXPECT_EQ(model.pinned[i], std::abs(x) <= 0.03 || x <= -0.1 ? 1 : 0);
        const std::vector<std::uint32_t>& led = body.motions[0].particles;
        EXPECT_EQ(std::count(led.begin(), led.end(), i), x <= -0.1 ? 1 : 0);
        head += x >= 0.05 ? 1u : 0u;
    }
    EXPECT_GT(head, 5u);
}

TEST(ModelSettings, RefuseRegionsThatAreNone) {
    const std::string fish = "[model]\ngenerator = \"fish\"\nparticles_count = 20\n[[model.regions]]\n";
    EXPECT_NE(settings_refusal(fish + "low = [0, 0, 0]\n").find("model.regions.0.high"), std::string::npos);
    EXPECT_NE(
        settings_refusal(fish + "low = [-1, -1, -1]\nhigh = [1, 1, 1]\nmotion_times = [0.0, 0.0]\nmotion_offsets = "
                                "[0, 0, 0, 1, 1, 1]\n")
            .find("increase"),
        std::string::npos);
    EXPECT_NE(
        settings_refusal(fish + "low = [-1, -1, -1]\nhigh = [1, 1, 1]\nmotion_times = [0.0]\n").find("three numbers"),
        std::string::npos);
}

TEST(ModelSettings, TakeACompliancesStiffnessToBeWhole) {
    const ModelSettings settings = read_settings(
        "[model]\ngenerator = \"cloth\"\nvertices_per_side = 4\ngroup_compliance = 1e-4\nlink_compliance = 2e-3\n");
    const DeformableBody body = make_body(settings);
    EXPECT_EQ(body.particles.groups[3].stiffness, 1.0);
    EXPECT_EQ(body.particles.groups[3].compliance, 1e-4);
    EXPECT_EQ(body.particles.links[3].compliance, 2e-3);
}

class MeshOfAUser : public testing::Test {
  protected:
    MeshOfAUser()
        : file_(std::filesystem::path(testing::TempDir()) /
                ("model-settings-test-" + std::to_string(getpid()) + ".obj")) {
        std::ofstream out(file_);
        // A four-sided pyramid, 2 wide and 4 high, about (10, 10, 10).
        out << "v 9 8 9\nv 11 8 9\nv 11 8 11\nv 9 8 11\nv 10 12 10\n"
               "f 1 2 3\nf 1 3 4\nf 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n";
    }
    ~MeshOfAUser() override { std::filesystem::remove(file_); }

    std::filesystem::path file_;
};

TEST(ModelSettings, RefuseAMaterialWithWhatWouldBeRight) {
    EXPECT_THAT(settings_refusal("[model]\nmaterial = \"coton\"\n"),
                testing::AllOf(testing::HasSubstr("scene.toml:2: model.material: must be one of "),
                               testing::EndsWith("is \"coton\"; did you mean \"cotton\"?")));
    EXPECT_THAT(settings_refusal("[model.material]\nname = \"silc\"\n"),
                testing::AllOf(testing::HasSubstr("scene.toml:2: model.material.name: "),
                               testing::EndsWith("did you mean \"silk\"?")));
    EXPECT_THAT(
        settings_refusal("[model.material]\npoisson_ratio = 0.5\n"),
        testing::AllOf(testing::HasSubstr("scene.toml:2: model.material.poisson_ratio: must be within [0, 0.48], "
                                          "is 0.5; at 0.5 a material is incompressible"),
                       testing::HasSubstr("give rubber, gel and tissue 0.45")));
}

TEST(ModelSettings, TheMaterialNoneIsAsIfThereWereNone) {
    const std::string cloth = "[model]\ngenerator = \"cloth\"\nvertices_per_side = 4\nmass = 0.2\n";
    const DeformableBody without = make_body(read_settings(cloth));
    const DeformableBody none = make_body(read_settings(cloth + "material = \"none\"\n"));
    EXPECT_EQ(none.particles.mass, without.particles.mass);
    EXPECT_EQ(none.particles.links.size(), without.particles.links.size());
    EXPECT_EQ(none.particles.groups.size(), without.particles.groups.size());
    EXPECT_GT(none.particles.links.size(), 0u);
    EXPECT_EQ(read_settings("[model]\nmaterial = \"none\"\n").builder.neighbours,
              read_settings("[model]\n").builder.neighbours);
}

TEST(ModelSettings, AMaterialNeedsEnoughToBeMadeOf) {
    const std::string block = "[model]\ngenerator = \"block\"\n";
    const std::string gel = "material = \"gelatin 10 %\"\n";
    for (const char* const few : {"neighbours = 5\n", "particles_count = 6\n"}) {
        const std::string key = std::string(few).substr(0, std::string(few).find(' '));
        try {
            (void)read_settings(block + gel + few);
            ADD_FAILURE() << few << " was accepted";
        } catch (const ConfigError& error) {
            EXPECT_THAT(error.what(),
                        testing::AllOf(testing::HasSubstr(":4: model." + key), testing::HasSubstr("with a material")));
        }
        EXPECT_NO_THROW((void)read_settings(block + few)) << "without one";
    }
    EXPECT_EQ(make_body(read_settings(block + gel + "neighbours = 6\nparticles_count = 7\n")).particles.size(), 7U);
}

TEST_F(MeshOfAUser, FitsIntoTheScenesThatAreBuiltIn) {
    for (const BuiltInScene& built_in : built_in_scenes()) {
        const std::string name(built_in.name);
        Config config = open_scene(name);
        config.set("model.file=\"" + file_.string() + "\"");
        config.set("model.particles_count=12");
        if (name == "cloth-drop" || name == "curtain-hand") {
            config.set("model.material=none");  // theirs is that of a sheet
        }
        Simulation simulation(read_scene(config, name));
        EXPECT_EQ(simulation.bodies().front().mesh.vertices.size(), 5u) << name;
        EXPECT_EQ(simulation.bodies().front().mesh.triangles.size(), 6u) << name;
        for (int step = 0; step < 3; ++step) {
            (void)simulation.step(simulation.scripted_input(step * 10'000'000));
        }
    }
}

TEST_F(MeshOfAUser, IsRefusedWithTheMaterialOfASheet) {
    for (const char* name : {"cloth-drop", "curtain-hand"}) {
        Config config = open_scene(name);
        config.set("model.file=\"" + file_.string() + "\"");
        config.set("model.particles_count=12");
        try {
            (void)make_body(read_scene(config, name).model);
            ADD_FAILURE() << name << " accepted";
        } catch (const ConfigError& error) {
            EXPECT_THAT(error.what(),
                        testing::ContainsRegex("^" + std::string(name) +
                                               ".toml \\(built in\\):[0-9]+: model.material.*: .* body is "
                                               "a solid"));
        }
    }
}

TEST_F(MeshOfAUser, HasParticlesWithinIfItIsASolidWithAMaterial) {
    const std::string user = "[model]\nfile = \"" + file_.string() + "\"\nparticles_count = 0\n";
    EXPECT_EQ(make_body(read_settings(user)).particles.size(), 5U);
    EXPECT_THAT(settings_refusal(user + "material = \"liver\"\n"),
                testing::HasSubstr("scene.toml:3: model.particles_count: puts a particle at each of the 5 vertices and "
                                   "none inside"));
    EXPECT_THAT(settings_refusal("[model]\ngenerator = \"block\"\nparticles_count = 0\nmaterial = \"liver\"\n"),
                testing::HasSubstr("scene.toml:3: model.particles_count: puts a particle at each"));
}

TEST_F(MeshOfAUser, ThatCannotBecomeABodyIsRefusedWithItsLine) {
    const std::string user = "[model]\nparticles_count = 12\nfile = \"" + file_.string() + "\"\n";
    std::ofstream(file_) << "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n";
    EXPECT_THAT(settings_refusal(user), testing::HasSubstr("scene.toml:3: model.file: " + file_.string() + ": "));
    // Two triangles 10 m apart.
    std::ofstream(file_) << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 9 9 9\nv 9 9 8\nv 9 8 8\nf 1 2 3\nf 4 5 6\n";
    EXPECT_THAT(settings_refusal(user), testing::AllOf(testing::HasSubstr("scene.toml:3: model.file: model builder: "),
                                                       testing::HasSubstr("set bridge")));
    // An open mesh, of more particles than vertices.
    std::ofstream(file_) << "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    EXPECT_THAT(settings_refusal(user + "material = \"cotton\"\n"),
                testing::AllOf(testing::HasSubstr("scene.toml:2: model.particles_count: makes 12 particles"),
                               testing::HasSubstr("at each of its 3 vertices")));
}

TEST_F(MeshOfAUser, IsAsLargeAsWhatItReplacesOrAsItsScaleSays) {
    const auto height = [&](const std::string& keys) {
        const DeformableBody body =
            make_body(read_settings("[model]\nfile = \"" + file_.string() + "\"\nparticles_count = 10\n" + keys));
        EXPECT_EQ(body.particles.size(), 10u);
        double low = 1e9;
        double high = -1e9;
        for (const Vec3& p : body.mesh.vertices) {
            low = std::min(low, p.y);
            high = std::max(high, p.y);
        }
        return std::pair{low, high};
    };
    const auto near = [](std::pair<double, double> a, std::pair<double, double> b) {
        return std::abs(a.first - b.first) < 1e-6 && std::abs(a.second - b.second) < 1e-6;
    };
    EXPECT_TRUE(near(height("generator = \"fish\"\n"), {-0.15, 0.15}));
    EXPECT_TRUE(near(height("generator = \"cloth\"\nside = 3.0\n"), {-1.5, 1.5}));
    EXPECT_TRUE(near(height(""), {8.0, 12.0}));
    EXPECT_TRUE(near(height("scale = 0.01\n"), {0.08, 0.12}));
}

TEST_F(MeshOfAUser, HasNoEdgeLongerThanAllowed) {
    const DeformableBody body =
        make_body(read_settings("[model]\nfile = \"" + file_.string() + "\"\nparticles_count = 10\nmax_edge = 0.3\n"));
    const std::vector<Vec3>& p = body.mesh.vertices;
    double longest = 0.0;
    double volume = 0.0;
    for (const auto& [a, b, c] : body.mesh.triangles) {
        longest = std::max({longest, glm::length(p[b] - p[a]), glm::length(p[c] - p[b]), glm::length(p[a] - p[c])});
        volume += glm::dot(p[a], glm::cross(p[b], p[c])) / 6.0;
    }
    EXPECT_LE(longest, 0.3);
    EXPECT_GT(longest, 0.15);  // only longer ones are halved
    // Still the pyramid of 2 x 2 x 4 m, closed: a third of base times height, to the rounding of 1e3 m^3.
    EXPECT_TRUE(body.mesh.closed);
    EXPECT_NEAR(volume, 16.0 / 3.0, 1e-9);
}

TEST_F(MeshOfAUser, IsNamedIfItIsNotThere) {
    try {
        (void)read_settings("[model]\nfile = \"no-such-mesh.obj\"\n");
        FAIL() << "accepted";
    } catch (const ConfigError& error) {
        const std::string said = error.what();
        EXPECT_NE(said.find("model.file"), std::string::npos) << said;
        EXPECT_NE(said.find("no-such-mesh.obj"), std::string::npos) << said;
    }
}

}  // namespace
}  // namespace haptic::sim
