#include "tick/tick.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <memory>
#include <numeric>
#include <vector>

#include "tick_rig.hpp"
#include "units.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::kDacCodeN;
using test::TickRig;

constexpr double kMillimetre = 1e-3;

/// The hand holds still while the loop arms, then moves by `to` in 0.3 s and stays there.
PoseTrack hand_to(const Vec3& to) {
    return PoseTrack({0.0, 1.0, 1.3, 10.0}, {Pose{}, Pose{}, Pose{to, Quat(1, 0, 0, 0)}, Pose{to, Quat(1, 0, 0, 0)}});
}

double sum(const StringArray& values) {
    return std::accumulate(values.begin(), values.end(), 0.0);
}

TEST(Tick, CarriesNoTensionUntilItIsArmed) {
    TickRig rig;
    rig.steps(50);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(sum(rig.board.device().tensions()), 0.0);
}

TEST(Tick, RunsAtMinimumTensionAfterArming) {
    TickRig rig;
    rig.run_up();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
    for (const double tension : rig.board.device().tensions()) {
        // DAC codes are truncated.
        EXPECT_GE(tension, rig.settings.geometry.minimum_tension - kDacCodeN);
    }
    EXPECT_LT(glm::length(rig.board.device().wrench().force), 0.05);
}

TEST(Tick, FollowsTheHandWithinEncoderQuantisation) {
    const Vec3 to(0.012, -0.02, 0.015);
    TickRig rig(hand_to(to));
    rig.run_up();
    rig.steps(1200);
    EXPECT_LT(glm::length(rig.tick.last().pose.position - to), 0.05 * kMillimetre);
    DeviceState state{};
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_LT(glm::length(to_vec3(state.position) - to), 0.05 * kMillimetre);
    EXPECT_EQ(state.safety_state, HAPTIC_RUNNING);
}

TEST(Tick, MakesTheSpringForceOfAFloorAtTheBoard) {
    // 5 mm into a floor of 400 N/m: 2 N upward.
    TickRig rig(hand_to({0.0, -0.02, 0.0}));
    rig.run_up();
    for (int i = 0; i < 1500; ++i) {
        if (i % 10 == 0) {
            rig.publish(floor_frame(-0.015, 400.0, rig.now_ns));
        }
        rig.step();
    }
    EXPECT_NEAR(rig.tick.last().rendered.force.y, 2.0, 0.02);
    // Eight strings, each short of its tension by less than a DAC code.
    EXPECT_LT(glm::length(rig.board.device().wrench().force - Vec3(0.0, 2.0, 0.0)), 8 * kDacCodeN);
    EXPECT_LT(glm::length(rig.board.device().wrench().force - rig.tick.last().made.force), 1e-3);
    EXPECT_EQ(rig.tick.instruments().frames_received, 150u);
}

TEST(Tick, ReportsTheTensionsAndTheWrenchOfTheBoard) {
    TickRig rig(hand_to({0.0, -0.02, 0.01}));
    rig.run_up();
    for (int i = 0; i < 1000; ++i) {
        rig.publish(floor_frame(-0.01, 300.0, rig.now_ns));
        rig.step();
        DeviceState state{};
        ASSERT_TRUE(rig.states_in.read_newest(state));
        for (std::size_t k = 0; k < kStrings; ++k) {
            ASSERT_EQ(state.tension[k], rig.board.device().tensions()[k]);
        }
        // The board's pose and the solved one differ by an encoder count.
        ASSERT_LT(glm::length(to_vec3(state.force) - rig.board.device().wrench().force), 5e-3);
        ASSERT_LT(glm::length(to_vec3(state.torque) - rig.board.device().wrench().torque), 1e-4);
    }
}

