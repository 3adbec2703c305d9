// Claim: candidates collected before a step change how fast its queries are answered, never the answer.
#include "contact/contact_candidates.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"
#include "contact/speculative_planes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::Aabb;
using haptic::sim::ContactCandidates;
using haptic::sim::NearSurfaces;
using haptic::sim::PopOut;
using haptic::sim::ProxyMove;
using haptic::sim::ProxyReach;
using haptic::sim::SecurePosition;
using haptic::sim::SpeculativeQuery;
using haptic::sim::SpeculativeTask;
using haptic::sim::SurfacePlanes;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::ball;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::rotation;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;

struct Moved {
    SecurePosition secure;
    PopOut popped;
    ProxyMove move;
    SurfacePlanes planes;
};

SpeculativeQuery reach_of(const Moved& m, const ProxyReach& at) {
    return {.position = m.move.position, .radius = at.radius, .reach = 0.01, .dt = 0.01};
}

Moved moved(const NearSurfaces& surfaces, const ProxyReach& at) {
    Moved m;
    m.secure = secure_position(surfaces, at.position, at.radius, {});
    m.popped = pop_out(surfaces, m.secure.position, at.radius, {});
    m.move = move_proxy(surfaces, m.popped.position, at.goal, at.radius, 0.01, {});
    m.planes = speculative_planes(surfaces, m.move.contacts, reach_of(m, at));
    return m;
}

void expect_same(const SurfacePlanes& a, const SurfacePlanes& b) {
    ASSERT_EQ(a.count, b.count);
    for (std::uint32_t k = 0; k < a.count; ++k) {
        EXPECT_EQ(a.plane[k].normal, b.plane[k].normal);
        EXPECT_EQ(a.plane[k].offset, b.plane[k].offset);
        EXPECT_EQ(a.plane[k].touched.object, b.plane[k].touched.object);
        EXPECT_EQ(a.plane[k].touched.triangle, b.plane[k].touched.triangle);
    }
}

void expect_same(const Moved& a, const Moved& b) {
    EXPECT_EQ(a.secure.position, b.secure.position);
    EXPECT_EQ(a.secure.advances, b.secure.advances);
    EXPECT_EQ(a.secure.first_time, b.secure.first_time);
    EXPECT_EQ(a.secure.first.triangle, b.secure.first.triangle);
    EXPECT_EQ(a.secure.overconstrained, b.secure.overconstrained);
    EXPECT_EQ(a.popped.position, b.popped.position);
    EXPECT_EQ(a.popped.clearance, b.popped.clearance);
    EXPECT_EQ(a.move.position, b.move.position);
    EXPECT_EQ(a.move.iterations, b.move.iterations);
    expect_same(a.planes, b.planes);
}

/// Two balls and a waving sheet between them, rotated and shifted by up to `travel` a step.
class Waves : public testing::TestWithParam<double> {
  protected:
    Waves() {
        world.add(sheet(0.6, 24, true));
        world.add(ball(0.1, 10));
        world.add(ball(0.07, 16));
    }
    void move(double travel) {
        for (std::size_t b = 0; b < world.bodies.size(); ++b) {
            Body& body = *world.bodies[b];
            const Vec3 shift = Vec3(0.0, 0.12 * (static_cast<double>(b) - 1.0), 0.0) + random.in_cube(0.05);
            const Mat3 attitude = rotation(random.direction(), random.uniform(0.0, 0.5));
            body.start = placed(body.mesh.vertices, attitude, shift);
            body.end = placed(body.mesh.vertices, rotation(random.direction(), travel) * attitude,
                              shift + random.in_cube(travel));
            for (Vec3& v : body.end) {
                v.y += 0.2 * travel * std::sin(20.0 * v.x);
            }
        }
        world.refit();
    }

    Random random{71};
    World world;
};

