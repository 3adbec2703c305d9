#include "view/device_telemetry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <random>
#include <thread>

#include "haptic/frames.hpp"
#include "haptic/ring.hpp"
#include "haptic/workspace_region.hpp"
#include "ring_session.hpp"

namespace haptic::sim::view {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kMillisecond = 1'000'000;
constexpr std::int64_t kSecond = 1'000'000'000;

class DeviceTelemetryTest : public testing::Test {
  protected:
    test::RingSession session_;
    std::optional<RingWriter<DeviceState>> writer_{session_.name()};
    DeviceTelemetry telemetry_{session_.name()};
    DeviceState state_{};
    std::int64_t now_ns_ = 100 * kSecond;

    DeviceTelemetryTest() {
        state_.safety_state = HAPTIC_RUNNING;
        telemetry_.poll(now_ns_);  // attaches to the ring
    }
    /// A tick that latches `period_ns` after the previous one; the ring is polled at every third tick.
    void tick(std::int64_t period_ns) {
        now_ns_ += period_ns;
        state_.latch_time_ns = now_ns_;
        writer_->publish(state_, now_ns_);
        if (++ticks_ % 3 == 0) {
            telemetry_.poll(now_ns_);
        }
    }
    void ticks(int count, std::int64_t period_ns = kMillisecond) {
        for (int i = 0; i < count; ++i) {
            tick(period_ns);
        }
    }
    json message() {
        telemetry_.poll(now_ns_);
        return json::parse(telemetry_.message(now_ns_));
    }

  private:
    int ticks_ = 0;
};

std::uint64_t sum(const json& counts) {
    return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0},
                           [](std::uint64_t total, const json& count) { return total + count.get<std::uint64_t>(); });
}

TEST_F(DeviceTelemetryTest, ReportsNoDeviceWithoutStates) {
    const json absent = message();
    EXPECT_EQ(absent.at("type"), "device");
    EXPECT_EQ(absent.at("connected"), false);
    EXPECT_EQ(absent.at("state"), "absent");
    EXPECT_THAT(absent.at("faults"), IsEmpty());
    EXPECT_THAT(absent.at("flags"), IsEmpty());
    EXPECT_EQ(absent.at("rate_hz"), 0.0);
    EXPECT_THAT(absent.at("period_us").at("edges"), IsEmpty());
    EXPECT_THAT(absent.at("period_us").at("counts"), IsEmpty());
    EXPECT_EQ(absent.at("period_us").at("max"), 0.0);
    EXPECT_EQ(absent.at("missed"), 0);
    EXPECT_EQ(absent.at("frame_age_ms").at("p99"), 0.0);
}

TEST_F(DeviceTelemetryTest, ReportsARegularLoop) {
    ticks(2000);
    const json device = message();
    EXPECT_EQ(device.at("connected"), true);
    EXPECT_EQ(device.at("state"), "running");
    EXPECT_NEAR(device.at("rate_hz").get<double>(), 1000.0, 1e-6);
    EXPECT_EQ(device.at("period_us").at("p50"), 1000.0);
    EXPECT_EQ(device.at("period_us").at("p99"), 1000.0);
    EXPECT_EQ(device.at("period_us").at("max"), 1000.0);
    EXPECT_EQ(device.at("missed"), 0);
    EXPECT_EQ(device.at("unseen"), 0);
    EXPECT_EQ(device.at("window_s"), 10.0);
}

