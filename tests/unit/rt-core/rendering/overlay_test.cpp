#include "rendering/overlay.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kTick;
using test::kTickNs;

constexpr double kExact = 1e-12;
// 2 N within 0.1 s: 0.02 N a tick.
const OverlaySettings kBounds{.max_force = 2.0, .max_torque = 0.04, .timeout_ns = 50'000'000, .ramp_ns = 100'000'000};
constexpr double kForceStep = 2.0 / 0.1 * kTick;
constexpr double kTorqueStep = 0.04 / 0.1 * kTick;

WrenchOverlay overlay_of(const Vec3& force, const Vec3& torque, std::int64_t arrival_ns) {
    WrenchOverlay overlay{};
    overlay.arrival_time_ns = arrival_ns;
    store(force, overlay.force);
    store(torque, overlay.torque);
    return overlay;
}

/// The wrench after these ticks, with an overlay that arrives in each of them.
Wrench settled(Overlay& overlay, const Vec3& force, const Vec3& torque, int ticks) {
    Wrench wrench;
    for (int i = 0; i < ticks; ++i) {
        EXPECT_TRUE(overlay.accept(overlay_of(force, torque, i * kTickNs), i * kTickNs));
        wrench = overlay.render(i * kTickNs, kTickNs);
    }
    return wrench;
}

