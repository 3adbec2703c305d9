#include "haptic/rt/renderer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <numbers>

#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;

constexpr std::int64_t kTickNs = 1'000'000;
constexpr double kStiffness = 500.0;  // N/m

Pose at(double y) {
    return {Vec3(0.001, y, -0.002), Quat(1, 0, 0, 0)};
}

void set_plane(ContactPlane& plane, const Vec3& normal, double offset, double velocity = 0.0) {
    store(normal, plane.normal);
    plane.offset = offset;
    plane.velocity = velocity;
}

TEST(Render, MakesNoForceAtAllInFreeMotion) {
    ContactFrame frame = floor_frame(-0.01, kStiffness, 0);
    frame.damping = 20.0;
    frame.rotational_damping = 1.0;
    const Twist fast{{0.5, -0.5, 0.5}, {3.0, 2.0, 1.0}};
    const Contact contact = render(frame, at(0.0), fast, 0);
    EXPECT_EQ(contact.wrench.force, Vec3(0.0));
    EXPECT_EQ(contact.wrench.torque, Vec3(0.0));
    EXPECT_EQ(contact.proxy, at(0.0).position);
    EXPECT_EQ(contact.in_contact, 0u);
}

TEST(Render, IsASpringFromTheDeviceToTheProxyOfOneSphere) {
    const Contact contact = render(floor_frame(0.0, kStiffness, 0), at(-0.004), {}, 0);
    EXPECT_NEAR(contact.wrench.force.y, kStiffness * 0.004, 1e-12);
    EXPECT_EQ(contact.wrench.force.x, 0.0);
    EXPECT_EQ(contact.wrench.torque, Vec3(0.0));
    EXPECT_LT(glm::length(contact.proxy - Vec3(0.001, 0.0, -0.002)), 1e-15);
    EXPECT_EQ(contact.in_contact, 1u);
}

TEST(Render, MovesPlanesOnForOneAndAHalfStepsAndNoLonger) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.step_ns = 10'000'000;
    frame.proxies[0].planes[0].velocity = 0.1;  // m/s upward
    const auto depth = [&frame](std::int64_t time_ns) {
        return render(frame, at(-0.001), {}, time_ns).wrench.force.y / kStiffness;
    };
    EXPECT_NEAR(depth(0), 0.001, 1e-12);
    EXPECT_NEAR(depth(7'000'000), 0.0017, 1e-12);
    EXPECT_NEAR(depth(15'000'000), 0.0025, 1e-12);
    EXPECT_NEAR(depth(80'000'000), 0.0025, 1e-12);
}

TEST(Render, TellsTheEnergyOfItsSpringsAndThePowerOfMovingSurfaces) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.proxies[0].planes[0].velocity = 0.05;
    frame.proxy_count = 2;  // the second in free space
    const Contact contact = render(frame, at(-0.004), {}, 0);
    EXPECT_NEAR(contact.stored, 0.5 * kStiffness * 0.004 * 0.004 / 2.0, 1e-15);
    EXPECT_NEAR(contact.surface_power, 0.05 * kStiffness * 0.004 / 2.0, 1e-15);
    // Beyond the horizon planes stand, and bring nothing.
    EXPECT_EQ(render(frame, at(-0.004), {}, 16'000'000).surface_power, 0.0);
    EXPECT_GT(render(frame, at(-0.004), {}, 15'000'000).surface_power, 0.0);
}

TEST(FrameRenderer, RendersNoMoreThanTheLargestStiffnessAndSaysSo) {
    FrameSettings settings;
    settings.largest_stiffness = 600.0;
    const auto renderer = std::make_unique<FrameRenderer>(settings);
    for (const double asked : {500.0, 2000.0, 600.0}) {
        renderer->inbox() = floor_frame(0.0, asked, 0);
        ASSERT_EQ(renderer->accept(0), FrameDefect::None);
        FrameRenderer::Result result;
        for (int i = 0; i < 60; ++i) {  // past the ramp
            result = renderer->render(at(-0.002), {}, 0, kTickNs);
        }
        EXPECT_NEAR(result.contact.wrench.force.y, std::min(asked, 600.0) * 0.002, 1e-12);
        EXPECT_EQ(result.stiffness_limited, asked > 600.0);
    }
}

