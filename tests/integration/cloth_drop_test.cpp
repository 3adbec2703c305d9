// The cloth falls 10 m onto the proxy and is felt at the strings: the whole chain in lockstep.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "lockstep.hpp"

namespace haptic::test {
namespace {

constexpr double kDacCode = 1.0 / (0.365296803653 * 415.0);  // N per DAC code
constexpr double kForceLimit = 8.0;                          // N, rt-core's default

Lockstep::Settings cloth_drop(const PoseTrack& hand = PoseTrack()) {
    return {.scene = sim::read_scene(sim::open_scene("cloth-drop"), "cloth-drop"), .hand = hand, .tick = {}};
}

/// The hand oscillates by 8 mm and rotates slightly while the cloth falls.
PoseTrack moving_hand() {
    std::vector<double> times;
    std::vector<Pose> poses;
    for (int i = 0; i <= 300; ++i) {
        const double t = i * 0.01;
        const double ease = std::min(1.0, t);
        const double angle = 0.15 * ease * std::sin(5.0 * t);
        times.push_back(t);
        poses.push_back({Vec3(0.008 * ease * std::sin(4.0 * t), 0.004 * ease * std::sin(7.0 * t), 0.0),
                         Quat(std::cos(angle / 2.0), 0.0, std::sin(angle / 2.0), 0.0)});
    }
    return {std::move(times), std::move(poses)};
}

/// Distance from a point to a triangle by dense sampling of barycentric coordinates: slow, never too small, independent
/// of the contact code.
double sampled_distance(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
    constexpr int kSamples = 24;
    double min_distance = HUGE_VAL;
    for (int i = 0; i <= kSamples; ++i) {
        for (int j = 0; i + j <= kSamples; ++j) {
            const double u = static_cast<double>(i) / kSamples;
            const double v = static_cast<double>(j) / kSamples;
            min_distance = std::min(min_distance, glm::length(p - (a + u * (b - a) + v * (c - a))));
        }
    }
    return min_distance;
}

double clearance(const Vec3& proxy, const std::vector<Vec3>& vertices, const std::vector<sim::Triangle>& triangles) {
    constexpr double kNear = 0.15;  // m; farther triangles of 3 cm are skipped
    double min_distance = HUGE_VAL;
    for (const sim::Triangle& t : triangles) {
        if (glm::length(vertices[t[0]] - proxy) < kNear) {
            min_distance =
                std::min(min_distance, sampled_distance(proxy, vertices[t[0]], vertices[t[1]], vertices[t[2]]));
        }
    }
    return min_distance;
}

TEST(ClothDrop, IsCaughtByAHandThatHoldsStill) {
    Lockstep chain(cloth_drop());
    int contacts = 0;
    double peak = 0.0;
    double before = 0.0;
    for (int step = 0; step < 250; ++step) {
        const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            peak = std::max(peak, glm::length(tick.rendered.force));
        });
        ASSERT_FALSE(result.crossed) << "the proxy's centre passed through the cloth in step " << step;
        contacts += result.in_contact ? 1 : 0;
        before = step < 130 ? peak : before;
    }
    EXPECT_EQ(before, 0.0) << "N, before the cloth arrives at 1.43 s: free motion must have no force";
    EXPECT_GT(contacts, 10);
    EXPECT_GT(peak, 0.1) << "N";
    EXPECT_LE(peak, kForceLimit * (1.0 + 1e-9)) << "N";
    EXPECT_EQ(chain.tick().faults(), 0u);
}

