#include "contact/virtual_proxy.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::ProxyMove;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::ball;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::box;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::rotation;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::Step;
using haptic::sim::scenes::World;

ProxyMove move(World& world, const Vec3& from, const Vec3& goal) {
    return haptic::sim::move_proxy(world.surfaces, from, goal, kRadius, 0.01, {});
}

/// Whether some clear position near `p` is nearer to the goal by more than `gain`.
bool can_do_better(const World& world, const Vec3& p, const Vec3& goal, Random& random, double gain) {
    for (int k = 0; k < 200; ++k) {
        const Vec3 q = p + random.direction() * (kRadius * random.uniform(0.02, 0.1));
        if (glm::length(q - goal) < glm::length(p - goal) - gain && world.clearance(q) >= kRadius) {
            return true;
        }
    }
    return false;
}

TEST(VirtualProxy, GoesToAGoalThatIsFree) {
    World world;
    world.add(sheet(1.0, 4, true));
    world.refit();
    const ProxyMove m = move(world, {0, 0.1, 0}, {0.2, 0.05, 0.1});
    EXPECT_EQ(m.position, Vec3(0.2, 0.05, 0.1));
    EXPECT_EQ(m.contacts.count, 0u);
    EXPECT_TRUE(m.converged);
}

TEST(VirtualProxy, RestsOnAPlaneAboveTheGoal) {
    World world;
    world.add(sheet(1.0, 8, true));
    world.refit();
    const ProxyMove m = move(world, {0.013, 0.1, 0.02}, {0.21, -0.4, 0.11});
    EXPECT_NEAR(glm::length(m.position - Vec3(0.21, kRadius, 0.11)), 0.0, 1e-9);
    ASSERT_EQ(m.contacts.count, 1u);
    EXPECT_NEAR(glm::length(m.contacts.plane[0].normal - Vec3(0, 1, 0)), 0.0, 1e-9);
    EXPECT_NEAR(m.contacts.plane[0].offset, kRadius, 1e-9);
    const auto& touched = m.contacts.plane[0].touched;
    const auto& t = world.bodies[0]->mesh.triangles[touched.triangle];
    Vec3 point(0.0);
    for (int k = 0; k < 3; ++k) {
        point += world.bodies[0]->end[t[static_cast<std::size_t>(k)]] * touched.weights[k];
    }
    EXPECT_NEAR(glm::length(point - Vec3(0.21, 0, 0.11)), 0.0, 1e-9);
}

// Proxy shrink (thesis 4.1.4) is a tolerance. Contacts are found with the shrunk radius and the proxy is placed at the
// full radius, so that it looks and feels its full size whatever the shrink.

TEST(VirtualProxy, RestsAtItsWholeRadiusWhateverTheShrink) {
    World flat;
    flat.add(sheet(1.0, 8, true));
    flat.refit();
    World corner;
    corner.add(box({0.5, 0.5, 0.5}));
    corner.refit();
    for (const double shrink : {0.9, 0.99, 0.999, 0.99999}) {
        haptic::sim::ContactSettings settings;
        settings.shrink = shrink;
        const ProxyMove down =
            haptic::sim::move_proxy(flat.surfaces, {0.01, 0.1, 0.02}, {0.03, -0.2, 0.02}, kRadius, 0.01, settings);
        EXPECT_NEAR(down.position.y, kRadius, 1e-9) << shrink;
        ASSERT_EQ(down.contacts.count, 1u);
        EXPECT_NEAR(down.contacts.plane[0].offset, kRadius, 1e-9) << shrink;
        const ProxyMove in =
            haptic::sim::move_proxy(corner.surfaces, Vec3(0.1), {0.8, 0.9, 1.2}, kRadius, 0.01, settings);
        EXPECT_NEAR(glm::length(in.position - Vec3(0.47)), 0.0, 1e-9) << shrink;
    }
}

TEST(VirtualProxy, StaysWhereOnlyTheShrunkSphereFits) {
    // Between the shrunk and the full radius nothing pops it and nothing makes it move.
    World world;
    world.add(sheet(1.0, 8, true));
    world.refit();
    const Vec3 within(0.01, 0.9995 * kRadius, 0.02);
    EXPECT_EQ(haptic::sim::pop_out(world.surfaces, within, kRadius, {}).iterations, 0);
    EXPECT_FALSE(haptic::sim::secure_position(world.surfaces, within, kRadius, {}).touched);
    const Vec3 deeper(0.01, 0.998 * kRadius, 0.02);
    EXPECT_GT(haptic::sim::pop_out(world.surfaces, deeper, kRadius, {}).iterations, 0);
}