TEST_P(Waves, MoveEachProxyOfAToolToTheSameBitsHoweverItsCandidatesAreFound) {
    ContactCandidates contact_candidates(9);
    int touching = 0;
    int advances = 0;
    std::size_t listed = 0;
    for (int round = 0; round < 20; ++round) {
        move(GetParam());
        std::vector<ProxyReach> tool;
        for (int k = 0; k < 9; ++k) {
            // Goals up to some twenty radii away; the last proxies are larger and smaller than the others.
            const Vec3 at = random.in_cube(0.2);
            const double radius = k == 7 ? 2.0 * kRadius : k == 8 ? 0.2 * kRadius : kRadius;
            tool.push_back({at, at + random.in_cube(random.uniform(0.0, 0.3)), radius});
        }
        contact_candidates.collect(world.surfaces, tool);
        std::vector<SpeculativeTask> reach;
        for (std::size_t k = 0; k < tool.size(); ++k) {
            const Moved with = moved(contact_candidates.of(k), tool[k]);
            reach.push_back({with.move.contacts, reach_of(with, tool[k]), {}});
            expect_same(with, moved(world.surfaces, tool[k]));
            touching += with.planes.count > 0 ? 1 : 0;
            advances += with.secure.advances > 1 ? 1 : 0;
            listed += contact_candidates.listed(k);
        }
        speculative_planes(world.surfaces, reach);  // of all at once
        for (std::size_t k = 0; k < tool.size(); ++k) {
            expect_same(reach[k].planes, speculative_planes(world.surfaces, reach[k].contacts, reach[k].query));
        }
    }
    EXPECT_GT(touching, 40);
    EXPECT_GT(advances, 15);
    EXPECT_GT(listed, 1000u);
}

// m a step: slow, some radii, and so fast that every list overflows
INSTANTIATE_TEST_SUITE_P(Travel, Waves, testing::Values(0.002, 0.05, 0.5));

TEST(ContactCandidates, QueryTheTreesWhereTheListOverflows) {
    World world;
    Body& fine = world.add(sheet(0.1, 40, true));  // 3,200 triangles in less than two diameters
    fine.end = placed(fine.mesh.vertices, Mat3(1.0), Vec3(0.0, 0.02, 0.0));
    world.refit();
    ContactCandidates contact_candidates(2);
    const std::array<ProxyReach, 2> tool{ProxyReach{{0.0, 0.04, 0.0}, {0.01, 0.0, 0.0}, kRadius},
                                         ProxyReach{{0.0, 5.0, 0.0}, {0.0, 4.9, 0.0}, kRadius}};
    contact_candidates.collect(world.surfaces, tool);
    EXPECT_EQ(contact_candidates.overflows(), 1u);
    EXPECT_EQ(contact_candidates.listed(1), 0u);
    for (std::size_t k = 0; k < tool.size(); ++k) {
        expect_same(moved(contact_candidates.of(k), tool[k]), moved(world.surfaces, tool[k]));
    }
    EXPECT_EQ(moved(contact_candidates.of(0), tool[0]).move.contacts.count, 1u);
}

TEST(ContactCandidates, KnowMoreSurfacesThanTheyCanListForOneProxy) {
    World world;
    for (int k = 0; k < 40; ++k) {
        Body& body = world.add(sheet(0.02, 1, false));
        const Vec3 shift(0.01 * (k % 7), -0.005 * (k % 3), 0.01 * static_cast<double>(k / 7));
        body.start = placed(body.mesh.vertices, Mat3(1.0), shift);
        body.end = placed(body.mesh.vertices, Mat3(1.0), shift + Vec3(0.0, 0.01, 0.0));
    }
    world.refit();
    ContactCandidates contact_candidates(1);
    const std::array<ProxyReach, 1> proxy{ProxyReach{{0.03, 0.031, 0.02}, {0.03, 0.0, 0.02}, kRadius}};
    contact_candidates.collect(world.surfaces, proxy);
    EXPECT_EQ(contact_candidates.overflows(), 1u);
    expect_same(moved(contact_candidates.of(0), proxy[0]), moved(world.surfaces, proxy[0]));
}

