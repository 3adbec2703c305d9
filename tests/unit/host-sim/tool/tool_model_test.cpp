#include "haptic/sim/tool_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "generators/revolved.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "haptic/sim/scene.hpp"

namespace haptic::sim {
namespace {

using testing::HasSubstr;

ToolModel tool_of(const char* toml) {
    return make_tool(read_tool(Config::parse(toml, "tool.toml")));
}

void expect_whole(const ToolModel& tool) {
    const ParticleModel& model = tool.body.particles;
    ASSERT_EQ(tool.radius.size(), model.size());
    EXPECT_NO_THROW(model.check());
    EXPECT_EQ(model.groups.size(), model.size());
    EXPECT_EQ(tool.body.skin.size(), tool.body.mesh.vertices.size());
    for (const double radius : tool.radius) {
        EXPECT_GT(radius, 0.0);
    }
}

TEST(ToolModel, OfAnEmptyTableIsTheSceneProxy) {
    const ToolModel tool = tool_of("tool = {}\nproxy = {radius = 0.04}");
    expect_whole(tool);
    ASSERT_EQ(tool.radius.size(), 1u);
    EXPECT_EQ(tool.radius[0], 0.04);
    EXPECT_EQ(tool.body.particles.rest_position[0], Vec3(0.0));
    EXPECT_EQ(tool.widest_gap, 0.0);
}

TEST(ToolModel, OfARodHasEvenlySpacedSpheres) {
    const ToolModel tool = tool_of("[tool]\ngenerator = \"rod\"\nlength = 0.22\nthickness = 0.02\nspheres = 5");
    expect_whole(tool);
    ASSERT_EQ(tool.radius.size(), 5u);
    for (std::size_t k = 0; k < 5; ++k) {
        EXPECT_NEAR(glm::length(tool.body.particles.rest_position[k] - Vec3(0.0, 0.0, -0.1 + 0.05 * double(k))), 0.0,
                    1e-15);
        EXPECT_EQ(tool.radius[k], 0.01);
    }
    EXPECT_NEAR(tool.widest_gap, 0.03, 0.01 * 0.03);
    // On the surface, half way between two spheres: sqrt(0.025^2 + 0.01^2) - 0.01.
    EXPECT_NEAR(tool.cover_error, std::hypot(0.025, 0.01) - 0.01, 0.01 * 0.017);
    // The volumes add up to that of the rod, a cylinder with round ends of its radius.
    const double volume = std::accumulate(tool.volume.begin(), tool.volume.end(), 0.0);
    const double exact = std::numbers::pi * 1e-4 * (0.2 + 4.0 / 3.0 * 0.01);
    EXPECT_NEAR(volume / exact, 1.0, 0.05);
}

TEST(ToolModel, ClosesTheGapsOfARodOrReportsThatItCannot) {
    const ToolModel tool =
        tool_of("[tool]\ngenerator = \"rod\"\nlength = 0.22\nthickness = 0.02\nspheres = 5\nclose_gaps = true");
    expect_whole(tool);
    EXPECT_EQ(tool.added, 8u);  // three spacings of 0.0167 in 0.05; 0.9 times two radii is 0.018
    EXPECT_EQ(tool.radius.size(), 13u);
    EXPECT_EQ(tool.widest_gap, 0.0);
    try {
        (void)tool_of("[tool]\ngenerator = \"rod\"\nlength = 2.0\nthickness = 0.02\nspheres = 5\nclose_gaps = true");
        FAIL() << "accepted";
    } catch (const std::invalid_argument& error) {
        EXPECT_THAT(error.what(), HasSubstr("between its 5 spheres needs 113; the maximum is 64"));
    }
}

TEST(ToolModel, UsesAsFewSpheresAsTheErrorAllows) {
    const auto with = [](double error) {
        ToolSettings settings;
        settings.shape = ToolShape::Probe;
        settings.cover_error = error;
        return make_tool(settings);
    };
    const ToolModel coarse = with(0.005);
    const ToolModel fine = with(0.001);
    EXPECT_LE(coarse.cover_error, 0.005);
    EXPECT_LE(fine.cover_error, 0.001);
    EXPECT_LT(coarse.radius.size(), fine.radius.size());
    ToolSettings fewer;
    fewer.shape = ToolShape::Probe;
    fewer.spheres = coarse.radius.size() - 1;
    EXPECT_GT(make_tool(fewer).cover_error, 0.005);
    EXPECT_EQ(fine.radius[0], 0.02);  // the ball
    EXPECT_THROW((void)with(1e-6), std::invalid_argument);
}

TEST(ToolModel, IsTransformedToTheGripFrame) {
    // A rotation of 90 degrees about x takes -z to y.
    const ToolModel tool = tool_of(
        "[tool]\ngenerator = \"probe\"\nposition = [0.1, 0.0, 0.0]\n"
        "orientation = [0.7071067811865476, 0.7071067811865475, 0.0, 0.0]");
    expect_whole(tool);
    const Vec3 ball = tool.body.particles.rest_position[0];
    EXPECT_NEAR(glm::length(ball - Vec3(0.1, 0.5 * 0.19 - 0.02, 0.0)), 0.0, 1e-12);
    EXPECT_EQ(tool.body.particles.position, tool.body.particles.rest_position);
}

const ToolModel& hand_model() {
    static const ToolModel tool = tool_of("[tool]\ngenerator = \"hand\"");
    return tool;
}

/// Connected components of the particles under their groups.
std::size_t parts_of(const ParticleModel& model) {
    std::vector<std::size_t> part(model.size());
    std::iota(part.begin(), part.end(), std::size_t{0});
    for (std::size_t round = 0; round < model.size(); ++round) {
        for (const Group& group : model.groups) {
            std::size_t lowest = part[group.centre];
            for (const std::uint32_t member : group.members) {
                lowest = std::min(lowest, part[member]);
            }
            for (const std::uint32_t member : group.members) {
                part[member] = lowest;
            }
        }
    }
    std::sort(part.begin(), part.end());
    return static_cast<std::size_t>(std::unique(part.begin(), part.end()) - part.begin());
}

TEST(ToolModel, OfTheHandHasTheCountsOfTheThesisAndCoversTheHandWithinAFortiethOfItsLength) {
    expect_whole(hand_model());
    EXPECT_EQ(hand_model().body.mesh.triangles.size(), 3906u);
    EXPECT_EQ(hand_model().radius.size(), 37u);
    EXPECT_EQ(parts_of(hand_model().body.particles), 1u);
    EXPECT_LT(hand_model().cover_error, 0.19 / 40.0);
    // No vertex is farther from the spheres than the stated error, nor deeper inside one.
    double farthest = 0.0;
    for (const Vec3& p : hand_model().body.mesh.vertices) {
        double nearest = 1.0;
        for (std::size_t i = 0; i < hand_model().radius.size(); ++i) {
            nearest = std::min(nearest,
                               glm::length(p - hand_model().body.particles.rest_position[i]) - hand_model().radius[i]);
        }
        EXPECT_GE(nearest, -1.02 * hand_model().cover_error);
        farthest = std::max(farthest, nearest);
    }
    EXPECT_LE(farthest, hand_model().cover_error);
    EXPECT_GT(farthest, 0.5 * hand_model().cover_error);
}

TEST(ToolModel, OfTheHandHasNoGapsWithinTheMaximumNumberOfSpheres) {
    const ToolModel closed = tool_of("[tool]\ngenerator = \"hand\"\nclose_gaps = true");
    expect_whole(closed);
    EXPECT_GT(hand_model().widest_gap, 0.0);
    EXPECT_EQ(closed.widest_gap, 0.0);
    EXPECT_LE(closed.radius.size(), 64u);
    EXPECT_LE(closed.cover_error, 1.02 * hand_model().cover_error);
    for (std::size_t i = 0; i < hand_model().radius.size(); ++i) {
        EXPECT_EQ(closed.body.particles.rest_position[i], hand_model().body.particles.rest_position[i]);
    }
}

TEST(ToolModel, OfAMeshFileHasTheRequestedLength) {
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("tool_model_test_" + std::to_string(getpid()) + ".obj");
    write_mesh(file, make_rod_mesh(7.0, 2.0));
    ToolSettings settings;
    settings.file = file.string();
    settings.length = 0.14;
    settings.spheres = 6;
    const ToolModel tool = make_tool(settings);
    std::filesystem::remove(file);
    expect_whole(tool);
    EXPECT_EQ(tool.radius.size(), 6u);
    for (const double radius : tool.radius) {
        EXPECT_NEAR(radius, 0.02, 0.0024);  // the rod's radius, grown by half of the miss
    }
    // Six evenly spaced spheres miss sqrt(0.02^2 + 0.01^2) - 0.02 between two; half of it once they grow.
    EXPECT_LT(tool.cover_error, 0.0024);
}

TEST(ToolModel, RejectsInvalidSettingsWithAReason) {
    EXPECT_THROW((void)tool_of("[tool]\ngenerator = \"spoon\""), ConfigError);
    EXPECT_THROW((void)tool_of("[tool]\nspheres = 65"), ConfigError);
    EXPECT_THROW((void)tool_of("[tool]\nspheres = 2"), std::invalid_argument);
    EXPECT_THROW((void)tool_of("[tool]\ngenerator = \"rod\"\nlength = 0.01"), std::invalid_argument);
    EXPECT_THROW((void)tool_of("[tool]\nfile = \"/nowhere/tool.obj\""), std::runtime_error);
}

TEST(ToolModel, OfASceneExistsIfItHasTheTable) {
    Config without = open_scene("cloth-drop");
    EXPECT_FALSE(read_scene(without, "scene").tool.has_value());
    Config with = open_scene("cloth-drop");
    with.set("tool.generator=rod");
    const Scene scene = read_scene(with, "scene");
    ASSERT_TRUE(scene.tool.has_value());
    EXPECT_EQ(scene.tool->shape, ToolShape::Rod);
    Config wrong = open_scene("cloth-drop");
    wrong.set("tool.colour=red");
    EXPECT_THROW((void)read_scene(wrong, "scene"), ConfigError);
}

}  // namespace
}  // namespace haptic::sim