TEST_F(DeviceTelemetryTest, PutsEveryPeriodIntoItsBin) {
    std::mt19937 random(3);
    std::vector<std::int64_t> periods;
    tick(kMillisecond);
    for (int i = 0; i < 5000; ++i) {
        // Most within 40 us, one in fifty up to 400 us late; nanoseconds.
        const auto usual = std::uniform_int_distribution<std::int64_t>(980'000, 1'020'000)(random);
        const auto late = std::uniform_int_distribution<std::int64_t>(1'000'000, 1'400'000)(random);
        periods.push_back(i % 50 == 0 ? late : usual);
        tick(periods.back());
    }
    const json period = message().at("period_us");
    const auto edges = period.at("edges").get<std::vector<double>>();
    const auto counts = period.at("counts").get<std::vector<std::uint64_t>>();
    ASSERT_EQ(edges.size(), DeviceTelemetry::kBins + 1);
    ASSERT_EQ(counts.size(), DeviceTelemetry::kBins);
    for (std::size_t i = 0; i < counts.size(); ++i) {
        std::uint64_t expected = 0;
        for (const std::int64_t ns : periods) {
            const double us = static_cast<double>(ns) / 1000.0;
            expected += (i == 0 || us >= edges[i]) && (i + 1 == counts.size() || us < edges[i + 1]) ? 1u : 0u;
        }
        EXPECT_EQ(counts[i], expected) << edges[i];
        EXPECT_NEAR(edges[i + 1] - edges[i], edges[1] - edges[0], 1e-9) << "all bins are of one width";
    }
    std::sort(periods.begin(), periods.end());
    EXPECT_DOUBLE_EQ(period.at("p50").get<double>(), static_cast<double>(periods[2499]) / 1000.0);
    EXPECT_DOUBLE_EQ(period.at("p99").get<double>(), static_cast<double>(periods[4949]) / 1000.0);
    EXPECT_DOUBLE_EQ(period.at("max").get<double>(), static_cast<double>(periods[4999]) / 1000.0);
}

TEST_F(DeviceTelemetryTest, UsesNarrowBinsForSmallVariation) {
    // Two values 3 us apart, at 1 kHz and at 4 kHz: not all in one bin.
    for (const std::int64_t nominal : {kMillisecond, kMillisecond / 4}) {
        ticks(2, nominal);
        for (int i = 0; i < 100; ++i) {
            tick(nominal);
            tick(nominal + 3000);
        }
        const json period = message().at("period_us");
        EXPECT_LT(period.at("edges").at(1).get<double>() - period.at("edges").at(0).get<double>(), 1.0);
        now_ns_ += 2 * DeviceTelemetry::kWindowNs;
    }
}

TEST_F(DeviceTelemetryTest, HasNoNegativeBinEdge) {
    tick(kMillisecond);
    for (int i = 0; i < 200; ++i) {
        tick(i % 10 == 0 ? 30 * kMillisecond : kMillisecond / 8);
    }
    const json period = message().at("period_us");
    EXPECT_EQ(period.at("edges").at(0), 0.0);
    EXPECT_EQ(sum(period.at("counts")), 200u);
}

TEST_F(DeviceTelemetryTest, CountsDeadlinesThatPassedWithoutALatch) {
    ticks(100);
    // A 1 kHz loop with deadlines at whole milliseconds that keeps its phase: it latches when it wakes, and then at the
    // next deadline. Lateness of four ticks, ns.
    std::uint64_t missed = 0;
    for (const std::int64_t late : {2'300'000, 960'000, 1'000'000, 33'530'000}) {
        tick(kMillisecond + late);
        missed += static_cast<std::uint64_t>(late / kMillisecond);
        tick(kMillisecond - late % kMillisecond);
        ticks(20);
    }
    ASSERT_EQ(missed, 2u + 0u + 1u + 33u);
    EXPECT_EQ(message().at("missed"), missed);
}

TEST_F(DeviceTelemetryTest, ExcludesUnseenStatesFromTheStatistics) {
    ticks(300);
    telemetry_.poll(now_ns_);
    for (int i = 0; i < 20; ++i) {  // 12 of these are overwritten before the next poll
        now_ns_ += kMillisecond;
        state_.latch_time_ns = now_ns_;
        writer_->publish(state_, now_ns_);
    }
    const json device = message();
    EXPECT_EQ(device.at("missed"), 0);
    EXPECT_EQ(device.at("unseen"), 12);
    EXPECT_EQ(device.at("period_us").at("max"), 1000.0);
    EXPECT_NEAR(device.at("rate_hz").get<double>(), 1000.0, 1e-6) << "by their numbers they are counted";
}

TEST_F(DeviceTelemetryTest, DropsStatesOlderThanItsWindow) {
    ticks(10);
    tick(5 * kMillisecond);
    ticks(9'000);
    EXPECT_EQ(message().at("period_us").at("max"), 5000.0);
    ticks(2'000);
    const json device = message();
    EXPECT_EQ(device.at("period_us").at("max"), 1000.0);
    EXPECT_EQ(device.at("missed"), 0);
    EXPECT_EQ(sum(device.at("period_us").at("counts")), 10'001u) << "both ends of the window are in it";
}

TEST_F(DeviceTelemetryTest, RestartsTheWindowAfterAPauseInPolling) {
    ticks(30);
    now_ns_ += 2 * kSecond;
    for (int i = 0; i < 2000; ++i) {
        state_.latch_time_ns = now_ns_;
        writer_->publish(state_, now_ns_);
        now_ns_ += kMillisecond;
    }
    EXPECT_EQ(message().at("unseen"), 0);
    ticks(30);
    EXPECT_EQ(message().at("unseen"), 0);
}

TEST_F(DeviceTelemetryTest, ReportsTheShareOfTicksWithoutAnAnswerFromTheBoard) {
    for (int i = 0; i < 8; ++i) {
        state_.tick_flags = i % 4 == 0 ? std::uint32_t{HAPTIC_TICK_EXCHANGE_FAILED} : 0u;
        tick(kMillisecond);
    }
    EXPECT_DOUBLE_EQ(message().at("unanswered").get<double>(), 0.25);
}

TEST_F(DeviceTelemetryTest, ReportsCurrentFaultsAndFlagsSinceTheLastMessage) {
    state_.tick_flags = HAPTIC_TICK_FORCE_LIMITED;
    tick(kMillisecond);
    state_.tick_flags = HAPTIC_TICK_OVERRUN;
    tick(kMillisecond);
    state_.tick_flags = 0;
    state_.safety_state = HAPTIC_FAULTED;
    state_.faults = HAPTIC_FAULT_WATCHDOG | HAPTIC_FAULT_STOP;
    tick(kMillisecond);
    json device = message();
    EXPECT_THAT(device.at("flags"), ElementsAre("overrun", "force_limited"));
    EXPECT_THAT(device.at("faults"), ElementsAre("stop", "watchdog"));
    EXPECT_EQ(device.at("state"), "faulted");
    tick(kMillisecond);
    device = message();
    EXPECT_THAT(device.at("flags"), IsEmpty());
    EXPECT_THAT(device.at("faults"), ElementsAre("stop", "watchdog"));
}

TEST_F(DeviceTelemetryTest, ReportsTheAgeOfAFrameAtTheLatchThatRenderedIt) {
    std::vector<std::int64_t> ages;
    for (std::uint64_t frame = 1; frame <= 400; ++frame) {
        // Each frame is rendered by two ticks, frame % 7 * 0.1 + 0.3 ms after its publication and one period later.
        const std::int64_t age = static_cast<std::int64_t>(frame % 7) * 100'000 + 300'000;
        telemetry_.frame_published(frame, now_ns_ + kMillisecond - age);
        state_.frame_sequence = frame;
        ticks(2);
        ages.insert(ages.end(), {age, age + kMillisecond});
    }
    std::sort(ages.begin(), ages.end());
    const json age = message().at("frame_age_ms");
    EXPECT_DOUBLE_EQ(age.at("p50").get<double>(), static_cast<double>(ages[399]) * 1e-6);
    EXPECT_DOUBLE_EQ(age.at("p99").get<double>(), static_cast<double>(ages[791]) * 1e-6);
    EXPECT_DOUBLE_EQ(age.at("max").get<double>(), 1.9);
}

TEST_F(DeviceTelemetryTest, HasNoAgeForFramesOfOtherPublishers) {
    telemetry_.frame_published(5, now_ns_);
    state_.frame_sequence = 4;
    ticks(5);
    state_.frame_sequence = 5 + PublishTimes::kFrames;
    ticks(5);
    EXPECT_EQ(message().at("frame_age_ms").at("max"), 0.0);
}

TEST_F(DeviceTelemetryTest, ReportsTheEndAndTheReturnOfTheLoop) {
    const RingReader<DeviceState> host(session_.name());  // host-sim, which keeps the segment
    ticks(50);
    EXPECT_EQ(message().at("connected"), true);
    writer_.reset();
    now_ns_ += DeviceTelemetry::kSilenceNs + 1;
    EXPECT_EQ(message().at("state"), "absent");
    now_ns_ += 5 * kMillisecond;
    writer_.emplace(session_.name());
    ticks(30, 2 * kMillisecond);
    const json device = message();
    EXPECT_EQ(device.at("connected"), true);
    EXPECT_NEAR(device.at("rate_hz").get<double>(), 500.0, 1e-6);
    EXPECT_EQ(device.at("period_us").at("max"), 2000.0) << "the pause between two runs is no period";
    EXPECT_EQ(device.at("missed"), 0);
}

TEST_F(DeviceTelemetryTest, FindsARecreatedRing) {
    ticks(50);
    writer_.reset();
    writer_.emplace(session_.name());
    now_ns_ += kRingAttendNs;
    telemetry_.poll(now_ns_);
    ticks(30);
    EXPECT_EQ(message().at("connected"), true);
    EXPECT_EQ(message().at("missed"), 0);
}

TEST_F(DeviceTelemetryTest, IgnoresImpossibleStates) {
    ticks(30);
    for (const std::int64_t latch : {std::numeric_limits<std::int64_t>::min(), std::int64_t{-1}, std::int64_t{0},
                                     now_ns_ + 3600 * kSecond, std::numeric_limits<std::int64_t>::max()}) {
        state_.latch_time_ns = latch;
        writer_->publish(state_, now_ns_);
        telemetry_.poll(now_ns_);
    }
    state_.safety_state = 77;
    state_.faults = ~0u;
    state_.frame_sequence = ~std::uint64_t{0};
    tick(kMillisecond);
    const json device = message();
    EXPECT_EQ(device.at("state"), "unknown");
    EXPECT_EQ(device.at("faults").size(), fault_names(~0u).size());
    EXPECT_EQ(device.at("period_us").at("max"), 1000.0);
    EXPECT_EQ(device.at("unseen"), 5) << "they say nothing";
    now_ns_ -= 1;  // a latch that is no later than the one before
    tick(0);
    EXPECT_EQ(message().at("period_us").at("max"), 1000.0);
}

TEST(PublishTimesRing, NeverReturnTheTimeOfAnotherFrameDuringWrites) {
    PublishTimes times;
    constexpr std::uint64_t kFrames = 200'000;
    const auto time_of = [](std::uint64_t sequence) { return static_cast<std::int64_t>(sequence * 7919); };
    std::atomic<std::uint64_t> newest{0};
    std::thread writer([&] {
        for (std::uint64_t sequence = 1; sequence <= kFrames; ++sequence) {
            times.add(sequence, time_of(sequence));
            newest.store(sequence, std::memory_order_release);
        }
    });
    std::uint64_t found = 0;
    std::uint64_t wrong = 0;
    for (std::uint64_t last = 0; last < kFrames;) {
        last = newest.load(std::memory_order_acquire);
        for (const std::uint64_t back :
             {std::uint64_t{0}, std::uint64_t{3}, std::uint64_t{PublishTimes::kFrames - 1}}) {
            const std::uint64_t sequence = last > back ? last - back : 0;
            if (const auto time_ns = times.find(sequence)) {
                ++found;
                wrong += *time_ns == time_of(sequence) ? 0u : 1u;
            }
        }
    }
    writer.join();
    EXPECT_GE(found, 3u);
    EXPECT_EQ(wrong, 0u);
}

TEST_F(DeviceTelemetryTest, PlacesTheRegionOfTheSessionInTheScene) {
    ticks(30);
    const DeviceInScene device{.centre = Vec3(1.0, 2.0, 3.0), .orientation = Quat(0.0, 0.0, 1.0, 0.0), .scale = 50.0};
    EXPECT_TRUE(json::parse(telemetry_.message(now_ns_, device)).at("region").is_null()) << "no walls";
    const PublishedRegion published(session_.name(), {.semi_axes = Vec3(0.01, 0.02, 0.03), .angle = 0.25});
    const json region = json::parse(telemetry_.message(now_ns_, device)).at("region");
    EXPECT_THAT(region.at("centre"), ElementsAre(1.0, 2.0, 3.0));
    EXPECT_THAT(region.at("semi_axes"), ElementsAre(0.5, 1.0, 1.5));
    EXPECT_THAT(region.at("orientation"), ElementsAre(0.0, 0.0, 1.0, 0.0));
    EXPECT_EQ(region.at("angle_rad"), 0.25);
    EXPECT_TRUE(message().at("region").is_null()) << "no scene yet";
}

}  // namespace
}  // namespace haptic::sim::view
