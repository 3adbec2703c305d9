// Notices on keys of a body that have no effect on it.
#include "model/idle_keys.hpp"

#include <gtest/gtest.h>

#include <string>

#include "haptic/sim/scene.hpp"
#include "temporary_file.hpp"

namespace haptic::sim {
namespace {

std::string idle_keys(const std::string& model) {
    const Config config = Config::parse("[model]\n" + model, "scene.toml");
    return idle_key_notice(config, "model", read_model(config, "model"));
}

TEST(IdleKeys, AreThoseOfOtherGenerators) {
    EXPECT_EQ(idle_keys("generator = \"cloth\"\ncells = 4\nvertices_per_side = 5\n"),
              "scene.toml:3: model.cells: has no effect with generator = \"cloth\"; remove it");
    EXPECT_EQ(idle_keys("generator = \"block\"\ncells = 4\nvertices_per_side = 5\nparticles_count = 9\n"),
              "scene.toml:4: model.vertices_per_side: has no effect with generator = \"block\"; remove it");
    EXPECT_EQ(idle_keys("scale = 2.0\nmax_edge = 0.1\nparticles_count = 9\n"),
              "scene.toml:3: model.max_edge: has no effect with generator = \"cloth\", nor have these keys: "
              "particles_count, scale; remove them");
}

TEST(IdleKeys, OfAMeshFileAreThoseOfShapesUnlessItIsAsLongAsAGeneratedOne) {
    const test::TemporaryDirectory folder;
    const std::string mesh = folder.write("mesh.obj", "is not read").string();
    const std::string file = "file = \"" + mesh + "\"\nparticles_count = 9\nmax_edge = 0.1\nlength = 0.5\n";
    EXPECT_EQ(idle_keys(file), "scene.toml:5: model.length: has no effect with a mesh file; remove it");
    EXPECT_EQ(idle_keys(file + "generator = \"fish\"\n"), "");
}

TEST(IdleKeys, OfAParticleFileAreThoseThatMakeParticles) {
    const test::TemporaryDirectory folder;
    const std::string file = folder.write("particles.toml", "is not read").string();
    const std::string fish = "generator = \"fish\"\nlength = 0.5\nbridge = 0.1\nneighbours = 9\n";
    EXPECT_EQ(idle_keys(fish + "particles = \"" + file + "\"\n"),
              "scene.toml:5: model.neighbours: has no effect with generator = \"fish\" and a particle file; remove it");
}

TEST(IdleKeys, AreNotInTheBuiltInScenes) {
    for (const BuiltInScene& scene : built_in_scenes()) {
        const Config config = open_scene(std::string(scene.name));
        const Scene read = read_scene(config, std::string(scene.name));
        EXPECT_EQ(idle_key_notice(config, "model", read.model), "") << scene.name;
        for (std::size_t k = 0; k < read.objects.size(); ++k) {
            EXPECT_EQ(idle_key_notice(config, "objects." + std::to_string(k), read.objects[k]), "") << scene.name;
        }
    }
}

}  // namespace
}  // namespace haptic::sim
