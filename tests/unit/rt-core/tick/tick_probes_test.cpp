// Probes of the tick.
#include <gtest/gtest.h>

#include <cerrno>
#include <memory>

#include "fake_lines.hpp"
#include "haptic/edge_capture.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using haptic::test::FakeOutput;
using haptic::test::FakeWire;
using test::floor_frame;
using test::TickRig;

/// Board that records whether the probe is high during an exchange.
class WatchingBoard final : public device::Board {
  public:
    WatchingBoard(device::Board& board, const FakeWire& wire) : board_(&board), wire_(&wire) {}
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override {
        up += wire_->is_up() ? 1 : 0;
        ++exchanges;
        return board_->exchange(command, reading, now_ns);
    }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

    int up = 0;
    int exchanges = 0;

  private:
    device::Board* board_;
    const FakeWire* wire_;
};

class ProbedTick : public testing::Test {
  protected:
    ProbedTick() { rig.tick.show_on(&probes); }

    std::unique_ptr<FakeWire> tick_wire = std::make_unique<FakeWire>();
    std::unique_ptr<FakeWire> frame_wire = std::make_unique<FakeWire>();
    std::unique_ptr<FakeWire> relay_wire = std::make_unique<FakeWire>();
    TickProbes probes{Probe(std::make_unique<FakeOutput>(*tick_wire), "tick", &test::still_clock),
                      Probe(std::make_unique<FakeOutput>(*frame_wire), "frame", &test::still_clock),
                      Probe(std::make_unique<FakeOutput>(*relay_wire), "relay", &test::still_clock)};
    TickRig rig;
};

TEST_F(ProbedTick, MakesTwoEdgesPerTickInEveryState) {
    rig.run_up();
    rig.steps(100);
    rig.faulty.failing = true;
    rig.steps(1000);
    ASSERT_NE(rig.tick.faults(), 0u);
    const std::uint64_t ticks = rig.tick.last().number;
    EXPECT_EQ(probes.tick.edges(), 2 * ticks);
    EXPECT_EQ(tick_wire->edges().size(), 2 * ticks);
    EXPECT_FALSE(tick_wire->is_up());
    EXPECT_EQ(rig.tick.instruments().probe_edge.count(), 2 * ticks + probes.relay.edges());
}

TEST_F(ProbedTick, KeepsTheRelayClosedWhileItIsArmedAndItsBoardAnswers) {
    rig.steps(50);
    EXPECT_EQ(probes.relay.edges(), 0u) << "disarmed";
    rig.run_up();
    const std::uint64_t before = probes.relay.edges();
    rig.steps(100);
    EXPECT_EQ(probes.relay.edges(), before + 100) << "one edge a tick";
    // The fade of an orderly stop is under power; the line is steady when the motors are at zero.
    rig.tick.stop();
    rig.steps(10);
    EXPECT_EQ(probes.relay.edges(), before + 110);
    rig.steps(2000);
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    const std::uint64_t after = probes.relay.edges();
    EXPECT_LT(after, before + 1500);
    rig.steps(100);
    EXPECT_EQ(probes.relay.edges(), after);
}

TEST_F(ProbedTick, OpensTheRelayAtOnceWhenNothingReachesTheMotorsAnyMore) {
    rig.run_up();
    rig.faulty.failing = true;
    int ticks = 0;
    while ((rig.tick.faults() & HAPTIC_FAULT_EXCHANGE) == 0 && ticks < 10'000) {
        rig.steps(1);
        ++ticks;
    }
    ASSERT_NE(rig.tick.faults() & HAPTIC_FAULT_EXCHANGE, 0u);
    const std::uint64_t edges = probes.relay.edges();
    EXPECT_NE(rig.tick.safety_state(), SafetyState::Disarmed) << "the fade goes on, unheard";
    rig.steps(100);
    EXPECT_EQ(probes.relay.edges(), edges);
}