TEST(Overlay, IsOffByDefault) {
    EXPECT_FALSE(OverlaySettings{}.on());
    Overlay overlay{OverlaySettings{}};
    const Wrench wrench = settled(overlay, {100.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, 200);
    EXPECT_EQ(wrench.force, Vec3(0.0));
    EXPECT_EQ(wrench.torque, Vec3(0.0));
}

TEST(Overlay, IsWhatWasAskedForWithinItsBounds) {
    Overlay overlay(kBounds);
    const Wrench wrench = settled(overlay, {0.3, -0.2, 0.1}, {0.001, 0.002, -0.003}, 100);
    EXPECT_EQ(wrench.force, Vec3(0.3, -0.2, 0.1));
    EXPECT_EQ(wrench.torque, Vec3(0.001, 0.002, -0.003));
}

TEST(Overlay, KeepsItsDirectionAtTheBounds) {
    Overlay overlay(kBounds);
    const Vec3 direction = glm::normalize(Vec3(1, 2, -3));
    const Wrench wrench = settled(overlay, 50.0 * direction, -3.0 * direction, 110);
    EXPECT_LT(glm::length(wrench.force - 2.0 * direction), kExact);
    EXPECT_LT(glm::length(wrench.torque + 0.04 * direction), kExact);
}

TEST(Overlay, ChangesNoFasterThanItsRampWhateverIsAskedFor) {
    Overlay overlay(kBounds);
    Wrench before;
    for (int i = 0; i < 2000; ++i) {
        // Jumps between any directions, and none.
        const double angle = 2.399963 * i;
        const Vec3 asked = i % 7 == 0 ? Vec3(0.0) : 1e6 * Vec3(std::cos(angle), std::sin(angle), std::cos(3.0 * angle));
        ASSERT_TRUE(overlay.accept(overlay_of(asked, asked, i * kTickNs), i * kTickNs));
        const Wrench wrench = overlay.render(i * kTickNs, kTickNs);
        ASSERT_LE(glm::length(wrench.force), 2.0 + kExact);
        ASSERT_LE(glm::length(wrench.torque), 0.04 + kExact);
        ASSERT_LE(glm::length(wrench.force - before.force), kForceStep + kExact);
        ASSERT_LE(glm::length(wrench.torque - before.torque), kTorqueStep + kExact);
        before = wrench;
    }
}

TEST(Overlay, FadesLinearlyToZeroWhenNoneArrivesAnyMore) {
    Overlay overlay(kBounds);
    (void)settled(overlay, {0.0, 5.0, 0.0}, {}, 200);
    const std::int64_t last_ns = 199 * kTickNs;
    for (std::int64_t age_ns = kTickNs; age_ns <= 200 * kTickNs; age_ns += kTickNs) {
        const double fading_s = seconds(std::max<std::int64_t>(0, age_ns - kBounds.timeout_ns));
        const Wrench wrench = overlay.render(last_ns + age_ns, kTickNs);
        ASSERT_NEAR(wrench.force.y, std::max(0.0, 2.0 - 20.0 * fading_s), 1e-9) << age_ns;
        if (age_ns > kBounds.timeout_ns + kBounds.ramp_ns) {
            ASSERT_EQ(wrench.force, Vec3(0.0));
        }
    }
    // It comes back from zero.
    ASSERT_TRUE(overlay.accept(overlay_of({0.0, 5.0, 0.0}, {}, 1'000 * kTickNs), 1'000 * kTickNs));
    EXPECT_NEAR(overlay.render(1'000 * kTickNs, kTickNs).force.y, kForceStep, kExact);
}

TEST(Overlay, RefusesWhatIsNotFiniteAndKeepsTheLastOne) {
    Overlay overlay(kBounds);
    (void)settled(overlay, {0.0, 1.0, 0.0}, {0.0, 0.01, 0.0}, 100);
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        EXPECT_FALSE(overlay.accept(overlay_of({0.0, bad, 0.0}, {}, 120 * kTickNs), 120 * kTickNs));
        EXPECT_FALSE(overlay.accept(overlay_of({}, {bad, 0.0, 0.0}, 120 * kTickNs), 120 * kTickNs));
    }
    EXPECT_EQ(overlay.render(120 * kTickNs, kTickNs).force, Vec3(0.0, 1.0, 0.0));
    EXPECT_LT(overlay.render(160 * kTickNs, kTickNs).force.y, 1.0) << "its age is that of the last valid one";
}

TEST(Overlay, NeverComesFromATimeThatIsWrong) {
    constexpr std::int64_t now_ns = 1'000'000'000;
    for (const std::int64_t past_ns : {std::int64_t{0}, std::numeric_limits<std::int64_t>::min()}) {
        Overlay overlay(kBounds);
        ASSERT_TRUE(overlay.accept(overlay_of({0.0, 1.0, 0.0}, {}, past_ns), now_ns));
        EXPECT_EQ(overlay.render(now_ns, kTickNs).force, Vec3(0.0)) << past_ns;
    }
    // One that lies ahead must not begin to push when its time has come, without its sender.
    for (const std::int64_t ahead_ns : {3 * now_ns, std::numeric_limits<std::int64_t>::max()}) {
        Overlay overlay(kBounds);
        EXPECT_FALSE(overlay.accept(overlay_of({0.0, 1.0, 0.0}, {}, ahead_ns), now_ns));
        for (std::int64_t t_ns = now_ns; t_ns < 4 * now_ns; t_ns += kTickNs) {
            ASSERT_EQ(overlay.render(t_ns, kTickNs).force, Vec3(0.0)) << t_ns;
        }
    }
}

TEST(Overlay, AgesFromTheTickThatTookItIfItsTimeLiesSlightlyAhead) {
    Overlay overlay(kBounds);
    for (int i = 0; i <= 200; ++i) {
        ASSERT_TRUE(overlay.accept(overlay_of({0.0, 2.0, 0.0}, {}, (i + 40) * kTickNs), i * kTickNs));
        (void)overlay.render(i * kTickNs, kTickNs);
    }
    EXPECT_NEAR(overlay.render(250 * kTickNs, kTickNs).force.y, 2.0, kExact);
    EXPECT_NEAR(overlay.render(251 * kTickNs, kTickNs).force.y, 2.0 - kForceStep, kExact);
}

TEST(Overlay, ForgetsWhatWasReceivedWhenItIsReset) {
    Overlay overlay(kBounds);
    (void)settled(overlay, {0.0, 1.0, 0.0}, {0.0, 0.01, 0.0}, 100);
    overlay.reset();
    const Wrench wrench = overlay.render(100 * kTickNs, kTickNs);
    EXPECT_EQ(wrench.force, Vec3(0.0));
    EXPECT_EQ(wrench.torque, Vec3(0.0));
}

}  // namespace
}  // namespace haptic::rt
