#include "tick/tick_timing.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <numeric>

#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::TickRig;

std::int64_t looks = 0;

/// Clock that advances by a microsecond per call.
std::int64_t stepping_clock() HAPTIC_RT {
    return 1000 * ++looks;
}

/// Tick whose stages take a microsecond each.
struct TimedRig : TickRig {
    explicit TimedRig(const TickSettings& tick_settings = {})
        : TickRig(PoseTrack(), tick_settings), timed(tick_settings, faulty, frames_in, states_out, stepping_clock) {}
    void step() {
        timed.run({now_ns, now_ns, 0});
        now_ns += settings.period_ns;
    }
    Tick timed;
};

TickSettings one_exchange() {
    TickSettings settings;
    settings.exchanges = 1;
    return settings;
}

TEST(TickTiming, StagesAddUpToTheWholeTick) {
    for (const TickSettings& settings : {TickSettings{}, one_exchange()}) {
        TimedRig rig(settings);
        rig.step();
        const auto& stages = rig.timed.timing().stages_ns;
        EXPECT_EQ(std::accumulate(stages.begin(), stages.end(), std::int64_t{0}), rig.timed.last().compute_ns);
        EXPECT_EQ(rig.timed.timing().of(TickStage::Exchange), 2000);
        EXPECT_EQ(rig.timed.timing().of(TickStage::Pose), 1000);
        EXPECT_EQ(rig.timed.timing().of(TickStage::Record), 1000);
    }
}

TEST(TickTiming, OfAForceEndsInTheSameTickWithTwoExchanges) {
    TimedRig rig;
    rig.step();
    // Clock calls: beginning, exchange, pose, proxy, tension, exchange.
    EXPECT_EQ(rig.timed.timing().motion_to_force_ns, 5000);
    // It counts once the board has answered.
    EXPECT_EQ(rig.timed.instruments().motion_to_force.count(), 0U);
    rig.step();
    EXPECT_EQ(rig.timed.instruments().motion_to_force.count(), 1U);
    EXPECT_EQ(rig.timed.instruments().motion_to_force.max_ns(), 5000);
}

TEST(TickTiming, OfAForceEndsInTheNextTickWithOneExchange) {
    TimedRig rig(one_exchange());
    const std::int64_t before = looks;
    rig.step();
    EXPECT_EQ(rig.timed.timing().motion_to_force_ns, -1) << "no earlier latch";
    const std::int64_t looks_of_a_tick = looks - before;
    rig.step();
    // A whole tick, plus the beginning and exchange of the next one.
    EXPECT_EQ(rig.timed.timing().motion_to_force_ns, 1000 * (looks_of_a_tick + 1));
}

TEST(TickTiming, HasNoLatencyForAForceThatDidNotArrive) {
    for (const TickSettings& settings : {TickSettings{}, one_exchange()}) {
        TimedRig rig(settings);
        rig.step();
        rig.step();
        const std::uint64_t before = rig.timed.instruments().motion_to_force.count();
        rig.faulty.failing = true;
        rig.step();
        EXPECT_EQ(rig.timed.timing().motion_to_force_ns, -1);
        rig.faulty.failing = false;
        // With two exchanges the answer to the last command was lost, and that to this one is still due; with one, this
        // sends a force that has no latch.
        rig.step();
        EXPECT_EQ(rig.timed.instruments().motion_to_force.count(), before);
        rig.step();
        EXPECT_EQ(rig.timed.instruments().motion_to_force.count(), before + 1);
    }
}

TEST(TickTiming, MeasuresTheAgeOfTheStateBehindThePlanes) {
    TickRig rig;
    rig.run_up();
    EXPECT_EQ(rig.tick.timing().state_age_ns, -1) << "no frame yet";
    ContactFrame frame = floor_frame(-0.1, 100.0, rig.now_ns);
    frame.state_time_ns = rig.now_ns - 7'000'000;
    rig.publish(frame);
    rig.step();
    EXPECT_EQ(rig.tick.timing().state_age_ns, -1) << "the frame was computed from no state";
    frame.state_sequence = 5;
    rig.publish(frame);
    rig.step();
    EXPECT_EQ(rig.tick.timing().state_age_ns, 8'000'000);
    rig.step();
    EXPECT_EQ(rig.tick.timing().state_age_ns, 9'000'000) << "the planes are used one tick longer";
    EXPECT_EQ(rig.tick.instruments().state_age.count(), 2U);
    rig.steps(500);
    EXPECT_EQ(rig.tick.timing().state_age_ns, -1) << "stale planes are not in use";
}

}  // namespace
}  // namespace haptic::rt
