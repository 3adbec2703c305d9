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
    testing::Values(fault_case("Exchange", 5, HAPTIC_FAULT_EXCHANGE, [](TickHealth& h) { h.exchange_ok = false; }),
                    fault_case("Jump", 0, HAPTIC_FAULT_JUMP, [](TickHealth& h) { h.jump = true; }),
                    fault_case("Residual", 20, HAPTIC_FAULT_RESIDUAL, [](TickHealth& h) { h.residual = 1.1e-3; }),
                    fault_case("SlackString", 20, HAPTIC_FAULT_SLACK,
                               [](TickHealth& h) {
                                   h.residual = 1.1e-3;
                                   h.slack = true;
                               }),
                    fault_case("ResidualThatIsNoNumber", 20, HAPTIC_FAULT_RESIDUAL,
                               [](TickHealth& h) { h.residual = std::numeric_limits<double>::quiet_NaN(); }),
                    fault_case("UndeterminedPose", 20, HAPTIC_FAULT_RESIDUAL,
                               [](TickHealth& h) { h.determined = false; }),
                    fault_case("Overrun", 100, HAPTIC_FAULT_OVERRUN, [](TickHealth& h) { h.late = true; }),
                    fault_case("Thermal", 0, HAPTIC_FAULT_THERMAL, [](TickHealth& h) { h.overheated = true; }),
                    fault_case("NonFinite", 0, HAPTIC_FAULT_NONFINITE, [](TickHealth& h) { h.finite = false; })),
    [](const testing::TestParamInfo<FaultCase>& param) { return param.param.name; });

TEST_F(SafetyMachineTest, IgnoresFailuresThatAreNotConsecutive) {
    run_up();
    TickHealth failed = healthy();
    failed.exchange_ok = false;
    for (int i = 0; i < 100; ++i) {
        for (int k = 0; k < settings.exchange_ticks; ++k) {
            machine.update(failed);
        }
        machine.update(healthy());
    }
    EXPECT_EQ(machine.state(), SafetyState::Running);
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
