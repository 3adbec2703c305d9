#include "measure/run_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <memory>
#include <nlohmann/json.hpp>

namespace haptic::rt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TEST(RunReport, HasTheDocumentedKeys) {
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

TEST(RunReport, DistinguishesARequestedStopFromAFault) {
    RunResult result;
    result.faults = HAPTIC_FAULT_STOP;
    EXPECT_TRUE(result.succeeded());
    result.faults |= HAPTIC_FAULT_OVERRUN;
    EXPECT_FALSE(result.succeeded());
}

TEST(RunReport, CountsExchangeStatusesAndStatesTheirBound) {
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

TEST(RunReport, ReportsUseAndFailureOfTheProbes) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    EXPECT_TRUE(make_report(result, *instruments).at("probes").at("tick").is_null());
    EXPECT_THAT(summary(result, *instruments), Not(HasSubstr("probe")));
    instruments->probe_edge.record(700);
    instruments->probe_off_ticks = 3;
    result.probes = {.tick = {"5 of pl061", 24, 0}, .frame = {"6 of pl061", 1, EIO}, .ticks = 12};
    const nlohmann::json report = make_report(result, *instruments);
    EXPECT_EQ(report.at("probes").at("tick"),
              nlohmann::json({{"line", "5 of pl061"}, {"edges", 24}, {"off", false}, {"error", ""}}));
    EXPECT_EQ(report.at("probes").at("frame").at("off"), true);
    EXPECT_EQ(report.at("probes").at("ticks"), 12);
    EXPECT_NEAR(report.at("probes").at("edge_us").at("max").get<double>(), 0.7, 1e-9);
    EXPECT_THAT(report.at("safety").at("notices"), testing::Contains("probe_off"));
    EXPECT_THAT(summary(result, *instruments), testing::AllOf(HasSubstr("24 edges"), HasSubstr("OFF: Input/output")));
}

TEST(RunReport, NamesTheSuspectedStringsOfAFault) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    result.faults = HAPTIC_FAULT_SLACK;
    result.suspects = 0b1000;
    EXPECT_EQ(make_report(result, *instruments).at("safety").at("strings"), nlohmann::json({3}));
    EXPECT_THAT(summary(result, *instruments), HasSubstr("FAULT: slack (string 3)\n"));
    result.suspects = 0b1101001;
    EXPECT_THAT(string_numbers(result.suspects), ElementsAre(0, 3, 5, 6));
    EXPECT_THAT(summary(result, *instruments),
                HasSubstr("FAULT: slack (string 0, 3, 5 or 6: the lengths cannot distinguish them)\n"));
}

TEST(RunReport, ListsMissingPrivilegesAndFaultsInTheSummary) {
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