TEST(Render, DampsTheMotionOfTheGripRelativeToTheSurface) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.damping = 10.0;  // N*s/m
    frame.proxies[0].planes[0].velocity = 0.05;
    // Into the surface at 0.1 m/s, which itself rises at 0.05: closing at 0.15 m/s. Sliding is not damped.
    const Contact contact = render(frame, at(-0.004), {{0.3, -0.1, 0.0}, {}}, 0);
    EXPECT_NEAR(contact.wrench.force.y, kStiffness * 0.004 + 10.0 * 0.15, 1e-12);
    EXPECT_NEAR(contact.wrench.force.x, 0.0, 1e-15);
}

TEST(Render, NeverPullsIntoASurfaceThatTheGripLeaves) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.damping = 100.0;
    const Contact contact = render(frame, at(-0.001), {{0.0, 2.0, 0.0}, {}}, 0);
    EXPECT_EQ(contact.wrench.force, Vec3(0.0));
    EXPECT_EQ(contact.in_contact, 1u);
}

TEST(Render, TakesTheSpeedOfTheEdgeBetweenTwoMovingPlanes) {
    // A right-angled groove whose walls close in at 0.03 and 0.04 m/s: the edge moves at (0.03, 0.04, 0).
    ContactFrame frame = floor_frame(0.0, 1000.0, 0);
    frame.damping = 10.0;
    frame.proxies[0].plane_count = 2;
    set_plane(frame.proxies[0].planes[0], {1, 0, 0}, 0.0, 0.03);
    set_plane(frame.proxies[0].planes[1], {0, 1, 0}, 0.0, 0.04);
    const Vec3 inside(-0.002, -0.001, 0.0);
    const Contact contact = render(frame, {inside, Quat(1, 0, 0, 0)}, {}, 0);
    const Vec3 n = glm::normalize(-inside);
    const double expected = 1000.0 * glm::length(inside) + 10.0 * glm::dot(Vec3(0.03, 0.04, 0.0), n);
    EXPECT_LT(glm::length(contact.wrench.force - expected * n), 1e-9);
}

TEST(Render, DoesNotDivideByTheAngleBetweenNearlyParallelPlanes) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.damping = 10.0;
    frame.proxies[0].plane_count = 2;
    set_plane(frame.proxies[0].planes[0], {0, 1, 0}, 0.0, 0.1);
    set_plane(frame.proxies[0].planes[1], glm::normalize(Vec3(1e-9, 1, 0)), 0.0, 0.1);
    const Contact contact = render(frame, at(-0.004), {}, 0);
    EXPECT_NEAR(contact.wrench.force.y, kStiffness * 0.004 + 10.0 * 0.1, 1e-3);
    EXPECT_NEAR(contact.wrench.force.x, 0.0, 1e-3);
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
    const Contact contact = render(frame, grip, {}, 0);
    const double force = kStiffness * 0.002;
    EXPECT_EQ(contact.in_contact, 1u);
    EXPECT_NEAR(contact.wrench.force.y, force / 4.0, 1e-9);
    EXPECT_NEAR(contact.wrench.torque.z, 0.02 * std::cos(tilt) * force / 4.0, 1e-9);
    EXPECT_NEAR(contact.wrench.torque.x, 0.0, 1e-12);
    EXPECT_GT(contact.wrench.torque.z, 0.0) << "the torque must turn the grip level again";
}

TEST(Render, DampsRotationByTheShareOfParticlesInContact) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.rotational_damping = 0.01;
    frame.proxy_count = 2;  // the second has no planes
    const Contact contact = render(frame, at(-0.001), {{}, {0.0, 4.0, 0.0}}, 0);
    EXPECT_NEAR(contact.wrench.torque.y, -0.01 * 4.0 / 2.0, 1e-12);
}

TEST(Render, MakesNoForceWhileClutched) {
    ContactFrame frame = floor_frame(0.0, kStiffness, 0);
    frame.flags = HAPTIC_FRAME_CLUTCHED;
    EXPECT_EQ(render(frame, at(-0.004), {}, 0).wrench.force, Vec3(0.0));
}