TEST(Tick, ReportsWhatItRendersOfTheFrame) {
    // Free, then 5 mm into a floor that asks for more than the limit; then the frames stop, and the force fades out.
    TickSettings settings;
    settings.frames.max_stiffness = 250.0;
    TickRig rig(hand_to({0.0, -0.02, 0.0}), settings);
    DeviceState state{};
    rig.step();
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_EQ(state.stiffness, 0.0);
    EXPECT_EQ(state.scale, 0.0);
    rig.run_up();
    for (int i = 0; i < 1500; ++i) {
        if (i % 10 == 0) {
            rig.publish(floor_frame(-0.015, 400.0, rig.now_ns));
        }
        rig.step();
    }
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_EQ(state.stiffness, 250.0);
    EXPECT_EQ(state.scale, 1.0);
    EXPECT_NE(state.tick_flags & HAPTIC_TICK_STIFFNESS_LIMITED, 0u);
    rig.steps(1000);
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_EQ(state.scale, 0.0);
    EXPECT_EQ(rig.tick.last().rendered.force, Vec3(0.0));
}

// Rounding to DAC codes: at most half a code in each string, 8 x 3.3 mN, and at a moment arm of 22.5 mm.
constexpr double kRoundingN = 8 * 3.3e-3;
constexpr double kRoundingNm = kRoundingN * 0.0225;

TEST(Tick, IntegratesTheWrenchThatTheMotorsHold) {
    TickRig rig(hand_to({0.0, -0.02, 0.01}));
    rig.run_up();
    DeviceState state{};
    ASSERT_TRUE(rig.states_in.read_newest(state));
    const Vec3 impulse = to_vec3(state.impulse);
    const Vec3 angular = to_vec3(state.angular_impulse);
    // The board's own wrench, at the beginning of the next tick's exchange.
    Wrench sum;
    for (int i = 0; i < 1500; ++i) {
        rig.publish(floor_frame(-0.01, 300.0, rig.now_ns));
        const Wrench held = rig.board.device().wrench();
        rig.step();
        sum.force += 0.001 * held.force;
        sum.torque += 0.001 * held.torque;
    }
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_GT(sum.force.y, 0.5);  // N s
    EXPECT_LT(glm::length(to_vec3(state.impulse) - impulse - sum.force), 1.5 * kRoundingN);
    EXPECT_LT(glm::length(to_vec3(state.angular_impulse) - angular - sum.torque), 1.5 * kRoundingNm);
}

TEST(Tick, CountsOfTheWrenchOnlyWhatFramesCauseWhereIdleStringsPull) {
    // 50 mm to the left the minimum tensions do not cancel. The same second without frames and with a floor.
    struct Second {
        Vec3 held{0.0};     // N s, of the board
        Vec3 impulse{0.0};  // N s, of the device state
    };
    const auto run = [](bool with_frames) {
        TickRig rig(hand_to({-0.05, -0.02, 0.0}));
        rig.run_up();
        rig.steps(1500);
        DeviceState state{};
        EXPECT_TRUE(rig.states_in.read_newest(state));
        Second second;
        const Vec3 before = to_vec3(state.impulse);
        for (int i = 0; i < 1000; ++i) {
            if (with_frames) {
                rig.publish(floor_frame(-0.015, 300.0, rig.now_ns));
            }
            second.held += 0.001 * rig.board.device().wrench().force;
            rig.step();
        }
        EXPECT_TRUE(rig.states_in.read_newest(state));
        second.impulse = to_vec3(state.impulse) - before;
        return second;
    };
    const Second idle = run(false);
    const Second pressed = run(true);
    EXPECT_GT(glm::length(idle.held), 0.2) << "N s: the strings do not pull by themselves";
    EXPECT_EQ(idle.impulse, Vec3(0.0));
    EXPECT_GT(glm::length(pressed.held - idle.held), 0.2);
    EXPECT_LT(glm::length(pressed.impulse - (pressed.held - idle.held)), 2.0 * kRoundingN);
}

