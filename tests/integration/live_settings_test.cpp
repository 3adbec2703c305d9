// Settings change while a cloth lies on the hand: the whole chain, no jump of the force.
#include "haptic/sim/live_settings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <glm/geometric.hpp>
#include <string>

#include "lockstep.hpp"

namespace haptic::test {
namespace {

constexpr int kCaught = 158;  // step at which the cloth presses most
constexpr int kSteps = 200;
// N/ms, that the force may change by within a millisecond: twice the 0.016 of 1.6 N that fade in 0.1 s, which a
// stiffness twice as large adds to what the cloth does by itself, 0.008. With fewer iterations or shorter steps it does
// more.
constexpr double kSlew = 0.035;

struct Felt {
    double slew = 0.0;   // N/ms, most, from the change on
    double first = 0.0;  // N, then
};

template <class Change>
Felt feel(Change&& change) {
    Lockstep chain(
        {.scene = sim::read_scene(sim::open_scene("cloth-drop"), "cloth-drop"), .hand = PoseTrack(), .tick = {}});
    Felt felt;
    Vec3 force(0.0);
    for (int step = 0; step < kSteps; ++step) {
        if (step == kCaught) {
            felt.first = glm::length(force);
            sim::LiveSettings settings = chain.simulation().settings();
            change(settings);
            chain.simulation().change_settings(settings);
        }
        const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            if (step >= kCaught) {
                felt.slew = std::max(felt.slew, glm::length(tick.rendered.force - force));
            }
            force = tick.rendered.force;
        });
        EXPECT_FALSE(result.crossed) << "step " << step;
    }
    EXPECT_EQ(chain.tick().faults(), 0u);
    return felt;
}

TEST(LiveSettingsAtTheHand, NoChangeMakesTheForceJump) {
    const Felt as_it_is = feel([](sim::LiveSettings&) {});
    ASSERT_GT(as_it_is.first, 1.0) << "N: without a force there is nothing that could jump";
    std::printf("unchanged, from %.2f N: %.1f mN/ms at most\n", as_it_is.first, 1e3 * as_it_is.slew);
    const auto expect_smooth = [&](const char* what, const Felt& felt) {
        std::printf("%s: %.1f mN/ms at most\n", what, 1e3 * felt.slew);
        EXPECT_LE(felt.slew, kSlew) << what << ": N/ms";
        EXPECT_EQ(felt.first, as_it_is.first) << what;
    };
    expect_smooth("twice the stiffness", feel([](sim::LiveSettings& s) { s.stiffness *= 2.0; }));
    expect_smooth("half the stiffness", feel([](sim::LiveSettings& s) { s.stiffness *= 0.5; }));
    expect_smooth("twice the radius", feel([](sim::LiveSettings& s) { s.radius *= 2.0; }));
    expect_smooth("less shrink", feel([](sim::LiveSettings& s) { s.shrink = 0.9; }));
    expect_smooth("with friction", feel([](sim::LiveSettings& s) { s.static_friction = s.dynamic_friction = 0.5; }));
    expect_smooth("half the iterations", feel([](sim::LiveSettings& s) { s.iterations = 4; }));
    expect_smooth("twice the rate", feel([](sim::LiveSettings& s) { s.step = 0.005; }));
    expect_smooth("the thesis' methods", feel([](sim::LiveSettings& s) {
                      s.method = sim::CcdMethod::Thesis;
                      s.pop_out = sim::PopOutMethod::Thesis;
                  }));
}

}  // namespace
}  // namespace haptic::test