TEST(ContactCandidates, VisitTheTrianglesOfAQueryInTheOrderOfTheTree) {
    Random random(5);
    World world;
    Body& body = world.add(sheet(0.4, 12, false));
    for (Vec3& v : body.end) {
        v += random.in_cube(0.01);
    }
    world.refit();
    ContactCandidates contact_candidates(1);
    std::size_t seen = 0;
    for (int k = 0; k < 1000; ++k) {
        const Vec3 p = random.in_cube(0.2);
        const std::array<ProxyReach, 1> proxy{ProxyReach{p, p, kRadius}};
        contact_candidates.collect(world.surfaces, proxy);
        const haptic::sim::SweptSphere ball(p, p + random.in_cube(0.003), random.uniform(0.3, 1.0) * kRadius);
        std::vector<std::uint32_t> listed;
        contact_candidates.of(0).query(0, ball, haptic::sim::QueryTime::WholeStep,
                                       [&](std::uint32_t t) { listed.push_back(t); });
        std::size_t next = 0;
        NearSurfaces(world.surfaces).query(0, ball, haptic::sim::QueryTime::WholeStep, [&](std::uint32_t t) {
            next += next < listed.size() && listed[next] == t ? 1u : 0u;
        });
        ASSERT_EQ(next, listed.size()) << "an ordered part of what the tree gives";
        // No triangle that enters the sphere is left out: points on it, at the start and the end of the step.
        for (std::uint32_t t = 0; t < body.mesh.triangles.size(); ++t) {
            for (int sample = 0; sample < 6; ++sample) {
                const double a = random.uniform(0.0, 1.0);
                const double b = random.uniform(0.0, 1.0 - a);
                const auto& x = random.below(2) != 0 ? body.start : body.end;
                const haptic::sim::Triangle& c = body.mesh.triangles[t];
                if (glm::length(x[c[0]] * a + x[c[1]] * b + x[c[2]] * (1.0 - a - b) - p) < 0.3 * kRadius) {
                    ++seen;
                    ASSERT_NE(std::find(listed.begin(), listed.end(), t), listed.end()) << t;
                }
            }
        }
    }
    EXPECT_GT(seen, 30u);
}

TEST(ContactCandidates, FollowAProxyThatLeavesItsRegion) {
    // Oracle: the exact closest point of every triangle.
    Random random(6);
    World world;
    Body& body = world.add(sheet(0.4, 12, false));
    world.refit();
    ContactCandidates contact_candidates(1);
    const std::array<ProxyReach, 1> proxy{ProxyReach{Vec3(0.0, 1.0, 0.0), Vec3(0.0, 1.0, 0.0), kRadius}};
    contact_candidates.collect(world.surfaces, proxy);
    const NearSurfaces near = contact_candidates.of(0);
    ASSERT_EQ(contact_candidates.listed(0), 0u) << "nothing is near its start";
    std::size_t seen = 0;
    for (int k = 0; k < 200; ++k) {
        const Vec3 p = random.in_cube(0.2) * Vec3(1.0, 0.1, 1.0);
        std::vector<std::uint32_t> visited;
        near.query(0, {p, p, kRadius}, haptic::sim::QueryTime::EndOfStep,
                   [&](std::uint32_t t) { visited.push_back(t); });
        EXPECT_GT(contact_candidates.listed(0), 0u) << "the list has followed";
        for (std::uint32_t t = 0; t < body.mesh.triangles.size(); ++t) {
            const haptic::sim::Triangle& c = body.mesh.triangles[t];
            const haptic::sim::ClosestPoint at =
                haptic::sim::closest_point_on_triangle(p, {body.end[c[0]], body.end[c[1]], body.end[c[2]]});
            if (at.squared_distance < kRadius * kRadius) {
                ++seen;
                ASSERT_NE(std::find(visited.begin(), visited.end(), t), visited.end()) << t;
            }
        }
    }
    EXPECT_GT(seen, 1000u);
    // A long sweep is a single query: the list stays.
    const std::size_t listed = contact_candidates.listed(0);
    near.query(0, {Vec3(-0.2, 0.0, 0.0), Vec3(0.2, 0.0, 0.0), kRadius}, haptic::sim::QueryTime::EndOfStep,
               [](std::uint32_t) {});
    EXPECT_EQ(contact_candidates.listed(0), listed);
}