TEST(ClothDrop, StringsMakeTheWrenchThatIsRendered) {
    Lockstep chain(cloth_drop(moving_hand()));
    const device::DeviceGeometry geometry = device::spidar_g6_x3r();
    double force_error = 0.0;
    double torque_error = 0.0;
    double peak = 0.0;
    for (int step = 0; step < 230; ++step) {
        chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard& board) {
            const Wrench pulled = board.device().wrench();
            force_error = std::max(force_error, glm::length(pulled.force - tick.rendered.force));
            torque_error = std::max(torque_error, glm::length(pulled.torque - tick.rendered.torque));
            peak = std::max(peak, glm::length(tick.rendered.force));
            for (const double tension : board.device().tensions()) {
                ASSERT_GE(tension, geometry.minimum_tension - kDacCode) << "N";
                ASSERT_LE(tension, geometry.maximum_tension) << "N";
            }
        });
    }
    // The tensions are summed over the true directions of the strings, where the grip really is. Digits are cut off
    // below, so each string may lack up to one; what the encoders do not resolve of the pose is far below that.
    EXPECT_GT(peak, 0.1) << "N: without a force this proves nothing";
    EXPECT_LE(force_error, 8.0 * kDacCode) << "N";
    EXPECT_LE(torque_error, 8.0 * kDacCode * 0.0225) << "N*m, at the grip's radius";
}

TEST(ClothDrop, PoseIsKnownToTheEncodersResolutionWhileTheHandMoves) {
    Lockstep chain(cloth_drop(moving_hand()));
    double largest = 0.0;
    for (int step = 0; step < 200; ++step) {
        chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard& board) {
            largest = std::max(largest, glm::length(tick.pose.position - board.device().grip_pose().position));
        });
    }
    EXPECT_LT(largest, 50e-6) << "m: three counts of 17 um";
}

TEST(ClothDrop, TouchesTheProxyAndNeverOverlapsIt) {
    Lockstep chain(cloth_drop());
    const sim::ProxySettings proxy = chain.simulation().scene().proxy;
    double nearest = HUGE_VAL;
    for (int step = 0; step < 250; ++step) {
        // A step places its proxy among the surfaces at the beginning of the step.
        const std::vector<Vec3> vertices = chain.simulation().vertices();
        const sim::StepResult result = chain.step();
        if (!result.overconstrained) {
            const double min_distance = clearance(result.proxy, vertices, chain.simulation().mesh().triangles);
            ASSERT_GE(min_distance, proxy.radius * proxy.shrink * (1.0 - 1e-9)) << "m, step " << step;
            nearest = std::min(nearest, min_distance);
        }
    }
    EXPECT_LT(nearest, proxy.radius * 1.05) << "m: the cloth never came near";
}

/// FNV-1a hash over all results of the chain.
std::uint64_t run_and_hash() {
    Lockstep chain(cloth_drop(moving_hand()));
    std::uint64_t hash = 14695981039346656037ull;
    const auto add = [&hash](const void* data, std::size_t bytes) {
        for (std::size_t i = 0; i < bytes; ++i) {
            hash = (hash ^ static_cast<const unsigned char*>(data)[i]) * 1099511628211ull;
        }
    };
    for (int step = 0; step < 200; ++step) {
        chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard& board) {
            const auto tensions = board.device().tensions();
            add(tensions.data(), sizeof tensions);
            add(&tick.pose.position, sizeof tick.pose.position);
            add(&tick.rendered.force, sizeof tick.rendered.force);
        });
        const std::uint64_t state = chain.simulation().state_hash();
        add(&state, sizeof state);
    }
    return hash;
}

TEST(ClothDrop, IsTheSameToTheLastBitEachTime) {
    EXPECT_EQ(run_and_hash(), run_and_hash());
}

TEST(ClothDrop, EndsInTheSameStateOnEveryMachineAndCompiler) {
    // Changes only with a deliberate change of the method.
    constexpr std::uint64_t kStateAfterTheScene = 0x44eabea83de264d2;
    sim::Simulation simulation(cloth_drop().scene);
    for (std::int64_t step = 0; step < 250; ++step) {
        simulation.step(simulation.scripted_input(step * nanoseconds(simulation.scene().solver.step)));
    }
    EXPECT_EQ(simulation.state_hash(), kStateAfterTheScene);
}

}  // namespace
}  // namespace haptic::test
