#include "generators/revolved.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <stdexcept>

#include "haptic/sim/mesh_check.hpp"

namespace haptic::sim {
namespace {

/// The check changes nothing: the mesh was closed and consistent.
MeshReport report_of(const TriangleMesh& mesh) {
    const MeshReport report = check_mesh(mesh.vertices, mesh.triangles, {}, "generated").report;
    EXPECT_TRUE(report.warnings.empty());
    EXPECT_TRUE(mesh.closed && report.closed && !report.turned);
    EXPECT_EQ(report.welded + report.collapsed + report.flipped + report.degenerate, 0u);
    EXPECT_EQ(report.components, 1u);
    return report;
}

// A regular 32-gon has sin(x) / x of the circle's area, x = 2 pi / 32; the profile has as many corners.
constexpr double kInscribed = 0.02;

TEST(Revolved, SolidsHaveTheVolumesOfTheirFormulas) {
    const double pi = std::numbers::pi;
    const double ball = 4.0 / 3.0 * pi * 0.05 * 0.05 * 0.05;
    const double sphere = report_of(make_sphere_mesh(0.05)).volume;
    EXPECT_LT(sphere, ball);
    EXPECT_GT(sphere, (1.0 - kInscribed) * ball);

    const double rod_formula = pi * 0.01 * 0.01 * 0.18 + 4.0 / 3.0 * pi * 1e-6;
    const double rod = report_of(make_rod_mesh(0.2, 0.02)).volume;
    EXPECT_LT(rod, rod_formula);
    EXPECT_GT(rod, (1.0 - kInscribed) * rod_formula);

    // The ball, and the shaft from its root; the ball's cap inside the shaft is flat.
    const double root = std::sqrt(0.03 * 0.03 - 0.01 * 0.01);
    const double cap_height = 0.03 - root;
    const double cap = pi * cap_height * cap_height * (3.0 * 0.03 - cap_height) / 3.0;
    const double probe_formula = 4.0 / 3.0 * pi * 0.03 * 0.03 * 0.03 - cap +
                                 pi * 0.01 * 0.01 * (0.2 - 0.03 - root - 0.01) + 2.0 / 3.0 * pi * 1e-6;
    const double probe = report_of(make_probe_mesh(0.2, 0.02, 0.03)).volume;
    EXPECT_NEAR(probe, probe_formula, kInscribed * probe_formula);
}

TEST(Revolved, SolidsReachFromEndToEnd) {
    for (const TriangleMesh& mesh : {make_rod_mesh(0.2, 0.02), make_probe_mesh(0.2, 0.02, 0.03)}) {
        const auto [low, high] = std::minmax_element(mesh.vertices.begin(), mesh.vertices.end(),
                                                     [](const Vec3& a, const Vec3& b) { return a.z < b.z; });
        EXPECT_EQ(low->z, -0.1);
        EXPECT_EQ(high->z, 0.1);
    }
    for (const Vec3& p : make_sphere_mesh(0.05).vertices) {
        EXPECT_NEAR(glm::length(p), 0.05, 1e-15);
    }
}

TEST(Revolved, RefusesInvalidDimensions) {
    EXPECT_THROW((void)make_sphere_mesh(0.0), std::invalid_argument);
    EXPECT_THROW((void)make_rod_mesh(0.02, 0.02), std::invalid_argument);
    EXPECT_THROW((void)make_rod_mesh(0.02, -1.0), std::invalid_argument);
    EXPECT_THROW((void)make_rod_mesh(4.1, 0.02), std::invalid_argument);
    EXPECT_THROW((void)make_probe_mesh(0.2, 0.02, 0.01), std::invalid_argument);
    EXPECT_THROW((void)make_probe_mesh(4.1, 0.02, 0.02), std::invalid_argument);
    EXPECT_THROW((void)make_probe_mesh(0.06, 0.02, 0.03), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