TEST(VirtualProxy, FitsAChannelThatIsWiderThanTheShrunkSphereOnly) {
    // The limit named in the thesis: the proxy fits into a hole of its own size. At half a thousandth less it does, at
    // two thousandths less it does not.
    for (const bool fits : {true, false}) {
        World world;
        const double half = (fits ? 0.9995 : 0.998) * kRadius;
        const Mat3 upright = rotation({0, 0, 1}, M_PI / 2);
        for (const double x : {-half, half}) {
            Body& wall = world.add(sheet(0.4, 4, true));
            wall.start = wall.end = placed(wall.mesh.vertices, upright, {x, 0, 0});
        }
        world.refit();
        const ProxyMove m = move(world, {0, 0.3, 0}, {0, -0.1, 0});
        EXPECT_EQ(m.position.y < 0.0, fits) << m.position.y;
    }
}

TEST(VirtualProxy, SlidesOverTheInnerEdgesOfAFlatSheetWithoutNoticing) {
    World world;
    world.add(sheet(1.0, 40, true));
    world.refit();
    Vec3 p(-0.4, kRadius, -0.3);
    for (int k = 0; k < 100; ++k) {
        const Vec3 goal(-0.4 + 0.008 * k, -0.02, -0.3 + 0.006 * k);
        const ProxyMove m = move(world, p, goal);
        ASSERT_NEAR(glm::length(m.position - Vec3(goal.x, kRadius, goal.z)), 0.0, 1e-9) << k;
        ASSERT_LE(m.iterations, 3) << k;
        p = m.position;
    }
}

TEST(VirtualProxy, SettlesInAConcaveEdgeAndInACornerOfThreePlanes) {
    World world;
    world.add(box({0.5, 0.5, 0.5}));
    world.refit();
    const ProxyMove edge = move(world, {0.1, 0.1, 0.1}, {0.8, 0.9, 0.2});
    EXPECT_NEAR(glm::length(edge.position - Vec3(0.47, 0.47, 0.2)), 0.0, 1e-9);
    EXPECT_EQ(edge.contacts.count, 2u);
    const ProxyMove corner = move(world, {0.1, 0.1, 0.1}, {0.8, 0.9, 1.2});
    EXPECT_NEAR(glm::length(corner.position - Vec3(0.47)), 0.0, 1e-9);
    EXPECT_EQ(corner.contacts.count, 3u);
}

TEST(VirtualProxy, RollsAboutAConvexEdgeAndACornerToTheNearestPoint) {
    World world;
    world.add(box({0.5, 0.5, 0.5}));
    world.refit();
    // Goals just inside the box: the nearest position is straight out from the edge or the corner.
    const Vec3 by_edge(0.505, 0.51, 0.1);
    const ProxyMove edge = move(world, {0.45, 0.6, 0.1}, by_edge);
    const Vec3 on_edge = Vec3(0.5, 0.5, 0.1) + glm::normalize(Vec3(0.005, 0.01, 0)) * kRadius;
    EXPECT_NEAR(glm::length(edge.position - on_edge), 0.0, 1e-4 * kRadius);
    ASSERT_EQ(edge.contacts.count, 1u);
    EXPECT_EQ(edge.contacts.plane[0].touched.feature, haptic::sim::Feature::Edge);
    const ProxyMove corner = move(world, {0.45, 0.6, 0.45}, {0.506, 0.51, 0.507});
    const Vec3 on_corner = Vec3(0.5) + glm::normalize(Vec3(0.006, 0.01, 0.007)) * kRadius;
    EXPECT_NEAR(glm::length(corner.position - on_corner), 0.0, 1e-4 * kRadius);
    EXPECT_EQ(corner.contacts.plane[0].touched.feature, haptic::sim::Feature::Vertex);
}

TEST(VirtualProxy, IsMovedAlikeByOneFaceOfADoubleFacedSheetAndByBoth) {
    Random random(12);
    for (int k = 0; k < 40; ++k) {
        World both;
        World one;
        TriangleMesh mesh = sheet(1.0, 12, false);
        const std::size_t fronts = mesh.triangles.size();
        for (std::size_t t = 0; t < fronts; ++t) {
            const haptic::sim::Triangle front = mesh.triangles[t];
            mesh.triangles.push_back({front[0], front[2], front[1]});
        }
        Body& body = both.add(mesh);
        body.tree =
            std::make_unique<haptic::sim::SweptTree>(mesh.vertices, body.mesh.triangles, haptic::sim::Faces::All);
        one.add(mesh);
        for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
            const Vec3 wave = random.in_cube(0.01);
            for (World* world : {&both, &one}) {
                world->bodies[0]->start[v] += wave;
                world->bodies[0]->end[v] += wave + Vec3(0, 0.05, 0);
            }
        }
        both.refit();
        one.refit();
        const Vec3 from(random.uniform(-0.3, 0.3), 0.06, random.uniform(-0.3, 0.3));
        const Vec3 goal = from + Vec3(random.uniform(-0.05, 0.05), -0.05, random.uniform(-0.05, 0.05));
        const Step a = haptic::sim::scenes::step(both, from, goal, kRadius);
        const Step b = haptic::sim::scenes::step(one, from, goal, kRadius);
        EXPECT_NEAR(glm::length(a.secure.position - b.secure.position), 0.0, 1e-9) << k;
        EXPECT_NEAR(glm::length(a.moved.position - b.moved.position), 0.0, 1e-7) << k;
        ASSERT_EQ(a.moved.contacts.count, b.moved.contacts.count) << k;
        for (std::size_t c = 0; c < a.moved.contacts.count; ++c) {
            EXPECT_EQ(a.moved.contacts.plane[c].touched.triangle, b.moved.contacts.plane[c].touched.triangle) << k;
        }
    }
}

