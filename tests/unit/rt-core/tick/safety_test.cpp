#include "tick/safety.hpp"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kTickNs;

TickHealth healthy() {
    TickHealth health;
    health.elapsed_ns = kTickNs;
    return health;
}

class SafetyMachineTest : public testing::Test {
  protected:
    void run_up() {
        machine.arm();
        for (int i = 0; i < 1000 && machine.state() != SafetyState::Running; ++i) {
            machine.update(healthy());
        }
        ASSERT_EQ(machine.state(), SafetyState::Running);
    }

    SafetySettings settings;
    SafetyMachine machine{settings};
    const Wrench wrench{{1.0, 2.0, 3.0}, {0.01, 0.0, 0.0}};
};

TEST_F(SafetyMachineTest, CarriesNoTensionWhileDisarmed) {
    for (int i = 0; i < 10; ++i) {
        machine.update(healthy());
        EXPECT_EQ(machine.permitted_wrench(wrench).force, Vec3(0.0));
        EXPECT_EQ(machine.tension_scale(), 0.0);
    }
    EXPECT_EQ(machine.state(), SafetyState::Disarmed);
}

TEST_F(SafetyMachineTest, PassesThroughTensioningAndCalibratingBeforeAnyWrench) {
    machine.arm();
    std::vector<SafetyState> states{machine.state()};
    double last_scale = 0.0;
    int takes = 0;
    for (int i = 0; i < 1000 && machine.state() != SafetyState::Running; ++i) {
        takes += machine.update(healthy()) == SafetyMachine::Calibration::Take ? 1 : 0;
        if (machine.state() != states.back()) {
            states.push_back(machine.state());
        }
        if (machine.state() != SafetyState::Running) {
            EXPECT_EQ(machine.permitted_wrench(wrench).force, Vec3(0.0));
        }
        // The steepest slope of the ramp is 1.5 over its length.
        EXPECT_LE(machine.tension_scale() - last_scale, 1.5 * 1e-3 / 0.5 + 1e-12);
        EXPECT_GE(machine.tension_scale(), last_scale);
        last_scale = machine.tension_scale();
    }
    EXPECT_EQ(states,
              (std::vector<SafetyState>{SafetyState::Tensioning, SafetyState::Calibrating, SafetyState::Running}));
    EXPECT_EQ(takes, 1);
    EXPECT_EQ(last_scale, 1.0);
    EXPECT_EQ(machine.permitted_wrench(wrench).force, wrench.force);
}

TEST_F(SafetyMachineTest, DoesNotCalibrateAGripThatMoves) {
    machine.arm();
    TickHealth moving = healthy();
    for (int i = 0; i < 3000; ++i) {
        moving.largest_movement = i % 100 == 0 ? 1e-3 : 0.0;
        machine.update(moving);
    }
    EXPECT_EQ(machine.state(), SafetyState::Calibrating);
}

struct FaultCase {
    std::string name;
    TickHealth health;
    int ticks;  // consecutive, until it is a fault
    std::uint32_t bit;
};

class SafetyFault : public SafetyMachineTest, public testing::WithParamInterface<FaultCase> {};

TEST_P(SafetyFault, FadesTheWrenchSmoothlyThenTheTensionAndStaysLatched) {
    run_up();
    machine.permitted_wrench(wrench);
    for (int i = 0; i < GetParam().ticks; ++i) {
        machine.update(GetParam().health);
        ASSERT_EQ(machine.state(), SafetyState::Running) << i;
        machine.permitted_wrench(wrench);
    }
    machine.update(GetParam().health);
    ASSERT_EQ(machine.state(), SafetyState::Faulted);
    EXPECT_EQ(machine.faults(), GetParam().bit);

    const double full = glm::length(wrench.force);
    double last = full;
    double last_scale = 1.0;
    int ticks = 0;
    while (machine.state() == SafetyState::Faulted && ticks < 2000) {
        // A new wrench must be ignored while faulted.
        const double now = glm::length(machine.permitted_wrench({{100.0, 0.0, 0.0}, {}}).force);
        EXPECT_LE(now, last);
        EXPECT_LE(last - now, 1.5 * full * 1e-3 / 0.1 + 1e-9);
        if (now > 0.0) {
            EXPECT_EQ(machine.tension_scale(), 1.0);
        }
        EXPECT_LE(last_scale - machine.tension_scale(), 1.5 * 1e-3 / 0.5 + 1e-12);
        last = now;
        last_scale = machine.tension_scale();
        machine.update(healthy());
        ++ticks;
    }
    EXPECT_EQ(machine.state(), SafetyState::Disarmed);
    EXPECT_EQ(machine.tension_scale(), 0.0);
    EXPECT_NEAR(ticks, 600, 3);  // 0.1 s for the wrench, 0.5 s for the tension
    EXPECT_EQ(machine.faults(), GetParam().bit);
    machine.arm();
    EXPECT_EQ(machine.faults(), 0u);
}

