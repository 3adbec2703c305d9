#include "rendering/renderer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <numbers>

#include "rendering/floor_frame.hpp"
#include "rendering/loaded_tool.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::render_once;

constexpr std::int64_t kTickNs = 1'000'000;
constexpr double kStiffness = 500.0;   // N/m
constexpr double kSheetTravel = 0.02;  // m
constexpr double kSheetPeriod = 0.5;   // s

Pose at(double y) {
    return {Vec3(0.001, y, -0.002), Quat(1, 0, 0, 0)};
}

void set_plane(ContactPlane& plane, const Vec3& normal, double offset) {
    store(normal, plane.normal);
    plane.offset = offset;
}

TEST(Render, MakesExactlyNoForceInFreeMotion) {
    const Contact contact = render_once(floor_frame(-0.01, kStiffness, 0), at(0.0));
    EXPECT_EQ(contact.wrench.force, Vec3(0.0));
    EXPECT_EQ(contact.wrench.torque, Vec3(0.0));
    EXPECT_EQ(contact.proxy, at(0.0).position);
    EXPECT_EQ(contact.in_contact, 0u);
}

TEST(Render, IsASpringFromTheDeviceToTheProxyOfOneSphere) {
    const Contact contact = render_once(floor_frame(0.0, kStiffness, 0), at(-0.004), 0);
    EXPECT_NEAR(contact.wrench.force.y, kStiffness * 0.004, 1e-12);
    EXPECT_EQ(contact.wrench.force.x, 0.0);
    EXPECT_EQ(contact.wrench.torque, Vec3(0.0));
    EXPECT_LT(glm::length(contact.proxy - Vec3(0.001, 0.0, -0.002)), 1e-15);
    EXPECT_EQ(contact.in_contact, 1u);
}

TEST(Render, ExtrapolatesPlanesForOneAndAHalfSteps) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.step_ns = 10'000'000;
    frame.proxies[0].planes[0].velocity = 0.1;  // m/s upward
    const auto depth = [&frame](std::int64_t time_ns) {
        return render_once(frame, at(-0.001), time_ns).wrench.force.y / kStiffness;
    };
    EXPECT_NEAR(depth(0), 0.001, 1e-12);
    EXPECT_NEAR(depth(7'000'000), 0.0017, 1e-12);
    EXPECT_NEAR(depth(15'000'000), 0.0025, 1e-12);
    EXPECT_NEAR(depth(80'000'000), 0.0025, 1e-12);
}

TEST(Render, ExtrapolatesPlanesThatWereUnderwayUntilTheNextAreDue) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.step_ns = 2'000'000;
    frame.proxies[0].planes[0].velocity = 0.1;  // m/s upward
    const auto depth = [&frame](std::int64_t time_ns) {
        return render_once(frame, at(-0.001), time_ns).wrench.force.y / kStiffness;
    };
    // Over a network of 20 ms, planes are 20 to 22 ms old when they are rendered.
    frame.publish_time_ns = 20'000'000;
    EXPECT_NEAR(depth(22'000'000), 0.0032, 1e-12);
    EXPECT_NEAR(depth(23'000'000), 0.0033, 1e-12);
    EXPECT_NEAR(depth(80'000'000), 0.0033, 1e-12);
    // Never for more than 50 ms, and never for less than on one machine.
    frame.publish_time_ns = 90'000'000;
    EXPECT_NEAR(depth(95'000'000), 0.006, 1e-12);
    for (const std::int64_t published_ns : {std::int64_t{-5'000'000}, std::numeric_limits<std::int64_t>::min()}) {
        frame.publish_time_ns = published_ns;
        EXPECT_NEAR(depth(80'000'000), 0.0013, 1e-12);
    }
    // Long steps are extrapolated as ever.
    frame.step_ns = 40'000'000;
    frame.publish_time_ns = 30'000'000;
    EXPECT_NEAR(depth(95'000'000), 0.007, 1e-12);
}