TEST_F(ProbedTick, IsHighDuringTheExchange) {
    WatchingBoard board(rig.board, *tick_wire);
    Tick tick(rig.settings, board, rig.frames_in, rig.states_out, test::still_clock);
    tick.show_on(&probes);
    for (int i = 0; i < 10; ++i) {
        tick.run({rig.now_ns, rig.now_ns, 0});
        rig.now_ns += rig.settings.period_ns;
    }
    EXPECT_EQ(board.exchanges, 20);
    EXPECT_EQ(board.up, 20);
}

TEST_F(ProbedTick, ShowsEachAcceptedFrameAndNoRejectedOne) {
    rig.run_up();
    EXPECT_EQ(frame_wire->edges().size(), 0u);
    for (int i = 0; i < 7; ++i) {
        rig.publish(floor_frame(-0.01, 100.0, rig.now_ns));
        rig.step();
        rig.step();
    }
    EXPECT_EQ(frame_wire->edges().size(), 7u);
    EXPECT_EQ(rig.tick.instruments().frames_received, 7u);
    ContactFrame wrong = floor_frame(-0.01, 100.0, rig.now_ns);
    wrong.proxies[0].planes[0].normal[1] = 7.0;
    rig.publish(wrong);
    rig.step();
    EXPECT_EQ(rig.tick.instruments().frames_rejected, 1u);
    EXPECT_EQ(frame_wire->edges().size(), 7u);
}

TEST_F(ProbedTick, ContinuesWithAFlagWhenTheKernelRefusesAnEdge) {
    rig.run_up();
    EXPECT_EQ(rig.tick.last().flags & HAPTIC_TICK_PROBE_OFF, 0u);
    tick_wire->error = EIO;
    rig.steps(50);
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_PROBE_OFF, 0u);
    EXPECT_EQ(rig.tick.instruments().probe_off_ticks, 50u);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
    EXPECT_TRUE(probes.tick.off());
    DeviceState state{};
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_NE(state.tick_flags & HAPTIC_TICK_PROBE_OFF, 0u) << "the simulation sees it too";
    // The other probe is unaffected.
    rig.publish(floor_frame(-0.01, 100.0, rig.now_ns));
    rig.step();
    EXPECT_EQ(frame_wire->edges().size(), 1u);
}

TEST_F(ProbedTick, ComputesTheSameAsATickWithoutProbes) {
    TickRig plain;
    rig.tick.arm();
    plain.tick.arm();
    for (int i = 0; i < 1500; ++i) {
        if (i % 10 == 0) {
            rig.publish(floor_frame(0.001, 300.0, rig.now_ns));
            plain.publish(floor_frame(0.001, 300.0, plain.now_ns));
        }
        rig.step();
        plain.step();
        ASSERT_EQ(rig.tick.last().tensions, plain.tick.last().tensions) << i;
        ASSERT_EQ(rig.tick.last().flags, plain.tick.last().flags) << i;
    }
    EXPECT_GT(rig.tick.last().rendered.force.y, 0.1);
    EXPECT_EQ(plain.tick.instruments().probe_edge.count(), 0u);
}

TEST_F(ProbedTick, EdgesShowTheTimingOfTheLoop) {
    // Edges are timed by the tick's deadline, so a skipped tick shows as a period twice as long.
    tick_wire->step_ns = 0;
    const std::int64_t deadline_ns = rig.now_ns;
    for (int i = 0; i < 500; ++i) {
        rig.now_ns += i == 200 ? rig.settings.period_ns : 0;
        tick_wire->time_ns = rig.now_ns + 20'000 + (i % 7) * 1000;
        rig.step();
    }
    EdgeMeter meter({.period_ns = rig.settings.period_ns, .deadline_ns = deadline_ns});
    meter.add(tick_wire->edges());
    const EdgeStatistics& seen = meter.statistics();
    EXPECT_EQ(seen.rising, 500u);
    EXPECT_EQ(seen.lost, 0u);
    EXPECT_EQ(seen.long_periods, 1u);
    EXPECT_EQ(seen.lateness.min_ns(), 20'000);
    EXPECT_EQ(seen.lateness.max_ns(), 26'000);
    EXPECT_NEAR(static_cast<double>(seen.period.percentile_ns(0.5)), 1e6, 50.0 + 1000.0)
        << "half a bucket and one step";
}

}  // namespace
}  // namespace haptic::rt