FaultCase fault_case(const std::string& name, int ticks, std::uint32_t bit, void (*spoil)(TickHealth&)) {
    FaultCase result{name, healthy(), ticks, bit};
    spoil(result.health);
    return result;
}

INSTANTIATE_TEST_SUITE_P(
    Each, SafetyFault,
    testing::Values(
        fault_case("Exchange", 28, HAPTIC_FAULT_EXCHANGE, [](TickHealth& h) { h.exchange_ok = false; }),
        fault_case("Jump", 0, HAPTIC_FAULT_JUMP, [](TickHealth& h) { h.jump = true; }),
        fault_case("Residual", 22, HAPTIC_FAULT_RESIDUAL, [](TickHealth& h) { h.residual = 1.1e-3; }),
        fault_case("SlackString", 22, HAPTIC_FAULT_SLACK,
                   [](TickHealth& h) {
                       h.residual = 1.1e-3;
                       h.slack = true;
                   }),
        fault_case("ResidualThatIsNoNumber", 22, HAPTIC_FAULT_RESIDUAL,
                   [](TickHealth& h) { h.residual = std::numeric_limits<double>::quiet_NaN(); }),
        fault_case("UndeterminedPose", 22, HAPTIC_FAULT_RESIDUAL, [](TickHealth& h) { h.determined = false; }),
        fault_case("Overrun", 35, HAPTIC_FAULT_OVERRUN, [](TickHealth& h) { h.late_ns = kTickNs; }),
        fault_case("OldEncoders", 0, HAPTIC_FAULT_EXCHANGE, [](TickHealth& h) { h.encoder_age_ns = 20'000'001; }),
        fault_case("Pose", 0, HAPTIC_FAULT_POSE, [](TickHealth& h) { h.pose = Proof::Refused; }),
        fault_case("Thermal", 0, HAPTIC_FAULT_THERMAL, [](TickHealth& h) { h.overheated = true; }),
        fault_case("NonFinite", 0, HAPTIC_FAULT_NONFINITE, [](TickHealth& h) { h.finite = false; })),
    [](const testing::TestParamInfo<FaultCase>& param) { return param.param.name; });

/// Repeats a cycle of bad and good ticks for a second, or until the machine has faulted. Returns ms until the fault.
int cycle_until_fault(SafetyMachine& machine, const TickHealth& bad, int bad_ticks, int good_ticks) {
    for (int tick = 0; tick < 1000; ++tick) {
        machine.update(tick % (bad_ticks + good_ticks) < bad_ticks ? bad : healthy());
        if (machine.state() != SafetyState::Running) {
            return tick;
        }
    }
    return -1;
}

TEST_F(SafetyMachineTest, ToleratesARareLostAnswer) {
    run_up();
    TickHealth failed = healthy();
    failed.exchange_ok = false;
    EXPECT_EQ(cycle_until_fault(machine, failed, 1, 9), -1);
    EXPECT_NEAR(machine.shares().exchange, 0.1, 0.01);
}

TEST_F(SafetyMachineTest, FaultsWhenFourOfFiveAnswersAreLostThoughNeverManyInARow) {
    run_up();
    TickHealth failed = healthy();
    failed.exchange_ok = false;
    const int fault_ms = cycle_until_fault(machine, failed, 4, 1);
    EXPECT_GE(fault_ms, 28);
    EXPECT_LE(fault_ms, 40);
    EXPECT_EQ(machine.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_EXCHANGE));
}

TEST_F(SafetyMachineTest, JudgesAGapByItsLength) {
    for (const std::int64_t gap_ms : {10, 30}) {
        machine = SafetyMachine(settings);
        run_up();
        TickHealth late = healthy();
        late.elapsed_ns = gap_ms * kTickNs;
        late.late_ns = (gap_ms - 1) * kTickNs;
        machine.update(late);
        EXPECT_EQ(machine.state(), SafetyState::Running) << gap_ms;
    }
    for (const std::int64_t gap_ms : {80, 500, 2000}) {
        machine = SafetyMachine(settings);
        run_up();
        machine.permitted_wrench(wrench);
        TickHealth late = healthy();
        late.elapsed_ns = gap_ms * kTickNs;
        late.late_ns = (gap_ms - 1) * kTickNs;
        machine.update(late);
        EXPECT_EQ(machine.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_OVERRUN)) << gap_ms;
        // The fade begins; no gap turns it into a step.
        EXPECT_GT(glm::length(machine.permitted_wrench(wrench).force), 0.85 * glm::length(wrench.force)) << gap_ms;
    }
}