TEST(Render, ReportsTheEnergyOfItsSpringsAndThePowerOfMovingSurfaces) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.proxies[0].planes[0].velocity = 0.05;
    frame.proxy_count = 2;  // the second in free space
    const Contact contact = render_once(frame, at(-0.004), 0);
    EXPECT_NEAR(contact.stored, 0.5 * kStiffness * 0.004 * 0.004 / 2.0, 1e-15);
    EXPECT_NEAR(contact.surface_power, 0.05 * kStiffness * 0.004 / 2.0, 1e-15);
    // Beyond the horizon planes stand still and have no power.
    EXPECT_EQ(render_once(frame, at(-0.004), 16'000'000).surface_power, 0.0);
    EXPECT_GT(render_once(frame, at(-0.004), 15'000'000).surface_power, 0.0);
    // A frame that reports the work of its surfaces announces none.
    frame.body_work = 1e-3;
    EXPECT_EQ(render_once(frame, at(-0.004), 15'000'000).surface_power, 0.0);
}

TEST(FrameRenderer, LimitsTheStiffnessAndReportsIt) {
    FrameSettings settings;
    settings.max_stiffness = 600.0;
    const auto renderer = std::make_unique<FrameRenderer>(settings);
    for (const double asked : {500.0, 2000.0, 600.0}) {
        ASSERT_EQ(renderer->accept(floor_frame(0.0, asked, 0), 0), FrameDefect::None);
        FrameRenderer::Result result;
        for (int i = 0; i < 60; ++i) {  // past the ramp
            result = renderer->render(at(-0.002), 0, kTickNs);
        }
        EXPECT_NEAR(result.contact.wrench.force.y, std::min(asked, 600.0) * 0.002, 1e-12);
        EXPECT_EQ(result.stiffness_limited, asked > 600.0);
    }
}

TEST(Render, DoesNotDivideByTheAngleBetweenNearlyParallelPlanes) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.proxies[0].plane_count = 2;
    set_plane(frame.proxies[0].planes[0], {0, 1, 0}, 0.0);
    set_plane(frame.proxies[0].planes[1], glm::normalize(Vec3(1e-9, 1, 0)), 0.0);
    const Contact contact = render_once(frame, at(-0.004));
    // Two planes yield half as much as one: a thousandth of the compliance is the surface's.
    EXPECT_NEAR(contact.wrench.force.y, kStiffness * 0.004 / (1.0 - 0.5 * kSurfaceShare), 1e-6);
    EXPECT_NEAR(contact.wrench.force.x, 0.0, 1e-6);
}

TEST(Render, BalancesASphereBetweenPlanesThatLeaveNoRoom) {
    ContactFrame frame = floor_frame(0.001, kStiffness, 0);
    frame.proxies[0].plane_count = 2;
    set_plane(frame.proxies[0].planes[1], {0, -1, 0}, 0.001);
    EXPECT_NEAR(render_once(frame, at(0.0)).wrench.force.y, 0.0, 1e-9);
    // Off the middle by x, both planes hold it with the stiffness of the coupling: each has half of the surface's
    // share.
    EXPECT_NEAR(render_once(frame, at(0.0002)).wrench.force.y, -kStiffness * 0.0002 / (1.0 - 0.5 * kSurfaceShare),
                1e-9);
}

TEST(Render, DividesForceAndTorqueByTheNumberOfAllParticles) {
    // Four particles on a cross of 2 cm, the one at +x pushed down by the floor: thesis 5.2.2.
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.proxy_count = 4;
    const Vec3 offsets[] = {{0.02, 0, 0}, {-0.02, 0, 0}, {0, 0, 0.02}, {0, 0, -0.02}};
    for (std::size_t i = 0; i < 4; ++i) {
        store(offsets[i], frame.proxies[i].rest_offset);
        frame.proxies[i].plane_count = 1;
        set_plane(frame.proxies[i].planes[0], {0, 1, 0}, 0.0);
    }
    const double tilt = -std::asin(0.1);  // about z: +x goes down by 2 mm, -x up
    const Pose grip{Vec3(0.0), glm::angleAxis(tilt, Vec3(0, 0, 1))};
    const Contact contact = render_once(frame, grip, 0);
    const double force = kStiffness * 0.002;
    EXPECT_EQ(contact.in_contact, 1u);
    EXPECT_NEAR(contact.wrench.force.y, force / 4.0, 1e-9);
    EXPECT_NEAR(contact.wrench.torque.z, 0.02 * std::cos(tilt) * force / 4.0, 1e-9);
    EXPECT_NEAR(contact.wrench.torque.x, 0.0, 1e-12);
    EXPECT_GT(contact.wrench.torque.z, 0.0) << "the torque must rotate the grip back to level";
}

