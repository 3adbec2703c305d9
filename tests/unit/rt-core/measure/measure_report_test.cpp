#include "measure/measure_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <vector>

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// A measurement of given ticks.
class MeasureReport : public testing::Test {
  protected:
    MeasureReport() {
        result.setup.kernel = "a kernel";
        result.setup.policy = "SCHED_FIFO";
        result.setup.cpu = 1;
        result.device = "a device";
    }

    void tick(std::int64_t wakeup_ns, std::int64_t compute_ns, std::int64_t missed = 0) {
        TickRecord record;
        record.number = ++instruments->ticks;
        record.deadline_ns = static_cast<std::int64_t>(record.number) * 1'000'000;
        record.now_ns = record.deadline_ns + wakeup_ns;
        record.compute_ns = compute_ns;
        record.exchange_in = record.exchange_out = 0;
        TickTiming timing;
        timing.of(TickStage::Exchange) = compute_ns;
        timing.motion_to_force_ns = compute_ns;
        instruments->wakeup.record(wakeup_ns);
        instruments->compute.record(compute_ns);
        instruments->exchange.record(compute_ns);
        instruments->motion_to_force.record(compute_ns);
        log->add(record, timing, missed);
    }
    [[nodiscard]] nlohmann::json report() {
        course->take(*log);
        return make_measure_report({.result = &result,
                                    .instruments = instruments.get(),
                                    .log = log.get(),
                                    .kernel = &kernel,
                                    .course = course.get(),
                                    .real_minus_monotonic_ns = 1'800'000'000'000'000'000,
                                    .peers = peers});
    }
    /// A result of the tool of this name.
    PeerResult& peer(std::string_view name) {
        const auto tools = peer_tools();
        const auto tool = std::find_if(tools.begin(), tools.end(), [&](const auto& one) { return one.name == name; });
        results.push_back(std::make_unique<PeerResult>());
        peers.push_back({.tool = &*tool, .result = results.back().get()});
        return *results.back();
    }

    RunResult result;
    std::unique_ptr<Instruments> instruments = std::make_unique<Instruments>();
    std::unique_ptr<TimingLog> log = std::make_unique<TimingLog>();
    KernelWatch kernel{0, "/nowhere"};
    std::unique_ptr<RunCourse> course = std::make_unique<RunCourse>(1'000'000);
    std::vector<std::unique_ptr<PeerResult>> results;
    std::vector<MeasuredPeer> peers;
};