TEST(VirtualProxy, EndsWhereNoPlaceNearbyIsNearerToTheGoal) {
    Random random(60);
    World world;
    Body& hills = world.add(sheet(1.0, 24, true));
    for (Vec3& v : hills.end) {
        v.y = 0.06 * std::sin(17.0 * v.x) * std::cos(13.0 * v.z);
    }
    hills.start = hills.end;
    world.refit();
    Vec3 p(0, 0.2, 0);
    int contacts = 0;
    for (int k = 0; k < 150; ++k) {
        const Vec3 goal(random.uniform(-0.4, 0.4), random.uniform(-0.15, 0.1), random.uniform(-0.4, 0.4));
        const ProxyMove m = move(world, p, goal);
        ASSERT_TRUE(m.converged) << k;
        ASSERT_GE(world.clearance(m.position), 0.998 * kRadius) << k;
        ASSERT_FALSE(can_do_better(world, m.position, goal, random, 3e-3 * kRadius)) << k;
        contacts += m.contacts.count > 0 ? 1 : 0;
        p = m.position;
    }
    EXPECT_GT(contacts, 60);
}

TEST(VirtualProxy, NeverGetsIntoOrOutOfAClosedMeshOnALongRandomWalk) {
    for (const bool inside : {false, true}) {
        for (const bool round : {false, true}) {
            Random random(61u + (inside ? 1u : 0u) + (round ? 2u : 0u));
            World world;
            Body& body = world.add(round ? ball(0.3, 8) : box({0.3, 0.25, 0.35}));
            Vec3 p = inside ? Vec3(0.01, 0.02, 0.03) : Vec3(0.01, 0.45, 0.02);
            Vec3 hip = p;
            Mat3 attitude(1.0);
            Vec3 place(0.0);
            int touched = 0;
            for (int k = 0; k < 500; ++k) {
                // The body tumbles by up to a twentieth of a radian and 20 mm a step, the hip moves by up to 100 mm.
                attitude = rotation(random.direction(), random.uniform(-0.05, 0.05)) * attitude;
                place = place * 0.95 + random.in_cube(0.02);
                body.stay();
                body.end = placed(body.mesh.vertices, attitude, place);
                world.refit();
                hip = hip * 0.93 + random.in_cube(0.1);
                const Step s = step(world, p, hip, kRadius);
                ASSERT_TRUE(s.crossings.empty()) << k;
                ASSERT_TRUE(s.standing.empty()) << k;
                p = s.moved.position;
                ASSERT_NEAR(haptic::sim::winding_number(body.end, body.mesh.triangles, p), inside ? 1.0 : 0.0, 1e-6)
                    << k;
                ASSERT_GE(world.clearance(p), 0.998 * kRadius) << k;
                touched += s.moved.contacts.count > 0 ? 1 : 0;
            }
            EXPECT_GT(touched, 30);
        }
    }
}

TEST(VirtualProxy, StaysInASlitThatIsTooNarrowAndSlidesAlongIt) {
    World world;
    Body& below = world.add(sheet(1.0, 8, true));
    Body& above = world.add(sheet(1.0, 8, true));
    below.start = below.end = placed(below.mesh.vertices, Mat3(1.0), {0, -0.02, 0});
    above.start = above.end = placed(above.mesh.vertices, Mat3(1.0), {0, 0.02, 0});
    world.refit();
    const Step s = step(world, {0, 0.001, 0}, {0.1, 0.4, 0.05}, kRadius);
    EXPECT_TRUE(s.crossings.empty());
    EXPECT_TRUE(s.popped.overconstrained);
    EXPECT_NEAR(s.moved.position.x, 0.1, 1e-3);
    EXPECT_NEAR(s.moved.position.z, 0.05, 1e-3);
    EXPECT_LT(std::abs(s.moved.position.y), 0.02);
    EXPECT_GE(s.moved.contacts.count, 1u);
}

}  // namespace