TEST(Tick, SendsTheMotorsInTheTickThatReadTheEncoders) {
    TickRig rig(PoseTrack({0.0, 0.8, 0.8001, 10.0}, {Pose{}, Pose{}, Pose{{0, -1e-3, 0}, Quat(1, 0, 0, 0)},
                                                     Pose{{0, -1e-3, 0}, Quat(1, 0, 0, 0)}}));
    rig.run_up();
    while (rig.tick.last().pose.position.y > -0.5 * kMillimetre) {
        rig.publish(floor_frame(0.0, 300.0, rig.now_ns));
        rig.step();
    }
    // The first tick that sees the grip below the floor pushes it back; 0.3 N is below the rate limit.
    EXPECT_NEAR(rig.tick.last().rendered.force.y, 0.3, 0.01);
    EXPECT_NEAR(rig.board.device().wrench().force.y, 0.3, 8 * kDacCodeN);
}

TEST(Tick, CollectsTheAnswerToItsMotorsInTheNextTick) {
    TickRig rig;
    rig.run_up();
    rig.step();
    EXPECT_TRUE(rig.board.answer_due()) << "nothing waited for it";
    EXPECT_EQ(rig.tick.last().exchange_collected, 0) << "that of the tick before";
    const auto ok = static_cast<std::size_t>(device::ExchangeStatus::Ok);
    const std::uint64_t before = rig.tick.instruments().exchange_statuses[ok];
    rig.steps(100);
    EXPECT_EQ(rig.tick.instruments().exchange_statuses[ok] - before, 200u);
    // The last exchange of a loop leaves no answer behind.
    rig.tick.send_zero(rig.now_ns);
    EXPECT_FALSE(rig.board.answer_due());
}

TEST(Tick, NoticesALostAnswerToItsMotorsInTheNextTick) {
    TickRig rig;
    rig.run_up();
    rig.steps(100);
    const auto lost = static_cast<std::size_t>(device::ExchangeStatus::Timeout);
    const Instruments before = rig.tick.instruments();
    ASSERT_EQ(before.exchange_statuses[lost], 0u);
    rig.faulty.losing_answers = true;
    rig.step();
    EXPECT_EQ(rig.tick.last().exchange_in, 0);
    EXPECT_EQ(rig.tick.last().exchange_out, 0);
    EXPECT_EQ(rig.tick.last().exchange_collected, static_cast<std::int8_t>(device::ExchangeStatus::Timeout));
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_EXCHANGE_FAILED, 0u);
    EXPECT_EQ(rig.tick.instruments().last_failure, device::ExchangeStatus::Timeout);
    rig.faulty.losing_answers = false;
    rig.step();
    EXPECT_EQ(rig.tick.last().flags & HAPTIC_TICK_EXCHANGE_FAILED, 0u);
    // Four exchanges in two ticks, one of them lost: counted once, and not as good.
    const Instruments& after = rig.tick.instruments();
    const auto ok = static_cast<std::size_t>(device::ExchangeStatus::Ok);
    EXPECT_EQ(after.exchange_statuses[lost], 1u);
    EXPECT_EQ(after.exchange_statuses[ok] - before.exchange_statuses[ok], 3u);
}

TEST(Tick, FaultsIfTheAnswersToItsMotorsAreLostForGood) {
    TickRig rig;
    rig.run_up();
    rig.steps(100);
    rig.faulty.losing_answers = true;
    for (int i = 0; i < 1000 && rig.tick.faults() == 0; ++i) {
        rig.step();
    }
    EXPECT_EQ(rig.tick.faults(), HAPTIC_FAULT_EXCHANGE);
}

TEST(Tick, WithOneExchangeSendsTheMotorsInTheNextTick) {
    TickSettings one;
    one.exchanges = 1;
    TickRig rig(PoseTrack(), one);
    rig.run_up();
    const std::array<double, kStrings> at_rest = rig.board.device().tensions();
    rig.publish(floor_frame(1e-3, 300.0, rig.now_ns));  // 1 mm above the grip
    rig.step();
    ASSERT_GT(rig.tick.last().rendered.force.y, 0.0);
    EXPECT_EQ(rig.board.device().tensions(), at_rest);
    const StringArray sent = rig.tick.last().tensions;
    rig.step();
    EXPECT_EQ(rig.board.device().tensions(), sent);
}