TEST(ContactCandidates, VisitEveryTriangleThatASphereTouchesFarFromTheOrigin) {
    // Oracle: the exact closest point of every triangle. At 50 m single precision resolves 4e-6 m.
    Random random(11);
    const Vec3 far(50.0, -30.0, 20.0);
    World world;
    Body& body = world.add(ball(0.1, 12));
    for (std::vector<Vec3>* vertices : {&body.start, &body.end}) {
        for (Vec3& v : *vertices) {
            v += far;
        }
    }
    world.refit();
    ContactCandidates contact_candidates(1);
    std::size_t touched = 0;
    for (int k = 0; k < 300; ++k) {
        const Vec3 p = far + random.direction() * random.uniform(0.1, 0.135);
        const std::array<ProxyReach, 1> proxy{ProxyReach{p, p, kRadius}};
        contact_candidates.collect(world.surfaces, proxy);
        const haptic::sim::SweptSphere sphere(p, p, kRadius);
        for (const NearSurfaces& near : {contact_candidates.of(0), NearSurfaces(world.surfaces)}) {
            std::vector<std::uint32_t> visited;
            near.query(0, sphere, haptic::sim::QueryTime::EndOfStep, [&](std::uint32_t t) { visited.push_back(t); });
            for (std::uint32_t t = 0; t < body.mesh.triangles.size(); ++t) {
                const haptic::sim::Triangle& c = body.mesh.triangles[t];
                const auto closest =
                    haptic::sim::closest_point_on_triangle(p, {body.end[c[0]], body.end[c[1]], body.end[c[2]]});
                if (closest.squared_distance <= kRadius * kRadius) {
                    ++touched;
                    ASSERT_NE(std::find(visited.begin(), visited.end(), t), visited.end()) << t;
                }
            }
        }
    }
    EXPECT_GT(touched, 300u);
}

TEST(ContactCandidates, DoNotHandOnContactPointsToTheNextStep) {
    World world;
    Body& body = world.add(sheet(0.4, 12, true));
    ContactCandidates contact_candidates(1);
    // The sheet rises under a proxy that begins each step where it was found clear in the step before: at the same
    // sphere, other points.
    Vec3 position(0.01, 0.9 * kRadius, 0.02);
    for (int step = 0; step < 4; ++step) {
        for (Vec3& v : body.end) {
            v.y += 0.05 * kRadius;
        }
        body.start = body.end;
        world.refit();
        const std::array<ProxyReach, 1> proxy{ProxyReach{position, position, kRadius}};
        contact_candidates.collect(world.surfaces, proxy);
        const PopOut listed = pop_out(contact_candidates.of(0), position, kRadius, {});
        const PopOut searched = pop_out(world.surfaces, position, kRadius, {});
        EXPECT_EQ(listed.position, searched.position) << step;
        EXPECT_GT(listed.iterations, 0) << step;
        position = listed.position;
    }
}

TEST(ContactCandidates, OfAProxyThatWasNotCollectedAreTheTrees) {
    World world;
    world.add(sheet(0.4, 12, true));
    world.refit();
    ContactCandidates contact_candidates(2);
    const std::array<ProxyReach, 1> one{ProxyReach{{0.0, 0.03, 0.0}, {0.0, -0.1, 0.0}, kRadius}};
    contact_candidates.collect(world.surfaces, one);
    expect_same(moved(contact_candidates.of(1), one[0]), moved(world.surfaces, one[0]));
    EXPECT_EQ(contact_candidates.listed(1), 0u);
    EXPECT_GT(contact_candidates.listed(0), 0u);
}

TEST(ContactCandidates, AreForSixtyFourProxiesAtMost) {
    EXPECT_NO_THROW(ContactCandidates(64));
    EXPECT_THROW(ContactCandidates(65), std::invalid_argument);
}

}  // namespace
