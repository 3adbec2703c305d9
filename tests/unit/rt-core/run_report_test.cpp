#include "haptic/rt/run_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>

namespace haptic::rt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TEST(RunReport, HasTheKeysOfTheDesign) {
    const auto instruments = std::make_unique<Instruments>();
    instruments->ticks = 12;
    instruments->overruns = 3;
    instruments->period.record(1'000'000);
    instruments->frame_age.record(5'000'000);
    RunResult result;
    result.usage.page_faults = 4;
    result.faults = HAPTIC_FAULT_JUMP | HAPTIC_FAULT_STOP;
    const nlohmann::json report = make_report(result, *instruments);
    EXPECT_EQ(report.at("ticks"), 12);
    EXPECT_EQ(report.at("overruns"), 3);
    EXPECT_EQ(report.at("page_faults"), 4);
    for (const char* name : {"period_us", "wakeup_us", "compute_us"}) {
        for (const char* key : {"min", "p50", "p99", "p999", "max"}) {
            EXPECT_TRUE(report.at(name).at(key).is_number()) << name << '.' << key;
        }
    }
    for (const char* stage : {"exchange", "pose", "proxy", "tension", "publish"}) {
        EXPECT_TRUE(report.at("stage_us").at(stage).at("p99").is_number()) << stage;
    }
    for (const char* key : {"received", "rejected", "stale_ticks"}) {
        EXPECT_TRUE(report.at("frames").at(key).is_number()) << key;
    }
    EXPECT_NEAR(report.at("frames").at("age_ms").at("max").get<double>(), 5.0, 1e-9);
    for (const char* key : {"kernel", "preempt_rt", "policy", "priority", "cpu", "mlocked"}) {
        EXPECT_TRUE(report.at("setup").contains(key)) << key;
    }
    EXPECT_EQ(report.at("motors").at("peak_load").size(), kStrings);
    EXPECT_EQ(report.at("safety").at("state"), "disarmed");
    EXPECT_EQ(report.at("safety").at("faults"), nlohmann::json({"encoder_jump", "stop"}));
    EXPECT_EQ(report.at("histograms").at("period").size(), 1u);
}

TEST(RunReport, TellsARequestedStopFromAFault) {
    RunResult result;
    result.faults = HAPTIC_FAULT_STOP;
    EXPECT_TRUE(result.held());
    result.faults |= HAPTIC_FAULT_OVERRUN;
    EXPECT_FALSE(result.held());
}

TEST(RunReport, SaysHowExchangesEndedAndHowLongOneMayTake) {
    const auto instruments = std::make_unique<Instruments>();
    instruments->count(device::ExchangeStatus::Ok);
    instruments->count(device::ExchangeStatus::Ok);
    instruments->count(device::ExchangeStatus::Disconnected);
    instruments->count(device::ExchangeStatus::Ok);
    RunResult result;
    result.faults = HAPTIC_FAULT_EXCHANGE;
    result.device = "a device";
    result.exchange_bound_ns = 4'000'000;
    const nlohmann::json exchange = make_report(result, *instruments).at("exchange");
    EXPECT_EQ(exchange.at("statuses").at("ok"), 3);
    EXPECT_EQ(exchange.at("statuses").at("disconnected"), 1);
    EXPECT_EQ(exchange.at("statuses").size(), device::kExchangeStatuses);
    EXPECT_EQ(exchange.at("last_failure"), "disconnected");
    EXPECT_EQ(exchange.at("device"), "a device");
    EXPECT_EQ(exchange.at("bound_us"), 4000.0);
    EXPECT_THAT(summary(result, *instruments), HasSubstr("FAULT: exchange (disconnected)"));
}

TEST(RunReport, NamesTheStringsThatAFaultIsAbout) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    result.faults = HAPTIC_FAULT_SLACK;
    result.suspects = 0b1000;
    EXPECT_EQ(make_report(result, *instruments).at("safety").at("strings"), nlohmann::json({3}));
    EXPECT_THAT(summary(result, *instruments), HasSubstr("FAULT: slack (string 3)\n"));
    result.suspects = 0b1101001;
    EXPECT_THAT(string_numbers(result.suspects), ElementsAre(0, 3, 5, 6));
    EXPECT_THAT(summary(result, *instruments),
                HasSubstr("FAULT: slack (string 0, 3, 5 or 6: the lengths do not tell them apart)\n"));
}

TEST(RunReport, NamesEveryFaultBit) {
    EXPECT_THAT(fault_names(0x1ff), ElementsAre("exchange", "encoder_jump", "slack", "residual", "overrun", "nonfinite",
                                                "stop", "thermal", "watchdog"));
}

TEST(RunReport, SaysInItsSummaryWhatIsMissing) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    result.setup.missing.push_back({"memory is not locked: no", "RLIMIT_MEMLOCK", "setcap"});
    EXPECT_THAT(summary(result, *instruments), HasSubstr("degraded: memory is not locked"));
    result.setup.missing.clear();
    EXPECT_THAT(summary(result, *instruments), Not(HasSubstr("degraded")));
    result.faults = HAPTIC_FAULT_JUMP;
    EXPECT_THAT(summary(result, *instruments), HasSubstr("FAULT: encoder_jump"));
}

}  // namespace
}  // namespace haptic::rt