TEST(Render, MakesNoForceWhileClutched) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.flags = HAPTIC_FRAME_CLUTCHED;
    EXPECT_EQ(render_once(frame, at(-0.004), 0).wrench.force, Vec3(0.0));
}

GripMotion at_rest(const Vec3& position, double elapsed_s = 0.0) {
    const Pose grip{position, Quat(1, 0, 0, 0)};
    return {grip, grip, elapsed_s};
}

/// Floor at y = 0 with friction, moving along x.
ContactFrame rough_floor(double velocity = 0.0) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.step_ns = kNanosecondsPerSecond;
    frame.static_friction = 0.8;
    frame.dynamic_friction = 0.5;
    frame.proxies[0].surface_velocity[0] = velocity;
    return frame;
}

TEST(Render, HoldsTheGripByFrictionWithoutReducingTheNormalForce) {
    const ContactFrame frame = rough_floor();
    haptic::test::LoadedTool tool;
    tool.load(frame);
    constexpr double kDepth = 0.004;
    const auto push = [&](double x) { return tool.render(kStiffness, at_rest({x, -kDepth, 0.0}), 0); };
    EXPECT_EQ(push(0.0).wrench.force.x, 0.0) << "it sticks where it first touches";
    const Contact stuck = push(0.003);
    EXPECT_NEAR(stuck.wrench.force.x, -kStiffness * 0.003, 1e-12);
    EXPECT_NEAR(stuck.wrench.force.y, kStiffness * kDepth, 1e-12);
    EXPECT_NEAR(stuck.stored, 0.5 * kStiffness * (kDepth * kDepth + 0.003 * 0.003), 1e-15);
    EXPECT_LT(glm::length(stuck.proxy), 1e-12);
    const Contact slides = push(0.01);
    EXPECT_NEAR(slides.wrench.force.x, -0.5 * slides.wrench.force.y, 1e-12);
    EXPECT_NEAR(slides.proxy.x, 0.01 - 0.5 * kDepth, 1e-12);
}

TEST(Render, IsDraggedByAMovingRoughSurfaceAndReportsItsPower) {
    const ContactFrame frame = rough_floor(0.1);
    haptic::test::LoadedTool tool;
    tool.load(frame);
    Contact contact;
    for (int k = 0; k <= 20; ++k) {
        contact = tool.render(kStiffness, at_rest({0.0, -0.004, 0.0}, 1e-3), kTickNs * k);
        ASSERT_NEAR(contact.wrench.force.x, kStiffness * 1e-4 * k, 1e-9) << k;
        ASSERT_NEAR(contact.surface_power, contact.wrench.force.x * 0.1, 1e-9) << k;
        ASSERT_NEAR(contact.displacement, 1e-4, 1e-12) << "relative to the surface, which moves while the hand rests";
    }
}

TEST(Render, HasNoFrictionWithZeroCoefficients) {
    ContactFrame frame = rough_floor(0.1);
    frame.static_friction = frame.dynamic_friction = 0.0;
    haptic::test::LoadedTool tool;
    tool.load(frame);
    for (int k = 0; k < 10; ++k) {
        const Contact contact = tool.render(kStiffness, at_rest({1e-3 * k, -0.004, 0.0}, 1e-3), kTickNs * k);
        ASSERT_EQ(contact.wrench.force.x, 0.0);
        ASSERT_EQ(contact.surface_power, 0.0);
    }
}

class FrameRendererTest : public testing::Test {
  protected:
    void give(ContactFrame frame, std::uint64_t session = 1) {
        frame.session = session;
        frame.sequence = ++sequence;
        ASSERT_EQ(renderer->accept(frame, now_ns), FrameDefect::None);
    }
    FrameRenderer::Result step(double y = -0.004) {
        now_ns += kTickNs;
        last = renderer->render(at(y), now_ns, kTickNs);
        return last;
    }
    /// Steps with a fresh frame of a floor at 0 every 10 ms.
    void feed(int ticks, double stiffness, std::uint64_t session, double largest_step_n) {
        for (int i = 0; i < ticks; ++i) {
            if (i % 10 == 0) {
                give(floor_frame(0.0, stiffness, now_ns), session);
            }
            const double before = last.contact.wrench.force.y;
            ASSERT_LE(std::fabs(step().contact.wrench.force.y - before), largest_step_n) << "tick " << i;
        }
    }

