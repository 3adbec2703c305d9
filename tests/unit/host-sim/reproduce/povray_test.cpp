#include "reproduce/povray.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(PictureScene, NamesEveryVertexAndFace) {
    const TriangleMesh mesh = make_cloth_mesh({.vertices_per_side = 3});
    const std::filesystem::path file =
        std::filesystem::path(::testing::TempDir()) / ("haptic-picture-test-" + std::to_string(getpid()) + ".pov");
    PictureScene scene;
    scene.title = "three by three";
    scene.objects.push_back({.vertices = mesh.vertices, .triangles = mesh.triangles});
    scene.proxy = {0.25, 0.0, 0.0};
    write_picture_scene(file, scene);
    std::ostringstream content;
    content << std::ifstream(file).rdbuf();
    EXPECT_THAT(content.str(), HasSubstr("// three by three\n"));
    EXPECT_THAT(content.str(), HasSubstr("vertex_vectors {\n        9,"));
    EXPECT_THAT(content.str(), HasSubstr("face_indices {\n        16,"));
    EXPECT_THAT(content.str(), HasSubstr("sphere { <0.25, 0, 0>, 0.03 texture { ProxyBall } }"));
    EXPECT_THAT(content.str(), HasSubstr("<-0.5, 0, -0.5>"));
    std::filesystem::remove(file);
}

TEST(PictureScene, ShowsAToolsSpheresInsteadOfTheProxy) {
    const std::filesystem::path file =
        std::filesystem::path(::testing::TempDir()) / ("haptic-tool-picture-test-" + std::to_string(getpid()) + ".pov");
    PictureScene scene;
    scene.proxy_radius = 0.0;
    scene.spheres = {{{1.0, 2.0, 3.0}, 0.5, false}, {{2.0, 2.0, 3.0}, 0.25, true}};
    const auto written = [&] {
        write_picture_scene(file, scene);
        std::ostringstream content;
        content << std::ifstream(file).rdbuf();
        return content.str();
    };
    const std::string text = written();
    EXPECT_THAT(text, HasSubstr("sphere { <1, 2, 3>, 0.5 texture { ProxyBall } }"));
    EXPECT_THAT(text, HasSubstr("sphere { <2, 2, 3>, 0.25 texture { TouchingBall } }"));
    EXPECT_THAT(text, Not(HasSubstr("texture { Hip }")));
    EXPECT_THAT(text, HasSubstr("look_at <1.375, 2, 3>"));  // the middle of 0.5 .. 2.25
    scene.view = Aabb{{-1.0, -1.0, -1.0}, {1.0, 3.0, 1.0}};
    EXPECT_THAT(written(), HasSubstr("look_at <0, 1, 0>"));
    std::filesystem::remove(file);
}

TEST(PictureScene, ShowsEachBodyOnceInAColourOfItsOwn) {
    Config config = open_scene("cloth-drop");
    config.set("model.vertices_per_side=3");
    Scene scene = read_scene(config, "two");
    scene.model.copies.push_back({.position = {2.0, 0.0, 0.0}});
    const Simulation simulation(scene);
    const std::vector<PictureObject> objects = objects_of(simulation, simulation.vertices());
    ASSERT_EQ(objects.size(), 2u);
    for (const PictureObject& object : objects) {
        EXPECT_EQ(object.vertices.size(), 9u);
        EXPECT_EQ(object.triangles.size(), 8u) << "the second face of a double-faced cloth is drawn, too";
        EXPECT_FALSE(object.closed);
    }
    EXPECT_NE(objects[0].colour, objects[1].colour);
    EXPECT_EQ(objects[1].vertices[0].x, objects[0].vertices[0].x + 2.0);
}

TEST(PictureScene, NamesTheFileThatItCannotWrite) {
    const TriangleMesh mesh = make_cloth_mesh({.vertices_per_side = 2});
    PictureScene scene;
    scene.objects.push_back({.vertices = mesh.vertices, .triangles = mesh.triangles});
    try {
        write_picture_scene("/nonexistent-folder/a.pov", scene);
        FAIL() << "written";
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("/nonexistent-folder/a.pov"));
    }
}

}  // namespace
}  // namespace haptic::sim