TEST_F(SafetyMachineTest, JudgesTheSameTimesAtEightKilohertz) {
    run_up();
    TickHealth failed = healthy();
    failed.elapsed_ns = kTickNs / 8;
    failed.exchange_ok = false;
    int ticks = 0;
    for (; machine.state() == SafetyState::Running && ticks < 1000; ++ticks) {
        machine.update(failed);
    }
    EXPECT_EQ(ticks, 231) << "29 ms, as at 1 kHz";
}

TEST_F(SafetyMachineTest, FadesInRealTimeWhenTicksAreSlow) {
    // Each tick takes 8 ms, because the board does not answer.
    run_up();
    machine.permitted_wrench(wrench);
    machine.stop();
    TickHealth slow = healthy();
    slow.elapsed_ns = 8 * kTickNs;
    int ticks = 0;
    for (; machine.state() == SafetyState::Faulted && ticks < 1000; ++ticks) {
        machine.permitted_wrench(wrench);
        machine.update(slow);
    }
    EXPECT_NEAR(8.0 * ticks, 600.0, 24.0) << "ms: 100 for the wrench and 500 for the tension";
}

TEST_F(SafetyMachineTest, CalibratesOnlyADeviceThatHasProvedItsWiring) {
    settings.prove = true;
    machine = SafetyMachine(settings);
    machine.arm();
    for (int i = 0; i < 2000; ++i) {
        machine.update(healthy());
    }
    EXPECT_EQ(machine.state(), SafetyState::Proving);
    EXPECT_EQ(machine.permitted_wrench(wrench).force, Vec3(0.0));
    TickHealth proved = healthy();
    proved.wiring = Proof::Passed;
    EXPECT_EQ(machine.update(proved), SafetyMachine::Calibration::Restart);
    EXPECT_EQ(machine.state(), SafetyState::Calibrating);
}

TEST_F(SafetyMachineTest, RefusesADeviceThatIsWiredWrongAndNamesItsStrings) {
    settings.prove = true;
    machine = SafetyMachine(settings);
    machine.arm();
    TickHealth refused = healthy();
    refused.wiring = Proof::Refused;
    refused.suspects = 0b100100;
    for (int i = 0; i < 600; ++i) {
        machine.update(refused);
    }
    EXPECT_EQ(machine.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_WIRING));
    EXPECT_EQ(machine.suspects(), 0b100100);
}

TEST_F(SafetyMachineTest, FadesFromTheLastGoodWrenchWhenOneIsNotFinite) {
    run_up();
    machine.permitted_wrench(wrench);
    const Wrench got = machine.permitted_wrench({{std::numeric_limits<double>::quiet_NaN(), 0, 0}, {}});
    EXPECT_EQ(got.force, wrench.force);
    EXPECT_EQ(machine.state(), SafetyState::Faulted);
    EXPECT_EQ(machine.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_NONFINITE));
}

TEST_F(SafetyMachineTest, StopsFromTensioningWithTheSameRamp) {
    machine.arm();
    for (int i = 0; i < 250; ++i) {
        machine.update(healthy());
    }
    const double at_stop = machine.tension_scale();
    machine.stop();
    EXPECT_EQ(machine.tension_scale(), at_stop);
    for (int i = 0; i < 360; ++i) {
        machine.update(healthy());
    }
    EXPECT_EQ(machine.state(), SafetyState::Disarmed);
    EXPECT_EQ(machine.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
}

TEST_F(SafetyMachineTest, HasNothingToStopWhileDisarmed) {
    machine.stop();
    EXPECT_EQ(machine.state(), SafetyState::Disarmed);
    EXPECT_EQ(machine.faults(), 0u);
}

TEST_F(SafetyMachineTest, CollectsFurtherFaultsWhileFading) {
    run_up();
    machine.stop();
    TickHealth jump = healthy();
    jump.jump = true;
    machine.update(jump);
    EXPECT_EQ(machine.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP | HAPTIC_FAULT_JUMP));
}

}  // namespace
}  // namespace haptic::rt