    FrameSettings settings;
    std::unique_ptr<FrameRenderer> renderer = std::make_unique<FrameRenderer>(settings);
    FrameRenderer::Result last;
    std::int64_t now_ns = 5'000'000'000;
    std::uint64_t sequence = 0;
};

TEST_F(FrameRendererTest, MakesNoForceBeforeTheFirstFrame) {
    const FrameRenderer::Result result = step();
    EXPECT_EQ(result.contact.wrench.force, Vec3(0.0));
    EXPECT_EQ(result.frame_sequence, 0u);
    EXPECT_EQ(result.frame_age_ns, -1);
    EXPECT_FALSE(result.stale);
}

TEST_F(FrameRendererTest, BlendsInTheFirstFrames) {
    // 2 N over a ramp of 50 ms, steepest slope 1.5: 0.06 N per tick.
    feed(60, kStiffness, 1, 1.5 * 2.0 / 50.0 + 1e-9);
    EXPECT_NEAR(last.contact.wrench.force.y, 2.0, 1e-9);
}

TEST_F(FrameRendererTest, FadesToExactlyZeroOnceFramesAreStale) {
    feed(101, kStiffness, 1, 1.0);
    for (int i = 0; i < 80; ++i) {
        EXPECT_NEAR(step().contact.wrench.force.y, 2.0, 1e-9);
        EXPECT_FALSE(last.stale);
    }
    double before = 2.0;
    for (int i = 0; i < 130; ++i) {
        const double now = step().contact.wrench.force.y;
        EXPECT_LE(now, before + 1e-12);
        EXPECT_LE(before - now, 1.5 * 2.0 / 100.0 + 1e-9);
        before = now;
    }
    EXPECT_EQ(last.contact.wrench.force, Vec3(0.0));
    EXPECT_TRUE(last.stale);
}

TEST_F(FrameRendererTest, AllowsASlowSimulationThreeOfItsSteps) {
    ContactFrame slow = floor_frame(0.0, kStiffness, now_ns);
    slow.step_ns = 50'000'000;
    give(slow);
    for (int i = 0; i < 150; ++i) {
        EXPECT_FALSE(step().stale);
    }
    EXPECT_TRUE(step().stale);
}

TEST_F(FrameRendererTest, PassesOnTheWorkOfFramesThatWereLost) {
    const auto give_work = [this](double work, std::uint64_t session) {
        ContactFrame frame = floor_frame(0.0, kStiffness, now_ns);
        frame.body_work = work;
        give(frame, session);
    };
    // Nothing is known of the work before the first frame, nor does another session go on with it.
    give_work(0.5, 1);
    EXPECT_TRUE(step().reported);
    EXPECT_EQ(last.body_work, 0.0);
    EXPECT_FALSE(step().reported);
    // Sums: what a frame that never arrived reported is in the next one.
    give_work(0.75, 1);
    give_work(0.25, 1);
    EXPECT_TRUE(step().reported);
    EXPECT_EQ(last.body_work, -0.25);
    EXPECT_EQ(step().body_work, 0.0);
    give_work(0.75, 2);
    EXPECT_EQ(step().body_work, 0.0);
}

TEST_F(FrameRendererTest, BlendsInFramesAfterAFade) {
    feed(100, kStiffness, 1, 1.0);
    for (int i = 0; i < 300; ++i) {
        step();
    }
    feed(60, kStiffness, 2, 1.5 * 2.0 / 50.0 + 1e-9);
    EXPECT_NEAR(last.contact.wrench.force.y, 2.0, 1e-9);
}

TEST_F(FrameRendererTest, BlendsInFramesDuringAFade) {
    feed(100, kStiffness, 1, 1.0);
    while (step().contact.wrench.force.y > 1.0) {
    }
    feed(60, kStiffness, 1, 1.5 * 2.0 / 50.0 + 1e-9);
    EXPECT_NEAR(last.contact.wrench.force.y, 2.0, 1e-9);
}

TEST_F(FrameRendererTest, BlendsFromOneSessionToTheNext) {
    feed(100, kStiffness, 1, 1.0);
    feed(60, 3.0 * kStiffness, 2, 1.5 * 4.0 / 50.0 + 1e-9);
    EXPECT_NEAR(last.contact.wrench.force.y, 6.0, 1e-9);
}