TEST(Tick, CalibratesTheRestLengthsForAnyCounterValues) {
    TickRig rig;
    rig.faulty.added = {65000, 1, 2, 32768, 32767, 9, 10, 40000};
    rig.run_up();
    EXPECT_LT(glm::length(rig.tick.last().pose.position), 1e-9);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
}

TEST(Tick, KeepsThePoseAndContinuesThroughAFewFailedExchanges) {
    TickRig rig(hand_to({0.01, 0.0, 0.0}));
    rig.run_up();
    rig.steps(1000);
    const Vec3 before = rig.tick.last().pose.position;
    rig.faulty.failing = true;
    rig.steps(15);  // the encoders' age stays below its limit of 20 ms
    EXPECT_EQ(rig.tick.last().pose.position, before);
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_EXCHANGE_FAILED, 0u);
    rig.faulty.failing = false;
    rig.steps(100);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
    EXPECT_EQ(rig.tick.last().flags & HAPTIC_TICK_EXCHANGE_FAILED, 0u);
}

/// Presses 5 mm into a floor that keeps being published.
void press(TickRig& rig, int ticks) {
    for (int i = 0; i < ticks; ++i) {
        rig.publish(floor_frame(-0.015, 400.0, rig.now_ns));
        rig.step();
    }
}

TEST(Tick, FadesOutAndDisarmsWhenTheBoardIsGone) {
    TickRig rig(hand_to({0.0, -0.02, 0.0}));
    rig.run_up();
    press(rig, 1500);
    rig.faulty.failing = true;
    press(rig, 21);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    press(rig, 700);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_EXCHANGE));
    DeviceState state{};
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_EQ(state.faults, static_cast<std::uint32_t>(HAPTIC_FAULT_EXCHANGE));
    rig.faulty.failing = false;
    rig.step();
    EXPECT_EQ(sum(rig.board.device().tensions()), 0.0);
}

TEST(Tick, CountsNothingForTheTimeInWhichTheBoardWasGone) {
    for (const int exchanges : {1, 2}) {
        TickSettings settings;
        settings.exchanges = exchanges;
        TickRig rig(hand_to({0.0, -0.02, 0.0}), settings);
        rig.run_up();
        press(rig, 1500);
        rig.faulty.failing = true;
        press(rig, 721);
        ASSERT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
        DeviceState state{};
        ASSERT_TRUE(rig.states_in.read_newest(state));
        const Vec3 impulse = to_vec3(state.impulse);
        ASSERT_GT(impulse.y, 1.0);  // N s
        const double given = rig.tick.budget().given();
        // Back after ten seconds, and the hand is elsewhere.
        rig.faulty.failing = false;
        rig.faulty.added.fill(10);
        rig.now_ns += 10'000'000'000;
        rig.steps(3);
        ASSERT_TRUE(rig.states_in.read_newest(state));
        EXPECT_EQ(to_vec3(state.impulse), impulse) << exchanges << " exchanges";
        EXPECT_EQ(rig.tick.budget().given(), given) << exchanges << " exchanges";
    }
}

TEST(Tick, TakesTheMotorsForAsWarmAsTheyMayBeWhileTheBoardDoesNotAnswer) {
    for (const int exchanges : {1, 2}) {
        TickSettings settings;
        settings.exchanges = exchanges;
        TickRig rig(hand_to({0.0, -0.02, 0.0}), settings);
        rig.run_up();
        press(rig, 1500);
        const double load = sum(rig.tick.instruments().peak_motor_load);
        rig.faulty.failing = true;
        press(rig, 721);
        ASSERT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
        // The board may still hold the tensions of the contact: the motors warm up.
        const double lost = sum(rig.tick.instruments().peak_motor_load);
        rig.steps(5000);
        EXPECT_GT(sum(rig.tick.instruments().peak_motor_load), lost + (lost - load)) << exchanges << " exchanges";
    }
}

