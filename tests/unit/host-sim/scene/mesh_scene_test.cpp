// Scenes made for meshes: whatever the mesh is like, the hand presses it, with a force that is felt.
#include "scene/mesh_scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "haptic/sim/fish.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "temporary_file.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

struct Soup {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;

    void add_quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
        triangles.push_back({a, b, c});
        triangles.push_back({a, c, d});
    }
    void add_box(const Vec3& low, const Vec3& size) {
        const auto first = static_cast<std::uint32_t>(vertices.size());
        for (std::uint32_t k = 0; k < 8; ++k) {
            vertices.push_back(low + size * Vec3(k & 1u, (k >> 1u) & 1u, (k >> 2u) & 1u));
        }
        constexpr std::uint32_t faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                               {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
        for (const auto& [a, b, c, d] : faces) {
            add_quad(first + a, first + b, first + c, first + d);
        }
    }
    /// A grid of n x m points, closed in either direction if it wraps; every `hole`-th cell is missing.
    void add_grid(std::uint32_t n, std::uint32_t m, bool wraps, const std::function<Vec3(double, double)>& at,
                  std::uint32_t hole = 0) {
        for (std::uint32_t i = 0; i < n; ++i) {
            for (std::uint32_t j = 0; j < m; ++j) {
                vertices.push_back(at(static_cast<double>(i) / n, static_cast<double>(j) / m));
            }
        }
        for (std::uint32_t i = 0; i < (wraps ? n : n - 1); ++i) {
            for (std::uint32_t j = 0; j < (wraps ? m : m - 1); ++j) {
                if (hole == 0 || (7 * i + j) % hole != 0) {
                    add_quad(i * m + j, i * m + (j + 1) % m, (i + 1) % n * m + (j + 1) % m, (i + 1) % n * m + j);
                }
            }
        }
    }
};

Soup box(const Vec3& low, const Vec3& size) {
    Soup soup;
    soup.add_box(low, size);
    return soup;
}

Soup torus(std::uint32_t n, std::uint32_t m, double radius, double tube, std::uint32_t hole = 0) {
    Soup soup;
    soup.add_grid(
        n, m, true,
        [=](double u, double v) {
            const double a = 2.0 * std::numbers::pi * u;
            const double b = 2.0 * std::numbers::pi * v;
            const double far = radius + tube * std::cos(b);
            return Vec3(far * std::cos(a), tube * std::sin(b), far * std::sin(a));
        },
        hole);
    return soup;
}

/// A sheet that stands in the x-y plane.
Soup sheet(std::uint32_t vertices_per_side = 12) {
    Soup soup;
    soup.add_grid(vertices_per_side, vertices_per_side, false, [](double u, double v) { return Vec3(u, v, 0.0); });
    return soup;
}

Soup fish() {
    const TriangleMesh mesh = make_fish_mesh({});
    return {mesh.vertices, mesh.triangles};
}

Soup two_cubes_apart() {
    Soup soup = box(Vec3(0.0), Vec3(1.0));
    soup.add_box({2.5, 0.0, 0.0}, Vec3(1.0));
    return soup;
}

struct Case {
    const char* name;
    Soup soup;
    bool folds = false;  // away from the hand, and then lies still
};

void PrintTo(const Case& given, std::ostream* out) {
    *out << given.name;
}

std::vector<Case> cases() {
    return {{"CubeInMillimetres", box(Vec3(0.0), Vec3(100.0))},
            {"TinyInMetres", box(Vec3(0.0), {2e-4, 1e-4, 1.5e-4})},
            {"RodThatStands", box(Vec3(0.0), {10.0, 1000.0, 10.0})},
            {"NeedleThatLies", box(Vec3(0.0), {2.0, 2.0, 1000.0})},
            {"FarFromItsOrigin", box({5e4, -3e4, 2e4}, {100.0, 60.0, 80.0})},
            {"Sheet", sheet()},
            {"SheetOfManyVertices", sheet(70)},
            {"OneTriangle", {{{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 1.0}}, {{0, 1, 2}}}},
            {"HoopWithAWideHole", torus(40, 10, 5.0, 0.4)},
            {"HoopWithMissingCells", torus(40, 12, 5.0, 2.0, 9), true},
            {"TwoParts", two_cubes_apart()},
            {"Fish", fish()}};
}

MeshScene scene_for(const Soup& soup, const std::string& file = "body.ply") {
    return make_mesh_scene(check_mesh(soup.vertices, soup.triangles, {}, file), file, nullptr);
}

class MeshSceneTest : public ::testing::TestWithParam<Case> {};

