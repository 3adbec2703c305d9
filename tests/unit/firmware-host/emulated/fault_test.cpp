#include "haptic/device/fault.hpp"

#include <gtest/gtest.h>

#include <string>

#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kMs;

std::string fault_problem(const std::string& text) {
    try {
        static_cast<void>(parse_fault(text));
    } catch (const FaultError& error) {
        return error.what();
    }
    return "taken";
}

TEST(Fault, KindAndTimeAreEnough) {
    const Fault fault = parse_fault("drop@2.0");
    EXPECT_EQ(fault.kind, FaultKind::Drop);
    EXPECT_EQ(fault.begin_ns, 2000 * kMs);
    EXPECT_EQ(fault.duration_ns, Fault::kForever);
    EXPECT_FALSE(fault.commands);
    EXPECT_EQ(fault.packets, 0);
}

TEST(Fault, EveryKindHasItsName) {
    const std::pair<const char*, FaultKind> names[] = {
        {"drop@0", FaultKind::Drop},           {"delay@0", FaultKind::Delay},
        {"duplicate@0", FaultKind::Duplicate}, {"truncate@0", FaultKind::Truncate},
        {"flip@0", FaultKind::Flip},           {"unplug@0", FaultKind::Unplug},
        {"stuck@0", FaultKind::Stuck},         {"jump@0", FaultKind::Jump},
        {"slack@0", FaultKind::Slack},         {"dac@0", FaultKind::Dac}};
    for (const auto& [text, kind] : names) {
        EXPECT_EQ(parse_fault(text).kind, kind) << text;
        EXPECT_NE(fault_help().find(std::string(text, std::string(text).find('@'))), std::string::npos);
    }
}

TEST(Fault, ParametersAreThoseThatWereWritten) {
    const Fault dropped = parse_fault("drop@2.0/0.5:way=out,packets=3");
    EXPECT_EQ(dropped.duration_ns, 500 * kMs);
    EXPECT_TRUE(dropped.commands);
    EXPECT_EQ(dropped.packets, 3);
    EXPECT_EQ(parse_fault("delay@1:by=0.004").delay_ns, 4 * kMs);
    EXPECT_EQ(parse_fault("truncate@1:bytes=53").bytes, 53);
    EXPECT_EQ(parse_fault("flip@2:bit=137").bit, 137);
    const Fault jumped = parse_fault("jump@2:string=3,counts=-3000");
    EXPECT_EQ(jumped.string, 3);
    EXPECT_EQ(jumped.counts, -3000);
    EXPECT_EQ(parse_fault("stuck@2:string=all").string, Fault::kAny);
    EXPECT_DOUBLE_EQ(parse_fault("slack@2:string=1,metres=0.03").slack_m, 0.03);
    EXPECT_TRUE(parse_fault("slack@2:string=1,metres=0,motor=dead").motor_dead);
    EXPECT_FALSE(parse_fault("dac@2:echo=sent").echo_frozen);
}

TEST(Fault, LastsFromItsBeginningForItsDuration) {
    const Fault fault = parse_fault("unplug@1.5/0.25");
    EXPECT_FALSE(fault.active(-1));
    EXPECT_FALSE(fault.active(1500 * kMs - 1));
    EXPECT_TRUE(fault.active(1500 * kMs));
    EXPECT_TRUE(fault.active(1750 * kMs - 1));
    EXPECT_FALSE(fault.active(1750 * kMs));
    EXPECT_TRUE(parse_fault("unplug@0").active(Fault::kForever));
}

TEST(Fault, ErrorsNameTheTextThePlaceAndTheChoices) {
    EXPECT_EQ(
        fault_problem("dorp@2"),
        "fault 'dorp@2', column 1: 'dorp' is not a kind of fault; the choices are drop, delay, duplicate, truncate, "
        "flip, unplug, stuck, jump, slack and dac");
    EXPECT_EQ(fault_problem("drop"),
              "fault 'drop', column 5: '@' and the time in seconds are missing; write for example drop@2.0");
    EXPECT_EQ(fault_problem("drop@soon"),
              "fault 'drop@soon', column 6: the time (s) needs a number from 0 to 1e+06, not 'soon'");
    EXPECT_EQ(fault_problem("drop@2/-1"),
              "fault 'drop@2/-1', column 8: the duration (s) needs a number from 0 to 1e+06, not '-1'");
    EXPECT_EQ(fault_problem("drop@2:byte=3"),
              "fault 'drop@2:byte=3', column 8: 'drop' has no parameter 'byte'; it has way and packets");
    EXPECT_EQ(fault_problem("unplug@2:way=in"),
              "fault 'unplug@2:way=in', column 10: 'unplug' has no parameter 'way'; it takes none");
    EXPECT_EQ(
        fault_problem("stuck@2:string=8"),
        "fault 'stuck@2:string=8', column 16: '8' is not a string; the choices are 0, 1, 2, 3, 4, 5, 6, 7 and all");
    EXPECT_EQ(fault_problem("jump@2:counts=1.5"), "fault 'jump@2:counts=1.5', column 15: counts needs a whole number");
    EXPECT_EQ(fault_problem("drop@2:way"), "fault 'drop@2:way', column 11: 'way' needs a value: way=...");
}

TEST(Fault, NothingUnfinishedIsTaken) {
    for (const char* text :
         {"", "@2", "drop@", "drop@2/", "drop@2:", "drop@2:way=", "drop@2:way=in,", "drop@2x", "drop@nan", "drop@1e99",
          "drop@2/0.5/0.5", "drop@2:way=in:packets=2", "flip@0:bit=4096", "drop@2:packets=0", " drop@2"}) {
        EXPECT_NE(fault_problem(text), "taken") << text;
    }
}

}  // namespace
}  // namespace haptic::device
