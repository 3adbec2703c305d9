// Claim: neither the division of the scene into surfaces nor other surfaces far away change the proxy.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"
#include "contact/speculative_planes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::MovingSurface;
using haptic::sim::SurfacePlanes;
using haptic::sim::Triangle;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::ball;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::box;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::kTravel;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::rotation;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::Step;
using haptic::sim::scenes::World;

/// The triangles k, k + parts, k + 2 parts ... of a mesh, with all of its vertices.
TriangleMesh part_of(const TriangleMesh& mesh, std::size_t k, std::size_t parts) {
    TriangleMesh part;
    part.vertices = mesh.vertices;
    for (; k < mesh.triangles.size(); k += parts) {
        part.triangles.push_back(mesh.triangles[k]);
    }
    return part;
}

SurfacePlanes reach(const World& world, const Step& s) {
    return haptic::sim::speculative_planes(
        world.surfaces, s.moved.contacts,
        {.position = s.moved.position, .radius = kRadius, .reach = 0.3 * kRadius, .dt = 0.01});
}

TEST(ManySurfaces, AreAsOneHoweverAMeshIsCut) {
    Random random(61);
    const TriangleMesh whole = sheet(0.4, 10, false);
    World one;
    one.add(whole);
    World many;
    many.add(TriangleMesh{});  // neither vertices nor triangles
    for (std::size_t k = 0; k < 7; ++k) {
        many.add(part_of(whole, k, 7));
    }
    TriangleMesh no_triangles = whole;
    no_triangles.triangles.clear();
    many.add(no_triangles);
    const std::size_t near = many.bodies.size();
    for (int k = 0; k < 40; ++k) {
        Body& away = many.add(sheet(0.4, 2, true));
        const Vec3 direction = random.direction();
        away.start = away.end = placed(away.mesh.vertices, Mat3(1.0), direction * random.uniform(3.0, 90.0));
    }
    int touched = 0;
    int planes = 0;
    for (int k = 0; k < 150; ++k) {
        const Vec3 axis = random.direction();
        const Mat3 attitude = rotation(axis, random.uniform(0.0, 3.0));
        const Vec3 spin = random.direction();
        const Mat3 rotated = rotation(spin, random.uniform(-0.5, 0.5)) * attitude;
        const Vec3 travel = random.direction() * kTravel;
        const Vec3 middle = random.in_cube(0.05);
        const auto start = placed(whole.vertices, attitude, middle - travel * 0.7);
        const auto end = placed(whole.vertices, rotated, middle + travel * 0.3);
        const Vec3 proxy = travel * 0.3;
        one.bodies[0]->start = start;
        one.bodies[0]->end = end;
        for (std::size_t b = 0; b < near; ++b) {
            if (!many.bodies[b]->mesh.vertices.empty()) {
                many.bodies[b]->start = start;
                many.bodies[b]->end = end;
            }
        }
        one.refit();
        many.refit();
        const Step a = step(one, proxy, proxy, kRadius);
        const Step b = step(many, proxy, proxy, kRadius);
        ASSERT_EQ(a.secure.touched, b.secure.touched) << k;
        ASSERT_NEAR(a.secure.first_time, b.secure.first_time, 1e-12) << k;
        ASSERT_NEAR(glm::length(a.secure.position - b.secure.position), 0.0, 1e-9) << k;
        ASSERT_NEAR(glm::length(a.popped.position - b.popped.position), 0.0, 1e-9) << k;
        ASSERT_NEAR(glm::length(a.moved.position - b.moved.position), 0.0, 1e-9) << k;
        ASSERT_TRUE(b.crossings.empty()) << k;
        const SurfacePlanes p = reach(one, a);
        const SurfacePlanes q = reach(many, b);
        ASSERT_EQ(p.count, q.count) << k;
        for (std::uint32_t n = 0; n < p.count; ++n) {
            ASSERT_NEAR(glm::length(p.plane[n].normal - q.plane[n].normal), 0.0, 1e-6) << k;
            ASSERT_NEAR(p.plane[n].offset, q.plane[n].offset, 1e-9) << k;
            ASSERT_GE(q.plane[n].touched.object, 1u) << k;
            ASSERT_LT(q.plane[n].touched.object, near - 1) << k << ": an empty or a far one";
        }
        touched += a.secure.touched ? 1 : 0;
        planes += p.count > 0 ? 1 : 0;
    }
    EXPECT_GT(touched, 50);
    EXPECT_GT(planes, 30);
}