TEST_P(MeshSceneTest, IsTouchedAndFeltAndNothingEscapes) {
    const MeshScene made = scene_for(GetParam().soup);
    Simulation simulation(made.scene);
    simulation.set_verification(true);
    double peak = 0.0;         // N at the hand
    double first_contact = 0;  // s
    double held = 0.0;         // N, at the end of the pressing
    std::size_t crossings = 0;
    const double lifted = made.scene.duration_s - 0.5;  // s
    while (simulation.time() < made.scene.duration_s) {
        const StepInput input = simulation.scripted_input(nanoseconds(simulation.time()));
        // An X3R makes every wrench within 20 mm; it only waits farther up, or presses a body that has fallen flat.
        ASSERT_LE(glm::length(input.device.position), 0.0275) << made.text;
        const StepResult result = simulation.step(input);
        const double force = glm::length(result.hand_force);
        first_contact = first_contact == 0.0 && result.in_contact ? result.time : first_contact;
        held = result.time < lifted ? force : held;
        peak = std::max(peak, force);
        crossings += result.crossings;
    }
    EXPECT_EQ(crossings, 0U);
    // It comes down 4 cm to the body and 1 or 2 cm into it, in the second that ends a second before it is lifted.
    const PoseTrack& hand = made.scene.hand;
    const double way = hand.at(nanoseconds(lifted - 2.0)).position.y - hand.at(nanoseconds(lifted - 1.0)).position.y;
    EXPECT_NEAR(first_contact, lifted - 2.0 + 0.04 / way, 0.1) << made.text;
    EXPECT_GE(peak, 0.3) << made.text;
    EXPECT_LE(peak, 3.0) << made.text;
    if (!GetParam().folds) {
        EXPECT_GE(held, 0.3 * peak) << "it slips off: " << made.text;
    }
}

TEST_P(MeshSceneTest, ReadsBackFromItsFileAsTheSameScene) {
    const Soup& soup = GetParam().soup;
    const test::TemporaryDirectory folder;
    write_mesh(folder.file("body.ply"), {soup.vertices, soup.triangles});
    const MeshScene made = make_mesh_scene(read_mesh(folder.file("body.ply")), "body.ply", nullptr);
    Simulation from_file(read_scene(Config::load(folder.write("body.toml", made.text)), "body"));
    Simulation from_memory(made.scene);
    for (int k = 0; k < 30; ++k) {
        for (Simulation* const simulation : {&from_file, &from_memory}) {
            (void)simulation->step(simulation->scripted_input(nanoseconds(simulation->time())));
        }
    }
    EXPECT_EQ(from_file.state_hash(), from_memory.state_hash());
    EXPECT_THAT(from_file.scene().notices, IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Meshes, MeshSceneTest, ::testing::ValuesIn(cases()),
                         [](const auto& given) { return given.param.name; });

TEST(MeshScene, SaysWhatItFoundAndChose) {
    const MeshScene cube = scene_for(box(Vec3(0.0), Vec3(100.0)));
    EXPECT_THAT(cube.explanation, HasSubstr("100 x 100 x 100 units"));
    EXPECT_THAT(cube.explanation, HasSubstr("1 unit is 0.002 m"));
    EXPECT_THAT(cube.explanation, HasSubstr("watertight"));
    // 1030 kg/m^3 times (0.2 m)^3.
    EXPECT_THAT(cube.explanation, HasSubstr("gelatin 10 %, a solid of 30 kPa; 8.24 kg"));
    const MeshScene open = scene_for(sheet());
    EXPECT_THAT(open.explanation, HasSubstr("not watertight"));
    EXPECT_THAT(open.explanation, HasSubstr("z up"));
    EXPECT_THAT(open.explanation, HasSubstr("latex, a sheet of 260 N/m"));
}

TEST(MeshScene, GivesTheBodyTheMaterialOfItsKind) {
    EXPECT_THAT(scene_for(box(Vec3(0.0), Vec3(100.0))).text,
                AllOf(HasSubstr("[model.material]"), HasSubstr("name = \"gelatin 10 %\""), Not(HasSubstr("density"))));
    EXPECT_THAT(scene_for(sheet()).text, AllOf(HasSubstr("[model.material]"), HasSubstr("name = \"latex\""),
                                               HasSubstr("particles_count = 0 "), Not(HasSubstr("density"))));
    // 1030 kg/m^3 times 0.2 m times (2 mm)^2 would be 0.8 g.
    EXPECT_THAT(scene_for(box(Vec3(0.0), {10.0, 1000.0, 10.0})).text, HasSubstr("\ndensity = 1250.0 "));
    // A sheet has a particle at each vertex, which would be too many.
    EXPECT_THAT(scene_for(sheet(70)).text, AllOf(HasSubstr("material = \"none\""), Not(HasSubstr("[model.material]"))));
}

TEST(MeshScene, GivesTheSameTextForTheSameMesh) {
    EXPECT_EQ(scene_for(fish()).text, scene_for(fish()).text);
}

TEST(MeshScene, RefusesAMeshTooFarFromItsOrigin) {
    EXPECT_THROW((void)scene_for(box({9e5, 0.0, 0.0}, Vec3(1.0))), MeshError);
}

}  // namespace
}  // namespace haptic::sim
