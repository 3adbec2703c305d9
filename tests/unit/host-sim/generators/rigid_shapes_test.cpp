#include "haptic/sim/rigid_shapes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {
namespace {

/// By the divergence theorem; positive if the faces are oriented outward.
double volume(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const auto& [a, b, c] : mesh.triangles) {
        sum += glm::dot(mesh.vertices[a], glm::cross(mesh.vertices[b], mesh.vertices[c])) / 6.0;
    }
    return sum;
}

/// Whether each edge is traversed once in each direction.
bool is_closed(const TriangleMesh& mesh) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> ways;
    for (const auto& [a, b, c] : mesh.triangles) {
        ++ways[{a, b}];
        ++ways[{b, c}];
        ++ways[{c, a}];
    }
    return std::all_of(ways.begin(), ways.end(), [&](const auto& way) {
        const auto back = ways.find({way.first.second, way.first.first});
        return way.second == 1 && back != ways.end() && back->second == 1;
    });
}

TEST(Plate, IsAClosedBoxOfItsSize) {
    for (const std::uint32_t cells : {1u, 2u, 7u}) {
        const PlateShape shape{.size = {2.0, 0.25, 3.0}, .cells = cells};
        const TriangleMesh mesh = make_plate_mesh(shape);
        EXPECT_EQ(mesh.triangles.size(), plate_triangles(shape));
        EXPECT_TRUE(mesh.closed);
        EXPECT_TRUE(is_closed(mesh)) << cells;
        EXPECT_NEAR(volume(mesh), 1.5, 1e-14);  // 2 x 0.25 x 3, to rounding
        for (const Vec3& p : mesh.vertices) {
            EXPECT_LE(std::abs(p.x), 1.0);
            EXPECT_EQ(std::abs(p.y), 0.125);
            EXPECT_LE(std::abs(p.z), 1.5);
        }
    }
}

TEST(Rod, IsAClosedPrismOfItsSize) {
    const RodShape shape{.length = 2.0, .diameter = 0.5};
    const TriangleMesh mesh = make_rod_mesh(shape);
    EXPECT_EQ(mesh.triangles.size(), rod_triangles());
    EXPECT_TRUE(mesh.closed);
    EXPECT_TRUE(is_closed(mesh));
    const double twelve_gon = 6.0 * 0.25 * 0.25 * std::sin(std::numbers::pi / 6.0);  // m^2, n/2 r^2 sin(2 pi / n)
    EXPECT_NEAR(volume(mesh), 2.0 * twelve_gon, 1e-14);
    for (const Vec3& p : mesh.vertices) {
        EXPECT_EQ(std::abs(p.x), 1.0);
        EXPECT_NEAR(std::hypot(p.y, p.z), 0.25, 1e-15);
    }
}

TEST(RigidShapes, RefuseInvalidSizes) {
    EXPECT_THROW((void)make_plate_mesh({.cells = 0}), std::invalid_argument);
    EXPECT_THROW((void)make_plate_mesh({.cells = 257}), std::invalid_argument);
    EXPECT_THROW((void)make_plate_mesh({.size = {1.0, 0.0, 1.0}}), std::invalid_argument);
    EXPECT_THROW((void)make_rod_mesh({.length = -1.0}), std::invalid_argument);
    EXPECT_THROW((void)make_rod_mesh({.diameter = std::numeric_limits<double>::infinity()}), std::invalid_argument);
}

TEST(RigidShapes, KeepTheirShapeUnderForceAndFollowPrescribedMotion) {
    const char* const toml = R"([model]
generator = "plate"
size = [0.4, 0.02, 0.4]
cells = 4
[[model.regions]]
low = [-1, -1, -1]
high = [1, 1, 1]
motion_times = [0.0, 0.1, 0.2]
motion_offsets = [0, 0, 0,  0, 0.1, 0,  0, 0.1, 0]
[coupling]
stiffness = 1000.0
[hand]
positions = [0.0, 0.05, 0.0]
)";
    const Scene scene = read_scene(Config::parse(toml, "lift.toml"), "lift");
    Simulation simulation(scene);
    simulation.set_verification(true);
    const std::vector<Vec3> rest = simulation.vertices();
    StepResult result;
    for (int k = 0; k < 20; ++k) {
        result = simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{k}));
        EXPECT_FALSE(result.crossed) << k;
    }
    for (std::size_t i = 0; i < rest.size(); ++i) {
        EXPECT_NEAR(glm::length(simulation.vertices()[i] - rest[i] - Vec3(0.0, 0.1, 0.0)), 0.0, 1e-12);
    }
    // On the plate, raised by 0.1 m: upper face plus the proxy's radius.
    EXPECT_NEAR(result.proxy.y, 0.1 + 0.01 + 0.03, 1e-6);
    EXPECT_NEAR(result.force.y, 1000.0 * 0.09, 1e-2);  // N
}

}  // namespace
}  // namespace haptic::sim