TEST(Tick, FadesSmoothlyAtTheBoardWhenAnEncoderJumps) {
    TickRig rig(hand_to({0.0, -0.02, 0.0}));
    rig.run_up();
    press(rig, 1500);
    const double full = rig.board.device().wrench().force.y;
    ASSERT_GT(full, 1.9);
    rig.faulty.added[2] = 3000;  // 5 cm in one tick
    double last = full;
    for (int i = 0; i < 800; ++i) {
        press(rig, 1);
        const double now = rig.board.device().wrench().force.y;
        // 2 N over 100 ms, steepest slope 1.5; truncated DAC codes add a little of either sign.
        EXPECT_LT(std::fabs(now - last), 1.5 * 2.0 / 100.0 + 8 * kDacCodeN) << i;
        last = now;
    }
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(rig.tick.faults() & HAPTIC_FAULT_JUMP, static_cast<std::uint32_t>(HAPTIC_FAULT_JUMP));
    EXPECT_EQ(sum(rig.board.device().tensions()), 0.0);
}

TEST(Tick, FaultsWhenTheLengthsContradictEachOther) {
    TickRig rig;
    rig.run_up();
    // One string drifts by 3 cm, too slowly for a jump.
    for (int i = 0; i < 600 && rig.tick.safety_state() == SafetyState::Running; ++i) {
        rig.faulty.added[4] = static_cast<std::uint16_t>(3 * i);
        rig.step();
    }
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    EXPECT_EQ(rig.tick.faults() & HAPTIC_FAULT_RESIDUAL, static_cast<std::uint32_t>(HAPTIC_FAULT_RESIDUAL));
}

TEST(Tick, FaultsOfASlackStringIdentifyIt) {
    TickRig rig;
    rig.run_up();
    // String 4 counts as it pays out and reads longer and longer.
    for (int i = 0; i < 600 && rig.tick.safety_state() == SafetyState::Running; ++i) {
        rig.faulty.added[4] = static_cast<std::uint16_t>(-3 * i);
        rig.step();
        if (rig.tick.last().residual > rig.settings.safety.residual) {
            EXPECT_NE(rig.tick.last().flags >> HAPTIC_TICK_SUSPECTS_SHIFT & 1U << 4, 0u);
        }
    }
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_SLACK));
    EXPECT_NE(rig.tick.suspect_strings() & 1U << 4, 0u);
    EXPECT_LT(std::popcount(rig.tick.suspect_strings()), 5);
}

TEST(Tick, FlagsAndCountsOverrunsAndFaultsWhenTheyPersist) {
    TickRig rig;
    rig.run_up();
    rig.step(0, 3);
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_OVERRUN, 0u);
    rig.step(rig.settings.period_ns);
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_OVERRUN, 0u);
    rig.step(rig.settings.period_ns / 2);
    EXPECT_EQ(rig.tick.last().flags & HAPTIC_TICK_OVERRUN, 0u);
    EXPECT_EQ(rig.tick.instruments().overruns, 3u);
    for (int i = 0; i < 36; ++i) {
        rig.step(0, 1);
    }
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_OVERRUN));
}

TEST(Tick, StopsWithAFadeToZeroAtTheBoard) {
    TickRig rig(hand_to({0.0, -0.02, 0.0}));
    rig.run_up();
    press(rig, 1500);
    rig.tick.stop();
    int ticks = 0;
    for (; rig.tick.safety_state() != SafetyState::Disarmed && ticks < 2000; ++ticks) {
        press(rig, 1);
    }
    EXPECT_NEAR(ticks, 600, 5);
    EXPECT_EQ(sum(rig.board.device().tensions()), 0.0);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
}

