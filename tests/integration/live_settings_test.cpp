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

constexpr int kCaught = 152;  // step at which the cloth has been caught
constexpr int kFadeMs = 100;  // ms, in which a change of the coupling fades in: the force is watched for so long
// Rate of the rendered force over that of the force that it follows, at most (wrench_follower.hpp).
constexpr double kFollows = 1.5;

struct Felt {
    double slew = 0.0;    // N/ms, greatest rate of the force on the hand
    double pushed = 0.0;  // N/ms, and of the force on the bodies, as the device would exert it
    double first = 0.0;   // N, at the change
};

template <class Change>
Felt feel(Change&& change) {
    Lockstep chain(
        {.scene = sim::read_scene(sim::open_scene("cloth-drop"), "cloth-drop"), .hand = PoseTrack(), .tick = {}});
    Felt felt;
    Vec3 force(0.0);
    Vec3 pushed(0.0);
    int since = 0;  // ms
    for (int step = 0; since < kFadeMs; ++step) {
        if (step == kCaught) {
            felt.first = glm::length(force);
            sim::LiveSettings settings = chain.simulation().settings();
            change(settings);
            chain.simulation().change_settings(settings);
        }
        int ticks = 0;
        const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            if (step >= kCaught) {
                felt.slew = std::max(felt.slew, glm::length(tick.rendered.force - force));
            }
            force = tick.rendered.force;
            ++ticks;
        });
        EXPECT_FALSE(result.crossed) << "step " << step;
        if (step >= kCaught) {
            felt.pushed = std::max(felt.pushed, glm::length(result.hand_force - pushed) / ticks);
            since += ticks;
        }
        pushed = result.hand_force;
    }
    EXPECT_EQ(chain.tick().faults(), 0u);
    return felt;
}

/// N/ms, bound with friction that begins: half more than was found.
constexpr double kGripped = 0.12;

TEST(LiveSettingsAtTheHand, NoChangeMakesTheForceJump) {
    const Felt as_it_is = feel([](sim::LiveSettings&) {});
    ASSERT_GT(as_it_is.first, 1.0) << "N: without a force there is nothing that could jump";
    std::printf("unchanged, from %.2f N: %.1f mN/ms at most\n", as_it_is.first, 1e3 * as_it_is.slew);
    const auto expect_smooth = [&](const char* what, const Felt& felt, double bound) {
        std::printf("%s: %.1f mN/ms at most, bound %.1f\n", what, 1e3 * felt.slew, 1e3 * bound);
        EXPECT_LE(felt.slew, bound) << what << ": N/ms";
        EXPECT_EQ(felt.first, as_it_is.first) << what;
    };
    // Another coupling fades in: to the rate of the cloth's own motion it adds at most the whole force in the fade.
    const double coupling = kFollows * as_it_is.slew + as_it_is.first / kFadeMs;
    expect_smooth("twice the stiffness", feel([](sim::LiveSettings& s) { s.stiffness *= 2.0; }), coupling);
    expect_smooth("half the stiffness", feel([](sim::LiveSettings& s) { s.stiffness *= 0.5; }), coupling);
    expect_smooth("twice the radius", feel([](sim::LiveSettings& s) { s.radius *= 2.0; }), coupling);
    expect_smooth("less shrink", feel([](sim::LiveSettings& s) { s.shrink = 0.9; }), coupling);
    // Friction does not fade: the cloth that slides under the hand is held at once, and its normals turn with it.
    expect_smooth("with friction", feel([](sim::LiveSettings& s) { s.static_friction = s.dynamic_friction = 0.5; }),
                  kGripped);
    expect_smooth("the thesis' methods", feel([](sim::LiveSettings& s) {
                      s.method = sim::CcdMethod::Thesis;
                      s.pop_out = sim::PopOutMethod::Thesis;
                  }),
                  coupling);
    // Neither iterations nor steps change the material of the cloth. The hand feels what pushes the cloth then, and no
    // more.
    const Felt iterations = feel([](sim::LiveSettings& s) { s.iterations = 2; });
    expect_smooth("twice the iterations", iterations, kFollows * iterations.pushed);
    const Felt rate = feel([](sim::LiveSettings& s) { s.step = 0.005; });
    expect_smooth("twice the rate", rate, kFollows * rate.pushed);
}

/// A cloth that lies on the hand, which moves to where it is not while the scene stands.
class StandingScene : public testing::Test {
  protected:
    // N/ms: kFollows times 0.04, the greatest rate of a caught cloth that slips off undisturbed.
    static constexpr double kMaxSlew = 0.06;

    void watch(const rt::TickRecord& tick) {
        const Vec3 now = tick.rendered.force;
        slew = std::max(slew, glm::length(now - force));
        least = std::min(least, glm::length(now));
        force = now;
    }
    void catch_the_cloth() {
        for (int step = 0; step < kCaught; ++step) {
            (void)chain.step(
                [&](const rt::TickRecord& tick, const device::EmulatedBoard&) { force = tick.rendered.force; });
        }
        ASSERT_GT(glm::length(force), 1.0) << "N: without a force there is nothing that could jump";
    }
    void stand() {
        constexpr int kFrames = 60;
        chain.stand(kFrames, [&](const rt::TickRecord& tick, const device::EmulatedBoard&) { watch(tick); });
        EXPECT_EQ(least, 0.0) << "N: the hand was not free";
    }
    void go_on() {
        for (int step = 0; step < 40; ++step) {
            const sim::StepResult result =
                chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) { watch(tick); });
            ASSERT_FALSE(result.crossed) << "step " << step;
            again = std::max(again, glm::length(force));
        }
        EXPECT_EQ(chain.tick().faults(), 0u);
        EXPECT_GT(again, 0.05) << "N: it was never felt again";
        EXPECT_LE(slew, kMaxSlew) << "N/ms";
        std::printf("down to 0 and up to %.2f N again: %.1f mN/ms at most\n", again, 1e3 * slew);
    }

    Lockstep chain{{.scene = sim::read_scene(sim::open_scene("cloth-drop"), "cloth-drop"),
                    .hand = PoseTrack({0.0, 1.6, 1.8, 10.0}, {Pose{}, Pose{}, Pose{Vec3(0.001, -0.002, 0.0), {}},
                                                              Pose{Vec3(0.001, -0.002, 0.0), {}}}),
                    .tick = {}}};
    Vec3 force{0.0};
    double slew = 0.0;   // N/ms, most
    double least = 1e9;  // N
    double again = 0.0;  // N, most once it went on
};

TEST_F(StandingScene, LetsTheHandGoAndTakesItAgainWithoutAJumpOfTheForce) {
    catch_the_cloth();
    stand();
    go_on();
}

TEST_F(StandingScene, SoDoesOneThatRestartsInItsPlace) {
    catch_the_cloth();
    stand();
    Config config = sim::open_scene("cloth-drop");  // just above the hand, and on its way down
    config.set("model.height=0.05");
    config.set("model.velocity=[0.0, -3.0, 0.0]");
    chain.simulation() = sim::Simulation(sim::read_scene(config, "cloth-drop"));
    chain.simulation().set_verification(true);
    chain.simulation().recouple();
    go_on();
}

}  // namespace
}  // namespace haptic::test