TEST_F(FrameRendererTest, BlendsWhenTheClutchChanges) {
    feed(100, kStiffness, 1, 1.0);
    ContactFrame clutched = floor_frame(0.0, kStiffness, now_ns);
    clutched.flags = HAPTIC_FRAME_CLUTCHED;
    give(clutched);
    for (int i = 0; i < 60; ++i) {
        const double before = last.contact.wrench.force.y;
        EXPECT_LE(before - step().contact.wrench.force.y, 1.5 * 2.0 / 50.0 + 1e-9);
    }
    EXPECT_EQ(last.contact.wrench.force, Vec3(0.0));
}

TEST_F(FrameRendererTest, DistrustsAPublishingTimeInTheFuture) {
    ContactFrame liar = floor_frame(0.0, kStiffness, now_ns);
    liar.publish_time_ns = now_ns + 1'000'000'000'000;
    give(liar);
    for (int i = 0; i < 101; ++i) {
        step();
    }
    EXPECT_TRUE(last.stale);
}

TEST_F(FrameRendererTest, TakesANegativePublishingTimeForAnOldOne) {
    feed(100, kStiffness, 1, 1.0);
    ContactFrame liar = floor_frame(0.0, kStiffness, now_ns);
    liar.publish_time_ns = std::numeric_limits<std::int64_t>::min();
    give(liar);
    for (int i = 0; i < 100; ++i) {
        step();
    }
    EXPECT_TRUE(last.stale);
    EXPECT_EQ(last.frame_age_ns, now_ns);
    EXPECT_EQ(last.contact.wrench.force, Vec3(0.0)) << "faded out within 0.1 s";
}