TEST(Tick, CanBeArmedAgainAfterAFault) {
    TickRig rig;
    rig.run_up();
    rig.tick.stop();
    rig.steps(800);
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    rig.run_up();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
    EXPECT_EQ(rig.tick.faults(), 0u);
}

TEST(Tick, RejectsADefectiveFrameAndContinuesWithTheLastGoodOne) {
    TickRig rig(hand_to({0.0, -0.02, 0.0}));
    rig.run_up();
    press(rig, 1500);
    for (int i = 0; i < 50; ++i) {
        ContactFrame bad = floor_frame(-0.015, 400.0, rig.now_ns);
        bad.proxies[0].planes[0].normal[1] = 2.0;
        rig.publish(bad);
        rig.step();
        EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_FRAME_REJECTED, 0u);
        EXPECT_NEAR(rig.tick.last().rendered.force.y, 2.0, 0.02);
    }
    EXPECT_EQ(rig.tick.instruments().frames_rejected, 50u);
}

TEST(Tick, LimitsForceAndRateForAnyFrame) {
    TickSettings settings;
    settings.passivity.control =
        PassivityControl::Observe;  // the controller would not let a jumping floor push this hard
    TickRig rig(PoseTrack(), settings);
    rig.run_up();
    Vec3 last(0.0);
    StringArray last_tensions = rig.tick.last().tensions;
    for (int i = 0; i < 500; ++i) {
        // A very stiff floor a metre above the grip that appears and disappears.
        rig.publish(floor_frame(i / 100 % 2 == 0 ? 1.0 : -1.0, 1e6, rig.now_ns));
        rig.step();
        const Vec3 now = rig.tick.last().rendered.force;
        ASSERT_LE(glm::length(now), rig.settings.limits.force + 1e-9);
        ASSERT_LE(glm::length(now - last), rig.settings.limits.force_rate * 1e-3 + 1e-9);
        last = now;
        for (std::size_t k = 0; k < kStrings; ++k) {
            const double tension = rig.tick.last().tensions[k];
            ASSERT_LE(tension, rig.settings.geometry.maximum_tension);
            ASSERT_LE(std::fabs(tension - last_tensions[k]), rig.settings.tension_rate * 1e-3 + kDacCodeN);
            last_tensions[k] = tension;
        }
    }
    // The peak, with the wrench and the pose of its tick.
    const Instruments& m = rig.tick.instruments();
    EXPECT_EQ(m.peak_force, rig.settings.limits.force);
    EXPECT_EQ(glm::length(m.at_peak_force.wrench.force), m.peak_force);
    EXPECT_LT(glm::length(m.at_peak_force.pose.position - rig.tick.last().pose.position), 1e-3);
    EXPECT_GT(m.force_limited_ticks, 100u);
    EXPECT_GE(m.slew_limited_ticks, 7u);  // 8 N at 1 N a tick, at least once
}

TEST(Tick, DoesNotCatchUpInOneStepAfterALongInterruption) {
    TickRig rig;
    rig.run_up();
    rig.publish(floor_frame(1.0, 1e6, rig.now_ns));
    rig.now_ns += 50'000'000;
    rig.step();
    EXPECT_LE(glm::length(rig.tick.last().rendered.force), rig.settings.limits.force_rate * 2e-3 + 1e-9);
}

TEST(Tick, RendersEveryProxyParticleOfAFullFrame) {
    TickRig rig(hand_to({0.0, -0.02, 0.0}));
    rig.run_up();
    for (int i = 0; i < 1500; ++i) {
        ContactFrame frame = floor_frame(-0.015, 400.0, rig.now_ns);
        frame.proxy_count = kMaxProxies;
        for (std::size_t k = 1; k < kMaxProxies; ++k) {
            frame.proxies[k] = frame.proxies[0];
        }
        rig.publish(frame);
        rig.step();
    }
    EXPECT_EQ(rig.tick.last().in_contact, kMaxProxies);
    EXPECT_NEAR(rig.tick.last().rendered.force.y, 2.0, 0.02);  // the mean of 64 equal springs
}

