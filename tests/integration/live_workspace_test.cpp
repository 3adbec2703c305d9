// The clutch and a change of the workspace while a cloth lies on the hand: the whole chain, no jump of the force.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "lockstep.hpp"

namespace haptic::test {
namespace {

constexpr int kPeakStep = 158;  // step of the greatest force
constexpr int kSteps = 230;
constexpr double kSlew = 0.04;  // N/ms; 2.4 N fading in 0.1 s give 0.024

class LiveWorkspace : public testing::Test {
  protected:
    template <class BeforeStep>
    void run(BeforeStep&& before_step) {
        for (int step = 0; step < kSteps; ++step) {
            before_step(step);
            const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
                const Vec3 now = tick.rendered.force;
                if (step >= kPeakStep) {
                    slew = std::max(slew, glm::length(now - force));
                    min_force = std::min(min_force, glm::length(now));
                    after = min_force == 0.0 ? std::max(after, glm::length(now)) : after;
                } else {
                    peak = std::max(peak, glm::length(now));
                }
                force = now;
            });
            ASSERT_FALSE(result.crossed) << "step " << step;
        }
        EXPECT_EQ(chain.tick().faults(), 0u);
        EXPECT_GT(peak, 1.0) << "N: no force that could jump";
        EXPECT_EQ(min_force, 0.0) << "N: never uncoupled";
        EXPECT_GT(after, 0.05) << "N: never coupled again";
        EXPECT_LE(slew, kSlew) << "N/ms";
        std::printf("from %.2f N to 0 and up to %.2f N again: %.1f mN/ms at most\n", peak, after, 1e3 * slew);
    }

    Lockstep chain{
        {.scene = sim::read_scene(sim::open_scene("cloth-drop"), "cloth-drop"), .hand = PoseTrack(), .tick = {}}};
    Vec3 force{0.0};
    double peak = 0.0;       // N, maximum before the change
    double min_force = 1e9;  // N, minimum since
    double after = 0.0;      // N, maximum after it was zero
    double slew = 0.0;       // N/ms, maximum
};

TEST_F(LiveWorkspace, ClutchNeverMakesTheForceJump) {
    run([&](int step) {
        if (step == kPeakStep || step == kPeakStep + 20) {
            chain.board().device().set_buttons(step == kPeakStep ? 1 : 0);
        }
    });
}

TEST_F(LiveWorkspace, ChangeOfScalesAndRotationNeverMakesTheForceJump) {
    sim::WorkspaceSettings next = chain.simulation().scene().workspace;
    next.scale = 0.05;
    next.force_scale = 0.4;
    next.rotation = glm::angleAxis(1.0, glm::normalize(Vec3(1, 2, 0)));
    run([&](int step) {
        if (step == kPeakStep) {
            chain.simulation().change_workspace(next);
        }
    });
    const sim::Workspace& now = chain.simulation().workspace();
    EXPECT_EQ(now.settings().scale, next.scale);
    EXPECT_NEAR(chain.simulation().frame().stiffness,
                next.force_scale * chain.simulation().scene().coupling.stiffness / next.scale, 1e-12);
}

TEST_F(LiveWorkspace, ChangeOfTheOffsetMovesTheHandWithoutAJumpOfTheForce) {
    sim::WorkspaceSettings next = chain.simulation().scene().workspace;
    // The hand, still at the device's origin, is mapped 0.2 m higher, to the other side of the cloth. The tool cannot
    // follow: the cloth stops it, and the force starts at zero.
    next.offset = Vec3(0.0, -0.2 * next.scale, 0.0);
    run([&](int step) {
        if (step == kPeakStep) {
            chain.simulation().change_workspace(next);
        }
    });
}

}  // namespace
}  // namespace haptic::test