TEST_F(FrameRendererTest, MakesNoForceFromAFrameThatWasAlreadyStale) {
    const ContactFrame old = floor_frame(0.0, kStiffness, now_ns - 10'000'000'000);
    give(old);
    for (int i = 0; i < 200; ++i) {
        EXPECT_EQ(step().contact.wrench.force, Vec3(0.0));
        EXPECT_TRUE(last.stale);
    }
}

TEST_F(FrameRendererTest, KeepsTheLastGoodFrameWhenOneIsDefective) {
    feed(100, kStiffness, 1, 1.0);
    const std::uint64_t good = last.frame_sequence;
    ContactFrame bad = floor_frame(0.0, kStiffness, now_ns);
    bad.sequence = good + 1;
    bad.proxies[0].planes[0].offset = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(renderer->accept(bad, now_ns), FrameDefect::NonFinite);
    EXPECT_NEAR(step().contact.wrench.force.y, 2.0, 1e-9);
    EXPECT_EQ(last.frame_sequence, good);
}

/// Result of a resting hand on a sheet that moves up and down as sin^2. The simulation knows the motion of each step
/// exactly when the step begins, as host-sim does, so its planes interpolate.
struct SheetRun {
    double max_over = -1.0;  // N, largest excess of a change in a millisecond over the bound
    double max_error = 0.0;  // N, against k times the true depth
    double peak = 0.0;       // N
};

/// Damping with time constant `lead_s` makes the planes lead by lead_s v, with another lead_s in each step.
SheetRun press_with_a_sheet(std::int64_t step_ns, std::int64_t late_ns, double lead_s, double normal_noise) {
    const auto height = [](double t) {
        return kSheetTravel * std::pow(std::sin(std::numbers::pi * t / kSheetPeriod), 2) - 0.005;
    };
    const auto speed = [](double t) {
        return kSheetTravel * std::numbers::pi / kSheetPeriod * std::sin(2.0 * std::numbers::pi * t / kSheetPeriod);
    };
    FrameRenderer renderer{FrameSettings{}};
    SheetRun run;
    ContactFrame frame{};
    double before = 0.0;
    std::int64_t step = -1;
    double random = 0.3;
    for (std::int64_t now = 0; now < 3 * kNanosecondsPerSecond; now += kTickNs) {
        const std::int64_t due = (now - late_ns) / step_ns;
        if (now >= late_ns && due != step) {
            step = due;
            const double t = seconds(step * step_ns);
            const double h = seconds(step_ns);
            const double tau = lead_s * (1.0 + 0.5 * static_cast<double>(step % 3));
            const double begin = height(t) + tau * speed(t);
            const double end = height(t + h) + tau * speed(t + h);
            frame = floor_frame(begin, kStiffness, step * step_ns);
            frame.step_ns = step_ns;
            ContactPlane& plane = frame.proxies[0].planes[0];
            random = 4.0 * random * (1.0 - random);  // logistic map, chaotic in 0..1
            store(glm::normalize(Vec3(normal_noise * (random - 0.5), 1.0, 0.0)), plane.normal);
            plane.velocity = (end - begin) / h;
            frame.publish_time_ns = now;
            frame.sequence = static_cast<std::uint64_t>(step) + 1;
            EXPECT_EQ(renderer.accept(frame, now), FrameDefect::None);
        }
        const FrameRenderer::Result result = renderer.render({}, now, kTickNs);
        const double force = result.contact.wrench.force.y;
        if (now > late_ns + 100'000'000) {  // the first frame, which arrives late_ns after the start, is blended in
            const ContactPlane& plane = frame.proxies[0].planes[0];
            const double bound = 1.5 * kStiffness * std::fabs(plane.velocity) * 1e-3 + 1e-3;
            run.max_over = std::max(run.max_over, std::fabs(force - before) - bound);
            run.max_error =
                std::max(run.max_error, std::fabs(force - kStiffness * std::max(0.0, height(seconds(now)))));
            run.peak = std::max(run.peak, force);
        }
        before = force;
    }
    return run;
}

TEST(FrameRendererOfASheet, FollowsItUpToTheChordErrorWhenFramesArriveInTime) {
    for (const std::int64_t hz : {30, 60, 100}) {
        const std::int64_t step_ns = kNanosecondsPerSecond / hz;
        const SheetRun run = press_with_a_sheet(step_ns, 0, 0.0, 0.0);
        EXPECT_LE(run.max_over, 1e-12) << hz;
        // A chord of a path with acceleration a misses it by a h^2 / 8. The follower lags by at most a frame that
        // arrives up to a tick after its step began: v T.
        const double a = 2.0 * kSheetTravel * std::pow(std::numbers::pi / kSheetPeriod, 2);
        const double h = seconds(step_ns);
        const double v = kSheetTravel * std::numbers::pi / kSheetPeriod;
        EXPECT_LE(run.max_error, kStiffness * (a * h * h / 8.0 + v * 1e-3)) << hz;
        EXPECT_GT(run.peak, 0.9 * kStiffness * 0.015) << hz;
    }
}

TEST(FrameRendererOfASheet, BoundsTheRateOfForceForLateAndNoisyFrames) {
    for (const std::int64_t hz : {30, 60, 100}) {
        for (const double late : {0.0, 0.3, 0.9, 2.4}) {
            for (const double lead_s : {0.0, 0.016}) {
                const std::int64_t step_ns = kNanosecondsPerSecond / hz;
                const auto late_ns = static_cast<std::int64_t>(late * static_cast<double>(step_ns));
                const SheetRun run = press_with_a_sheet(step_ns, late_ns, lead_s, 0.2);
                EXPECT_LE(run.max_over, 1e-12) << hz << " steps/s, " << late << " steps late, " << lead_s;
                EXPECT_GT(run.peak, 0.5 * kStiffness * 0.015) << hz << ' ' << late << ' ' << lead_s;
            }
        }
    }
}

TEST_F(FrameRendererTest, KeepsFrictionFromFrameToFrameAndDropsItWithTheSession) {
    const auto push = [this](double x) {
        now_ns += kTickNs;
        return renderer->render({Vec3(x, -0.004, 0.0), Quat(1, 0, 0, 0)}, now_ns, kTickNs).contact;
    };
    const auto frame = [this] {
        ContactFrame rough = rough_floor();
        rough.plane_time_ns = rough.publish_time_ns = rough.state_time_ns = now_ns;
        rough.step_ns = 10'000'000;
        return rough;
    };
    for (int k = 0; k < 200; ++k) {
        if (k % 10 == 0) {
            give(frame());
        }
        const double x = 1e-5 * std::min(k, 100);
        const Contact contact = push(x);
        if (k > 60) {  // blended in
            ASSERT_NEAR(contact.wrench.force.x, -kStiffness * x, 1e-9) << k;
        }
    }
    give(frame(), 2);
    EXPECT_NEAR(push(0.001).proxy.x, 0.001, 1e-12) << "another simulation: it sticks at the present position";
}

TEST_F(FrameRendererTest, BoundsTheRateOfALeadByTheSurfacesSpeed) {
    // A resting floor starts to rise at 0.2 m/s, damped with tau = 20 ms: it leads by 4 mm, 2 N more. The spring adds
    // 0.1 N per tick, and the lead may add half of that and 1 mN.
    feed(101, kStiffness, 1, 1.0);
    const double before = last.contact.wrench.force.y;
    ContactFrame frame = floor_frame(0.02 * 0.2, kStiffness, now_ns);
    frame.proxies[0].planes[0].velocity = 0.2;
    give(frame, 1);
    for (int i = 1; i <= 10; ++i) {
        step();
        ASSERT_NEAR(last.contact.wrench.force.y, before + i * (1.5 * kStiffness * 0.2e-3 + 1e-3), 1e-9) << i;
    }
}

TEST_F(FrameRendererTest, FollowsAHandThatLeavesWithoutLagAndWithoutPulling) {
    feed(101, kStiffness, 1, 1.0);
    for (int i = 0; i < 40; ++i) {  // 0.2 m/s upward
        const double force = step(-0.004 + 0.0002 * i).contact.wrench.force.y;
        EXPECT_NEAR(force, kStiffness * std::max(0.0, 0.004 - 0.0002 * i), 1e-9);
    }
}

TEST_F(FrameRendererTest, EndsTheForceOfAVanishedSurfaceWithinTheRamp) {
    feed(101, kStiffness, 1, 1.0);
    ContactFrame gone = floor_frame(0.0, kStiffness, now_ns);
    gone.proxies[0].plane_count = 0;
    give(gone, 1);
    for (int i = 0; i < 50; ++i) {
        const double before = last.contact.wrench.force.y;
        EXPECT_NEAR(before - step().contact.wrench.force.y, 2.0 / 50.0, 1e-9);
    }
    EXPECT_NEAR(last.contact.wrench.force.y, 0.0, 1e-12);
    EXPECT_EQ(step().contact.wrench.force, Vec3(0.0));
}

TEST_F(FrameRendererTest, RendersAJumpingFloorSlowlyToARestingHand) {
    feed(101, kStiffness, 1, 1.0);
    const double before = last.contact.wrench.force.y;
    give(floor_frame(0.002, kStiffness, now_ns), 1);
    for (int i = 1; i <= 20; ++i) {
        ASSERT_NEAR(step().contact.wrench.force.y, before + 1e-3 * i, 1e-9);
    }
    // Faster once the hand moves: 1.5 k times its displacement, including the spring itself.
    const double rest = last.contact.wrench.force.y;
    EXPECT_NEAR(step(-0.0041).contact.wrench.force.y, rest + 1.5 * kStiffness * 1e-4 + 1e-3, 1e-9);
}

TEST_F(FrameRendererTest, InterpolatesAChangedStiffnessOverAStep) {
    feed(101, kStiffness, 1, 1.0);
    give(floor_frame(0.0, 2.0 * kStiffness, now_ns), 1);
    double before = last.contact.wrench.force.y;
    for (int i = 1; i <= 10; ++i) {
        const double now = step().contact.wrench.force.y;
        EXPECT_NEAR(now - before, 0.2, 1e-9);  // 2 N more in 10 ms
        before = now;
    }
    EXPECT_NEAR(step().contact.wrench.force.y, 4.0, 1e-9);
}

TEST_F(FrameRendererTest, RecoversFromAForceThatOverflows) {
    feed(100, std::numeric_limits<double>::max(), 1, std::numeric_limits<double>::infinity());
    for (int i = 0; i < 5; ++i) {
        ContactFrame frame = floor_frame(0.0, std::numeric_limits<double>::max(), now_ns);
        frame.stiffness = std::numeric_limits<double>::max();
        frame.proxies[0].planes[0].offset = 10.0;
        give(frame);
        step();
    }
    EXPECT_TRUE(std::isfinite(last.contact.wrench.force.y));
    // Frames of another session blend from the last wrench, which must not carry the overflow over.
    for (int i = 0; i < 100; ++i) {
        give(floor_frame(0.0, kStiffness, now_ns), 2);
        step();
    }
    EXPECT_NEAR(last.contact.wrench.force.y, 2.0, 1e-9);
}

}  // namespace
}  // namespace haptic::rt