TEST_F(MeasureReport, HasTheKeysOfARunAndThoseOfAMeasurement) {
    tick(20'000, 5000);
    const nlohmann::json whole = report();
    EXPECT_EQ(whole.at("ticks"), 1);
    EXPECT_TRUE(whole.at("safety").contains("faults"));
    const nlohmann::json& measure = whole.at("measure");
    for (const char* key : {"version", "began", "period_s", "load", "overruns", "kernel", "course", "cyclictest",
                            "timerlat", "osnoise", "latency_us", "worst_ticks"}) {
        EXPECT_TRUE(measure.contains(key)) << key;
    }
    for (const char* latency : {"wakeup", "period", "compute", "exchange", "device_to_plane", "motion_to_force"}) {
        for (const char* key :
             {"count", "min", "mean", "p50", "p90", "p99", "p999", "p9999", "max", "histogram", "what"}) {
            EXPECT_TRUE(measure.at("latency_us").at(latency).contains(key)) << latency << '.' << key;
        }
    }
    EXPECT_FALSE(measure.at("latency_us").at("device_to_plane").contains("max_at")) << "there was no frame";
}

TEST_F(MeasureReport, HasThePercentilesOfTheSortedValues) {
    std::mt19937 random(3);
    std::lognormal_distribution<double> duration(10.0, 1.0);  // ns
    std::vector<std::int64_t> all;
    for (int i = 0; i < 30'000; ++i) {
        all.push_back(std::lround(duration(random)));
        tick(all.back(), 1000);
    }
    std::sort(all.begin(), all.end());
    const nlohmann::json whole = report();
    const nlohmann::json& wakeup = whole.at("measure").at("latency_us").at("wakeup");
    for (const auto& [key, fraction] :
         {std::pair{"p50", 0.5}, {"p90", 0.9}, {"p99", 0.99}, {"p999", 0.999}, {"p9999", 0.9999}}) {
        const auto rank = static_cast<std::size_t>(std::ceil(fraction * 30'000.0));
        const double exact_us = static_cast<double>(all[rank - 1]) * 1e-3;
        EXPECT_NEAR(wakeup.at(key).get<double>(), exact_us, 0.004 * exact_us) << key;  // the histogram's 0.4 %
    }
    EXPECT_DOUBLE_EQ(wakeup.at("max").get<double>(), static_cast<double>(all.back()) * 1e-3);
    EXPECT_EQ(wakeup.at("count"), 30'000);
}

TEST_F(MeasureReport, NamesTimeAndStageOfTheMaximum) {
    for (int i = 0; i < 100; ++i) {
        tick(20'000, 5000);
    }
    tick(21'000, 900'000);
    tick(700'000, 5000);
    const nlohmann::json whole = report();
    const nlohmann::json& latencies = whole.at("measure").at("latency_us");
    EXPECT_EQ(latencies.at("compute").at("max_tick"), 101);
    EXPECT_EQ(latencies.at("compute").at("max_stage"), "exchange");
    EXPECT_EQ(latencies.at("wakeup").at("max_tick"), 102);
    EXPECT_EQ(latencies.at("wakeup").at("max_stage"), "wake-up");
    EXPECT_EQ(latencies.at("wakeup").at("max_cause"), "timer");
    const std::int64_t at_ns = 102 * 1'000'000 + 700'000;
    EXPECT_EQ(latencies.at("wakeup").at("max_at"), time_of_day(1'800'000'000'000'000'000 + at_ns));
    EXPECT_DOUBLE_EQ(latencies.at("wakeup").at("max_at_s").get<double>(), 0.1027);
}

TEST_F(MeasureReport, ExplainsOverruns) {
    for (int i = 0; i < 50; ++i) {
        tick(20'000, 5000);
    }
    tick(20'000, 2'500'000, 2);
    tick(1'500'000, 5000, 1);
    const nlohmann::json whole = report();
    const nlohmann::json& overruns = whole.at("measure").at("overruns");
    EXPECT_EQ(overruns.at("deadlines_missed"), 3);
    EXPECT_EQ(overruns.at("late_ticks"), 2);
    EXPECT_EQ(overruns.at("explained_ticks"), 2);
    EXPECT_EQ(overruns.at("causes").at("exchange: unseen"), 1);
    EXPECT_EQ(overruns.at("causes").at("wake-up: timer"), 1);
    const nlohmann::json& worst = whole.at("measure").at("worst_ticks").at(0);
    EXPECT_EQ(worst.at("missed"), 2);
    EXPECT_EQ(worst.at("stage"), "exchange");
    EXPECT_DOUBLE_EQ(worst.at("late_us").get<double>(), 2520.0);
    EXPECT_THAT(measure_text(whole), HasSubstr("3 deadlines missed by 2 ticks"));
}

TEST_F(MeasureReport, DividesTheWakeUpsOfLoopAndTools) {
    tick(30'000, 5000);
    EXPECT_THAT(measure_text(report()), Not(HasSubstr("cyclictest")));
    peer("cyclictest").wakeup.record(20'000);
    PeerResult& timerlat = peer("timerlat");
    timerlat.wakeup.record(15'000);
    timerlat.interrupt.record(2000);
    const nlohmann::json whole = report();
    const nlohmann::json& measure = whole.at("measure");
    for (const char* key : {"p50", "p99", "p999", "p9999", "max"}) {
        EXPECT_DOUBLE_EQ(measure.at("cyclictest").at("ratio").at(key).get<double>(), 1.5) << key;
        EXPECT_DOUBLE_EQ(measure.at("timerlat").at("ratio").at(key).get<double>(), 2.0) << key;
        EXPECT_DOUBLE_EQ(measure.at("timerlat").at("ratio_to_cyclictest").at(key).get<double>(), 0.75) << key;
    }
    EXPECT_DOUBLE_EQ(measure.at("timerlat").at("interrupt_us").at("max").get<double>(), 2.0);
    EXPECT_FALSE(measure.at("cyclictest").contains("interrupt_us"));
    EXPECT_TRUE(measure.at("osnoise").is_null()) << "it was not asked for";
    EXPECT_THAT(measure_text(whole), AllOf(HasSubstr("rt-core / cyclictest"), HasSubstr("timerlat's wake-up"),
                                           HasSubstr("timerlat's interrupt"), HasSubstr("rt-core / timerlat"),
                                           HasSubstr("timerlat / cyclictest")));
}

TEST_F(MeasureReport, SaysWhatNoiseWasFoundAndWhyAToolWasNotRun) {
    tick(30'000, 5000);
    peer("osnoise").noise = ProcessorNoise{.runtime_us = 2'700'000.0,
                                           .noise_us = 5.0,
                                           .available_percent = 99.99981,
                                           .max_single_us = 4.5,
                                           .hardware = 11,
                                           .interrupts = 677};
    peer("timerlat").missing = "this kernel has no tracer timerlat";
    const nlohmann::json whole = report();
    EXPECT_EQ(whole.at("measure").at("osnoise").at("noise").at("hardware"), 11);
    EXPECT_EQ(whole.at("measure").at("timerlat"), (nlohmann::json{{"missing", "this kernel has no tracer timerlat"}}));
    EXPECT_THAT(measure_text(whole),
                AllOf(HasSubstr("timerlat was not run: this kernel has no tracer timerlat"),
                      HasSubstr("99.9998 % of 2.7 s"), HasSubstr("4.5 us"), HasSubstr("677 interrupts"),
                      HasSubstr("11 times by firmware"), Not(HasSubstr("osnoise's wake-up"))));
}

TEST_F(MeasureReport, FollowsThePercentilesOverTheRun) {
    // 100 s with a tick every 10 ms, the second half ten times as late.
    for (int i = 0; i < 10'000; ++i) {
        if (i == 5000) {
            EXPECT_THAT(measure_text(report()), Not(HasSubstr("first half"))) << "50 s are too short for parts";
        }
        instruments->ticks += 9;
        tick(i < 5000 ? 10'000 : 100'000, 5000);
    }
    const nlohmann::json whole = report();
    const nlohmann::json& parts = whole.at("measure").at("course");
    const nlohmann::json& wakeup = parts.at("wakeup");
    for (const char* key : {"ticks", "p50_us", "p99_us", "p999_us"}) {
        EXPECT_EQ(wakeup.at(key).size(), wakeup.at("max_us").size()) << key;
    }
    EXPECT_DOUBLE_EQ(wakeup.at("max_us").front().get<double>(), 10.0);
    EXPECT_DOUBLE_EQ(wakeup.at("max_us").back().get<double>(), 100.0);
    EXPECT_NEAR(wakeup.at("p50_us").front().get<double>(), 10.0, 10.0 / 32.0);
    EXPECT_DOUBLE_EQ(parts.at("first").at("to_s").get<double>(), parts.at("last").at("from_s").get<double>());
    EXPECT_EQ(
        parts.at("first").at("wakeup").at("count").get<int>() + parts.at("last").at("wakeup").at("count").get<int>(),
        10'000);
    EXPECT_NEAR(parts.at("first").at("wakeup").at("p50").get<double>(), 10.0, 10.0 / 32.0);
    EXPECT_NEAR(parts.at("last").at("wakeup").at("p50").get<double>(), 100.0, 100.0 / 32.0);
    EXPECT_EQ(parts.at("lost_ticks"), 0);
    EXPECT_THAT(measure_text(whole), AllOf(HasSubstr("wake-up, first half"), HasSubstr("compute, last half")));
}

TEST_F(MeasureReport, ComparesTheFirstAndTheLastHourOfALongRun) {
    // Three hours, a tick a second.
    for (int i = 0; i < 3 * 3600; ++i) {
        instruments->ticks += 999;
        tick(i < 3600 ? 10'000 : i < 7200 ? 50'000 : 20'000, 5000);
    }
    const nlohmann::json whole = report();
    const nlohmann::json& parts = whole.at("measure").at("course");
    // By whole intervals, of at most 42 s.
    EXPECT_NEAR(parts.at("first").at("wakeup").at("count").get<double>(), 3600.0, 42.0);
    EXPECT_NEAR(parts.at("last").at("wakeup").at("count").get<double>(), 3600.0, 42.0);
    EXPECT_NEAR(parts.at("first").at("wakeup").at("p50").get<double>(), 10.0, 10.0 / 32.0);
    EXPECT_NEAR(parts.at("last").at("wakeup").at("p50").get<double>(), 20.0, 20.0 / 32.0);
    EXPECT_THAT(measure_text(whole), AllOf(HasSubstr("wake-up, first hour"), HasSubstr("wake-up, last hour")));
}

TEST_F(MeasureReport, IsComparedWithAnother) {
    tick(20'000, 4000);
    const nlohmann::json first = report();
    tick(60'000, 8000);
    result.setup.preempt_rt = true;
    const nlohmann::json comparison = compare_measurements(first, report());
    EXPECT_DOUBLE_EQ(comparison.at("latency_us").at("wakeup").at("max").at("ratio").get<double>(), 3.0);
    EXPECT_DOUBLE_EQ(comparison.at("latency_us").at("compute").at("max").at("ratio").get<double>(), 2.0);
    EXPECT_TRUE(comparison.at("latency_us").at("device_to_plane").at("max").at("ratio").is_null());
    EXPECT_EQ(comparison.at("differences"), nlohmann::json({"preempt_rt"}));
    EXPECT_THAT(comparison_text(comparison), HasSubstr("different preempt_rt: false | true"));
}

TEST_F(MeasureReport, RefusesJsonThatIsNoMeasurement) {
    EXPECT_THROW(require_measurement(nlohmann::json::array(), "x"), std::runtime_error);
    EXPECT_THROW(require_measurement(make_report(result, *instruments), "x"), std::runtime_error);
    nlohmann::json other_version = report();
    require_measurement(other_version, "x");
    other_version["measure"]["version"] = 99;
    EXPECT_THROW(require_measurement(other_version, "x"), std::runtime_error);
}

TEST(TimeOfDay, HasMicrosecondsAndTheZone) {
    setenv("TZ", "UTC-1", 1);
    tzset();
    EXPECT_EQ(time_of_day(1'000'000'000'123'456'789), "2001-09-09T02:46:40.123456+01:00");
    unsetenv("TZ");
    tzset();
}

}  // namespace
}  // namespace haptic::rt