TEST(Tick, KeepsTheLastTwoSecondsForTheBlackBox) {
    TickRig rig;
    rig.steps(2500);
    const BlackBox& box = rig.tick.black_box();
    ASSERT_EQ(box.size(), 2000u);
    EXPECT_EQ(box.at(1999).now_ns, rig.now_ns - rig.settings.period_ns);
    EXPECT_EQ(box.at(1999).now_ns - box.at(0).now_ns, 1999 * rig.settings.period_ns);
}

TEST(Tick, PushesEachTickToTheRecorder) {
    TickRig rig;
    Recorder recorder(64);
    rig.tick.record_to(&recorder);
    rig.steps(10);
    TickRecord record;
    for (int i = 0; i < 10; ++i) {
        ASSERT_TRUE(recorder.pop(record));
        EXPECT_EQ(record.now_ns, 1'000'000'000 + i * rig.settings.period_ns);
    }
    EXPECT_FALSE(recorder.pop(record));
}

TEST(Tick, IsDeterministicBitForBit) {
    const auto run = [] {
        TickRig rig(hand_to({0.003, -0.02, 0.001}));
        rig.run_up();
        std::vector<TickRecord> records;
        for (int i = 0; i < 1000; ++i) {
            if (i % 7 == 0) {
                rig.publish(floor_frame(-0.015, 400.0, rig.now_ns));
            }
            rig.step();
            records.push_back(rig.tick.last());
        }
        return records;
    };
    const std::vector<TickRecord> first = run();
    const std::vector<TickRecord> second = run();
    for (std::size_t i = 0; i < first.size(); ++i) {
        ASSERT_EQ(first[i].pose.position, second[i].pose.position) << i;
        ASSERT_EQ(first[i].rendered.force, second[i].rendered.force) << i;
        ASSERT_EQ(first[i].tensions, second[i].tensions) << i;
    }
}

TEST(Tick, SendsZeroOnRequestInAnyState) {
    TickRig rig;
    rig.run_up();
    ASSERT_GT(sum(rig.board.device().tensions()), 2.0);
    EXPECT_EQ(rig.tick.send_zero(rig.now_ns), device::ExchangeStatus::Ok);
    EXPECT_EQ(sum(rig.board.device().tensions()), 0.0);
}

TEST(Tick, RejectsInvalidSettings) {
    const auto refuses = [](void (*spoil)(TickSettings&)) {
        TickSettings settings;
        spoil(settings);
        EXPECT_THROW(TickRig rig(PoseTrack(), settings), std::invalid_argument);
    };
    refuses([](TickSettings& s) { s.period_ns = 0; });
    refuses([](TickSettings& s) { s.frames.fade_ns = 0; });
    refuses([](TickSettings& s) { s.limits.force = -1.0; });
    refuses([](TickSettings& s) { s.geometry.maximum_tension = s.geometry.minimum_tension; });
}

TEST(Tick, CommissioningModeRendersAtMostOneNewtonAndSaysSo) {
    TickSettings settings;
    settings.commissioning = true;
    settings.limits.force = 1.0;
    test::TickRig rig(PoseTrack(), settings);
    rig.run_up();
    double largest = 0.0;
    for (int k = 0; k < 500; ++k) {
        rig.publish(floor_frame(0.01, 400.0, rig.now_ns));  // asks for 4 N
        rig.step();
        EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_COMMISSIONING, 0u);
        largest = std::max(largest, glm::length(rig.tick.last().rendered.force));
    }
    EXPECT_LE(largest, 1.0 + 1e-9);
    EXPECT_GT(largest, 0.9);
    EXPECT_GE(rig.tick.instruments().commissioning_ticks, 500u);
}

}  // namespace
}  // namespace haptic::rt