TEST(ManySurfaces, MayBeNone) {
    World nothing;
    nothing.refit();
    const Step s = step(nothing, Vec3(0.0), Vec3(1.0, 2.0, 3.0), kRadius);
    EXPECT_EQ(s.moved.position, Vec3(1.0, 2.0, 3.0));
    EXPECT_EQ(reach(nothing, s).count, 0u);
}

TEST(ManySurfaces, OfSizesAThousandApartAreBothMet) {
    World world;
    Body& ground = world.add(sheet(100.0, 1, false));
    Body& bead = world.add(ball(0.002, 6));
    ground.start = ground.end = placed(ground.mesh.vertices, Mat3(1.0), {0, -0.05, 0});
    // The bead hits the sphere from above at 14 m/s and drives it onto the ground.
    for (int k = 0; k < 20; ++k) {
        const double height = 0.035 + 0.003 * k;
        bead.start = placed(bead.mesh.vertices, Mat3(1.0), {0.0003, height, 0.0004});
        bead.end = placed(bead.mesh.vertices, Mat3(1.0), {0.0003, height - 0.05, 0.0004});
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0, -0.03, 0.0), kRadius);
        ASSERT_TRUE(s.crossings.empty()) << k;
        ASSERT_GE(world.clearance(s.moved.position), 0.999 * kRadius) << k;
        ASSERT_TRUE(s.secure.touched == (height - 0.05 < kRadius + 0.002)) << k;
    }
}

/// Motion of one surface of a crowd.
struct Flight {
    Vec3 middle{0.0};
    Vec3 velocity{0.0};  // m a step
    Vec3 axis{0.0, 1.0, 0.0};
    double angle = 0.0;  // rad
    double spin = 0.0;   // rad a step
};

TEST(ManySurfaces, CrowdAroundAHostileHandWithoutPassingIt) {
    Random random(62);
    World world;
    std::vector<Flight> flights(24);
    for (std::size_t k = 0; k < flights.size(); ++k) {
        const double size = random.uniform(0.02, 0.12);
        world.add(k % 3 == 0 ? ball(size, 6)
                             : (k % 3 == 1 ? box({size, 0.6 * size, 0.3 * size}) : sheet(3.0 * size, 6, true)));
        flights[k].middle = random.direction() * 0.35;
        flights[k].axis = random.direction();
    }
    Vec3 proxy(0.0);
    Vec3 hip(0.0);
    int contacts = 0;
    int stood = 0;
    for (int k = 0; k < 1500; ++k) {
        for (std::size_t b = 0; b < flights.size(); ++b) {
            Flight& f = flights[b];
            if (random.below(20) == 0 || glm::length(f.middle) > 0.4) {
                const Vec3 aim = random.in_cube(0.1);
                f.velocity = (aim - f.middle) * random.uniform(0.02, 0.25);
                f.spin = random.uniform(-0.3, 0.3);
            }
            Body& body = *world.bodies[b];
            body.start = placed(body.mesh.vertices, rotation(f.axis, f.angle), f.middle);
            f.middle += f.velocity;
            f.angle += f.spin;
            body.end = placed(body.mesh.vertices, rotation(f.axis, f.angle), f.middle);
        }
        world.refit();
        // Up to 5 m/s with occasional jumps: it is not the hand that keeps the proxy out.
        hip = random.below(50) == 0 ? random.in_cube(0.3) : 0.9 * hip + random.in_cube(0.03);
        const Step s = step(world, proxy, hip, kRadius);
        proxy = s.moved.position;
        ASSERT_TRUE(std::isfinite(proxy.x + proxy.y + proxy.z)) << k;
        ASSERT_TRUE(s.crossings.empty()) << "step " << k << ": passed by surface " << s.crossings[0].object;
        ASSERT_FALSE(s.secure.no_room) << k;
        stood += s.standing.empty() ? 0 : 1;
        for (const std::uint32_t b : s.standing) {
            flights[b].middle -= flights[b].velocity;
            flights[b].angle -= flights[b].spin;
        }
        contacts += s.moved.contacts.count > 0 ? 1 : 0;
    }
    EXPECT_GT(contacts, 300);
    EXPECT_GT(stood, 10) << "surfaces pass through one another at the proxy";
    RecordProperty("in_contact_of_1500", contacts);
    RecordProperty("stood_in_of_1500", stood);
}

}  // namespace
