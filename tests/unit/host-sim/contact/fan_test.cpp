// The experiment of section 4.4.2 of the thesis, on the contact code alone: a hand at 3 m/s moves through a fan from
// left to right, 1, 2 and 3 m below its rim, and carries the only free vertex, the centre, along.
#include "haptic/sim/fan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::CcdMethod;
using haptic::sim::ContactSettings;
using haptic::sim::PopOutMethod;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::kStep;
using haptic::sim::scenes::Step;
using haptic::sim::scenes::World;

constexpr double kSpeed = 3.0;  // m/s

struct Passage {
    int falls = 0;            // steps in which the centre of the proxy passed through the fan
    int overconstrained = 0;  // steps
    int contacts = 0;         // steps
    int max_pops = 0;         // iterations of the pop-out in one step
    double deepest = 0.0;     // m, of the centre vertex
    bool below = false;       // at the end: it is on the wrong side
};

/// Vertical height of a point above the cone from the rim to the centre vertex; for points within the rim.
double height_over(const std::vector<Vec3>& vertices, const Vec3& p) {
    double highest = -1e300;
    for (std::size_t k = 1; k < vertices.size(); ++k) {
        const Vec3& a = vertices[0];
        const Vec3& b = vertices[k];
        const Vec3& c = vertices[k + 1 < vertices.size() ? k + 1 : 1];
        const Vec3 n = glm::cross(b - a, c - a);
        const double u = ((b.x - p.x) * (c.z - p.z) - (b.z - p.z) * (c.x - p.x));
        const double v = ((c.x - p.x) * (a.z - p.z) - (c.z - p.z) * (a.x - p.x));
        const double w = ((a.x - p.x) * (b.z - p.z) - (a.z - p.z) * (b.x - p.x));
        if ((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0)) {
            highest = std::max(highest, a.y - (n.x * (p.x - a.x) + n.z * (p.z - a.z)) / n.y);
        }
    }
    return p.y - highest;
}

/// Path of the hand: down at the left, through to the right, up again.
Vec3 hand_at(double time, double rim, double depth) {
    const double x0 = -0.5 * rim;
    const double down = (depth + 0.2) / kSpeed;
    const double across = -2.0 * x0 / kSpeed;
    const double z = 0.013;  // beside the plane of symmetry
    if (time < down) {
        return {x0, 0.2 - kSpeed * time, z};
    }
    if (time < down + across) {
        return {x0 + kSpeed * (time - down), -depth, z};
    }
    return {-x0, std::min(0.2, -depth + kSpeed * (time - down - across)), z};
}

/// `order` shuffles the triangles.
Passage go_through(double rim, double depth, const ContactSettings& settings, std::uint64_t order = 0) {
    auto mesh = haptic::sim::make_fan_mesh({.rim_radius = rim});
    haptic::sim::oracle::Random random(order);
    for (std::size_t j = mesh.triangles.size() - 1; order > 0 && j > 0; --j) {
        std::swap(mesh.triangles[j], mesh.triangles[random.below(static_cast<std::uint32_t>(j + 1))]);
    }
    World world;
    Body& fan = world.add(mesh);
    Vec3 velocity(0.0);
    Vec3 proxy = hand_at(0.0, rim, depth);
    Passage passage;
    const double end = (2.0 * (depth + 0.2) + rim) / kSpeed + 1.0;
    for (int k = 0; k * kStep < end; ++k) {
        world.refit();
        const Vec3 hip = hand_at(k * kStep, rim, depth);
        const Step step = haptic::sim::scenes::step(world, proxy, hip, kRadius, settings);
        passage.falls += step.crossings.empty() ? 0 : 1;
        passage.overconstrained += step.popped.overconstrained || step.secure.overconstrained ? 1 : 0;
        passage.contacts += step.moved.contacts.count > 0 ? 1 : 0;
        passage.max_pops = std::max(passage.max_pops, step.popped.iterations);
        proxy = step.moved.position;
        // Centre vertex: 20 N/m to the hand, 1 N/m back to the middle, 5 g, damped so that it still bounces.
        Vec3 force = -1.0 * fan.end[0];
        for (std::size_t c = 0; c < step.moved.contacts.count; ++c) {
            const auto& plane = step.moved.contacts.plane[c];
            const auto& t = mesh.triangles[plane.touched.triangle];
            double weight = 0.0;
            for (int i = 0; i < 3; ++i) {
                weight += t[static_cast<std::size_t>(i)] == 0 ? plane.touched.weights[i] : 0.0;
            }
            force += plane.normal * (20.0 * weight * std::min(0.0, glm::dot(plane.normal, hip - proxy)));
        }
        velocity = 0.8 * (velocity + force * (kStep / 0.005));
        fan.stay();
        fan.end[0] += velocity * kStep;
        passage.deepest = std::max(passage.deepest, -fan.end[0].y);
    }
    world.refit();
    passage.below = height_over(fan.end, proxy) < 0.0;
    return passage;
}

TEST(ProxyInAFan, NeverFallsThroughAtAnyDepthRimAndOrderOfTriangles) {
    for (const double rim : {4.0, 1.0}) {  // m; the thesis does not give it
        for (const double depth : {1.0, 2.0, 3.0}) {
            for (const std::uint64_t order : {0u, 1u, 2u}) {
                const Passage passage = go_through(rim, depth, {}, order);
                EXPECT_EQ(passage.falls, 0) << rim << " " << depth << " " << order;
                EXPECT_FALSE(passage.below) << rim << " " << depth << " " << order;
                EXPECT_LE(passage.max_pops, 100) << rim << " " << depth << " " << order;
                EXPECT_GT(passage.contacts, 50) << rim << " " << depth << " " << order;
                EXPECT_GT(passage.deepest, 0.7 * depth) << "the centre went down with the hand";
            }
        }
    }
}

TEST(ProxyInAFan, IsLostByTheThesisTwoAlgorithmsWhereTheDefaultKeepsIt) {
    int falls = 0;
    for (const double rim : {4.0, 1.0}) {
        for (const double depth : {1.0, 2.0, 3.0}) {
            ContactSettings settings;
            settings.method = CcdMethod::Thesis;
            settings.pop_out = PopOutMethod::Thesis;
            const Passage passage = go_through(rim, depth, settings);
            const std::string where =
                std::to_string(static_cast<int>(rim)) + "_" + std::to_string(static_cast<int>(depth));
            RecordProperty("iterations_" + where, passage.max_pops);
            RecordProperty("falls_" + where, passage.falls);
            EXPECT_LE(passage.max_pops, settings.pop_out_limit);
            EXPECT_GT(passage.contacts, 50) << "it was there";
            falls += passage.falls;
        }
    }
    EXPECT_GT(falls, 0);
}

TEST(ProxyInAFan, NeedsNoPopOutAfterACompleteDetection) {
    // The advance with the touched surface already ends clear of all contacts: Algorithm 2 has nothing to do.
    for (const double depth : {1.0, 2.0, 3.0}) {
        ContactSettings settings;
        settings.pop_out = PopOutMethod::Thesis;
        const Passage passage = go_through(1.0, depth, settings);
        EXPECT_EQ(passage.max_pops, 0) << depth;
        EXPECT_EQ(passage.falls, 0) << depth;
    }
}

}  // namespace