class FrameRendererTest : public testing::Test {
  protected:
    void give(ContactFrame frame, std::uint64_t session = 1) {
        frame.session = session;
        frame.sequence = ++sequence;
        renderer->inbox() = frame;
        ASSERT_EQ(renderer->accept(now_ns), FrameDefect::None);
    }
    FrameRenderer::Result step(double y = -0.004) {
        now_ns += kTickNs;
        last = renderer->render(at(y), {}, now_ns, kTickNs);
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

TEST_F(FrameRendererTest, TakesUpTheFirstFramesWithoutAStep) {
    // 2 N over a ramp of 50 ms, steepest slope 1.5: 0.06 N a tick.
    feed(60, kStiffness, 1, 1.5 * 2.0 / 50.0 + 1e-9);
    EXPECT_NEAR(last.contact.wrench.force.y, 2.0, 1e-9);
}

TEST_F(FrameRendererTest, FadesToExactlyZeroWhenFramesStopAndNotBefore) {
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

TEST_F(FrameRendererTest, GivesASlowSimulationThreeOfItsSteps) {
    ContactFrame slow = floor_frame(0.0, kStiffness, now_ns);
    slow.step_ns = 50'000'000;
    give(slow);
    for (int i = 0; i < 150; ++i) {
        EXPECT_FALSE(step().stale);
    }
    EXPECT_TRUE(step().stale);
}

TEST_F(FrameRendererTest, TakesUpFramesAgainWithoutAStepAfterAFade) {
    feed(100, kStiffness, 1, 1.0);
    for (int i = 0; i < 300; ++i) {
        step();
    }
    feed(60, kStiffness, 2, 1.5 * 2.0 / 50.0 + 1e-9);
    EXPECT_NEAR(last.contact.wrench.force.y, 2.0, 1e-9);
}

TEST_F(FrameRendererTest, TakesUpFramesAgainWithoutAStepInTheMidstOfAFade) {
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

TEST_F(FrameRendererTest, WorksTheClutchWithoutAStep) {
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

TEST_F(FrameRendererTest, DoesNotBelieveATimeOfPublishingInTheFuture) {
    ContactFrame liar = floor_frame(0.0, kStiffness, now_ns);
    liar.publish_time_ns = now_ns + 1'000'000'000'000;
    give(liar);
    for (int i = 0; i < 101; ++i) {
        step();
    }
    EXPECT_TRUE(last.stale);
}

TEST_F(FrameRendererTest, MakesNoForceOfAFrameThatWasOldWhenItWasFound) {
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
    renderer->inbox() = bad;
    EXPECT_EQ(renderer->accept(now_ns), FrameDefect::NonFinite);
    EXPECT_NEAR(step().contact.wrench.force.y, 2.0, 1e-9);
    EXPECT_EQ(last.frame_sequence, good);
}

TEST_F(FrameRendererTest, SurfaceSpeedThatStepsFromFrameToFrameIsFeltWithoutAStep) {
    // A floor that stands, then comes up at 0.2 m/s against a damping of 10 N*s/m: 2 N more, followed with a time
    // constant of 5 ms, that is by no more than 1/6 of it in a tick; the spring adds 0.1 N a tick of travel.
    feed(101, kStiffness, 1, 1.0);
    const double before = last.contact.wrench.force.y;
    ContactFrame frame = floor_frame(0.0, kStiffness, now_ns);
    frame.damping = 10.0;
    frame.proxies[0].planes[0].velocity = 0.2;
    give(frame, 1);
    double previous = before;
    for (int i = 0; i < 10; ++i) {
        const double now = step().contact.wrench.force.y;
        EXPECT_GT(now, previous);
        EXPECT_LE(now - previous, 2.0 / 6.0 + kStiffness * 0.2e-3 + 1e-9);
        previous = now;
    }
    EXPECT_GT(previous - kStiffness * (0.004 + 0.2 * 0.010), 2.0 * 0.8) << "N: most of it within a simulation step";
}

TEST_F(FrameRendererTest, ForgetsTheSurfacesPushWhenTheContactIsLost) {
    feed(101, kStiffness, 1, 1.0);
    ContactFrame frame = floor_frame(0.0, kStiffness, now_ns);
    frame.damping = 10.0;
    frame.proxies[0].planes[0].velocity = 0.2;
    give(frame, 1);
    for (int i = 0; i < 10; ++i) {
        step();
    }
    EXPECT_EQ(step(0.05).contact.wrench.force, Vec3(0.0));
    frame = floor_frame(0.0, kStiffness, now_ns);
    frame.damping = 10.0;
    give(frame, 1);
    EXPECT_NEAR(step(-1e-6).contact.wrench.force.y, kStiffness * 1e-6, 1e-9);
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
    // Frames of another session blend from what was felt; that must not poison them.
    for (int i = 0; i < 100; ++i) {
        give(floor_frame(0.0, kStiffness, now_ns), 2);
        step();
    }
    EXPECT_NEAR(last.contact.wrench.force.y, 2.0, 1e-9);
}

}  // namespace
}  // namespace haptic::rt
