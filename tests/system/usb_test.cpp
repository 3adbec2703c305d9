// rt-core --device usb: the executable with unmodified libusb, on boards of umockdev's usbfs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "fake_usbfs.hpp"
#include "haptic/csv.hpp"
#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::chrono::seconds kLong{30};
constexpr std::array<std::int16_t, kStrings> kZeros{};

class RtCoreUsb : public testing::Test {
  protected:
    void SetUp() override {
        if (run({RT_CORE, "run", "--session", session, "--duration", "0.01"}).output.find("degraded") !=
            std::string::npos) {
            GTEST_SKIP() << "a real device is not driven without real-time privileges";
        }
    }
    void TearDown() override { EXPECT_THAT(segments_of(session), IsEmpty()); }

    /// Ticks of 10 ms and a long exchange limit: each request goes through another process here.
    [[nodiscard]] std::vector<std::string> command(const std::vector<std::string>& more) const {
        std::vector<std::string> words = {RT_CORE, "run", "--session", session, "--device", "usb"};
        for (const char* assignment :
             {"loop.period_s=0.01", "loop.warm_up_ticks=5", "device.usb_timeout_s=0.1", "device.exchanges=one",
              "safety.tension_ramp_s=0.1", "safety.calibration_hold_s=0.05", "safety.late_share=1",
              "safety.encoder_age_s=0.5", "safety.prove=never", "safety.watchdog_s=2"}) {
            words.insert(words.end(), {"--set", assignment});
        }
        words.insert(words.end(), more.begin(), more.end());
        return words;
    }
    [[nodiscard]] nlohmann::json report() const { return nlohmann::json::parse(std::ifstream(folder / "run.json")); }

    ScratchFolder folder;
    std::string session = unique_session();
    FakeUsbfs bus;
    std::string report_file = folder / "run.json";
    std::string log = folder / "log.txt";
};

TEST_F(RtCoreUsb, DrivesABoardAndLeavesItsMotorsAtZero) {
    FakeUsbBoard& board = bus.plug({});
    Process process(command({"--report", report_file}), log);
    ASSERT_TRUE(process.wait_for_text("running", kLong)) << process.output();
    EXPECT_NE(board.dac_codes(), kZeros);
    process.signal(SIGINT);
    EXPECT_EQ(process.wait_for(kLong), 0) << process.output();
    EXPECT_EQ(board.dac_codes(), kZeros);
    EXPECT_THAT(process.output(), HasSubstr("a SpidarG6X3R, 0cec:0205 at 1-1 (/dev/bus/usb/001/002)"));
    const nlohmann::json exchange = report().at("exchange");
    EXPECT_GT(exchange.at("statuses").at("ok"), 10);
    EXPECT_EQ(exchange.at("statuses").at("disconnected"), 0);
    EXPECT_EQ(exchange.at("bound_us"), 200'000.0) << "two transfers of 0.1 s";
}

TEST_F(RtCoreUsb, SendsItsForceInTheSameTickByASecondExchange) {
    FakeUsbBoard& board = bus.plug({});
    std::vector<std::string> words = command({"--report", report_file, "--duration", "0.3"});
    words.insert(words.end(), {"--set", "device.exchanges=two"});
    Process process(words, log);
    EXPECT_EQ(process.wait_for(kLong), 0) << process.output();
    const nlohmann::json result = report();
    EXPECT_EQ(result.at("exchange").at("bound_us"), 400'000.0);
    EXPECT_GE(board.commands(), 2 * result.at("ticks").get<int>());
}

TEST_F(RtCoreUsb, RefusesAPeriodThatCannotHoldItsExchangesAndSaysWhatWould) {
    FakeUsbBoard& board = bus.plug({.speed_mbit = 12});
    std::vector<std::string> words = command({"--duration", "0.3"});
    words.insert(words.end(), {"--set", "device.exchanges=two", "--set", "loop.period_s=0.001"});
    Process process(words, log);
    EXPECT_EQ(process.wait_for(kLong), 2) << process.output();
    EXPECT_THAT(process.output(),
                AllOf(HasSubstr("loop.period_s: a period of 1000.0 us cannot hold its two exchanges with USB at 12 "
                                "Mbit/s, which take 1642.7 us"),
                      HasSubstr("What would hold: loop.period_s of at least 2050.0 us (487 Hz); or a link of 480")));
    EXPECT_EQ(board.dac_codes(), kZeros);
}

TEST_F(RtCoreUsb, PrintsWhereThePeriodGoesAndReportsItBesideWhatWasMeasured) {
    bus.plug({});
    Process process(command({"--report", report_file, "--duration", "0.3"}), log);
    EXPECT_EQ(process.wait_for(kLong), 0) << process.output();
    EXPECT_THAT(process.output(), AllOf(HasSubstr("a period of 10000.0 us with USB at 480 Mbit/s: holds"),
                                        HasSubstr("  exchanges       125.0 us  1 of 512 bytes out, 512 in")));
    const nlohmann::json budget = report().at("period_budget");
    EXPECT_EQ(budget.at("needs_us").at("exchanges"), 125.0);
    EXPECT_EQ(budget.at("verdict"), "holds");
    const nlohmann::json& measured = budget.at("measured_p999_us");
    EXPECT_GT(measured.at("exchanges"), 0.0);
    EXPECT_GE(measured.at("tick"), measured.at("exchanges"));
    EXPECT_NEAR(measured.at("reserve").get<double>(),
                10000.0 - measured.at("wakeup").get<double>() - measured.at("tick").get<double>(), 1e-6);
}

TEST_F(RtCoreUsb, EndsInANamedFaultWhenTheCableIsPulled) {
    FakeUsbBoard& board = bus.plug({});
    Process process(command({"--report", report_file}), log);
    ASSERT_TRUE(process.wait_for_text("running", kLong)) << process.output();
    bus.remove(board);
    EXPECT_EQ(process.wait_for(kLong), 3) << process.output();
    EXPECT_THAT(process.output(), HasSubstr("FAULT: exchange (disconnected)"));
    EXPECT_EQ(report().at("safety").at("faults"), nlohmann::json({"exchange"}));
    EXPECT_EQ(report().at("exchange").at("last_failure"), "disconnected");
    EXPECT_GT(CsvTable::load(folder / "run.fault.csv").rows(), 10u);
}

TEST_F(RtCoreUsb, GoesOnWhenTheDeviceIsPluggedInAgainAndAPersonHoldsTheButton) {
    FakeUsbBoard& board = bus.plug({});
    const std::string recording = folder / "run.csv";
    Process process(
        command({"--report", report_file, "--record", recording, "--reconnect", "--set", "safety.arm_button=2"}), log);
    ASSERT_TRUE(process.wait_for_text("rt-core info: running", kLong)) << process.output();
    bus.remove(board);
    ASSERT_TRUE(process.wait_for_text("not yet: no USB device 0cec:0205", kLong)) << process.output();
    FakeUsbBoard& again = bus.plug({.number = 3});
    ASSERT_TRUE(process.wait_for_text("/dev/bus/usb/001/003) is back", kLong)) << process.output();
    ASSERT_TRUE(process.wait_for_text("hold button 2 of the board for 1 s", kLong)) << process.output();
    for (int i = 0; i < 70; ++i) {
        ASSERT_EQ(again.dac_codes(), kZeros) << "nothing pulls until a person acts";
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    again.hold_buttons(0b100);
    ASSERT_TRUE(process.wait_for_text("armed by a person (button)", kLong)) << process.output();
    for (int i = 0; i < 3000 && again.dac_codes() == kZeros; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_NE(again.dac_codes(), kZeros) << "it tightens the strings again";
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    process.signal(SIGINT);
    EXPECT_EQ(process.wait_for(kLong), 0) << process.output();
    EXPECT_EQ(again.dac_codes(), kZeros);
    const nlohmann::json result = report();
    ASSERT_EQ(result.at("interruptions").size(), 1U);
    const nlohmann::json& interruption = result.at("interruptions").at(0);
    EXPECT_EQ(interruption.at("faults"), nlohmann::json({"exchange"}));
    EXPECT_EQ(interruption.at("cause"), "disconnected");
    EXPECT_EQ(interruption.at("black_box"), (folder / "run.fault.csv").string());
    EXPECT_EQ(result.at("safety").at("faults"), nlohmann::json({"stop"}));
    EXPECT_THAT(process.output(), HasSubstr("interrupted at"));
    EXPECT_GT(CsvTable::load(folder / "run.fault.csv").rows(), 10u);
    // Measurements of both runs, without the time in between.
    EXPECT_GT(result.at("exchange").at("statuses").at("ok"), 20);
    EXPECT_GT(result.at("exchange").at("statuses").at("disconnected"), 0);
    const CsvTable ticks = CsvTable::load(recording);
    EXPECT_GT(ticks.column("time_s").back(),
              interruption.at("at_s").get<double>() + interruption.at("lost_s").get<double>());
}

TEST_F(RtCoreUsb, EndsWhileItWaitsForTheDevice) {
    FakeUsbBoard& board = bus.plug({});
    Process process(command({"--report", report_file, "--set", "safety.reconnect=true"}), log);
    ASSERT_TRUE(process.wait_for_text("rt-core info: running", kLong)) << process.output();
    bus.remove(board);
    ASSERT_TRUE(process.wait_for_text("not yet:", kLong)) << process.output();
    process.signal(SIGINT);
    EXPECT_EQ(process.wait_for(kLong), 3) << process.output();
    EXPECT_EQ(report().at("interruptions").size(), 1U);
    EXPECT_THAT(process.output(), HasSubstr("FAULT: exchange (disconnected)"));
}

TEST_F(RtCoreUsb, SendsZerosWhenItCrashes) {
    FakeUsbBoard& board = bus.plug({});
    Process process(command({}), log);
    ASSERT_TRUE(process.wait_for_text("running", kLong)) << process.output();
    EXPECT_NE(board.dac_codes(), kZeros);
    process.signal(SIGSEGV);
    EXPECT_EQ(process.wait_for(kLong), 128 + SIGSEGV);
    EXPECT_EQ(board.dac_codes(), kZeros);
    // The process leaves the session's segment; the next one removes it.
    EXPECT_EQ(run({RT_CORE, "run", "--session", session, "--duration", "0.01"}).status, 0);
}

TEST_F(RtCoreUsb, RefusesAnAmbiguousDeviceAndListsWhatThereIs) {
    bus.plug({});
    FakeUsbfs::Settings other;
    other.device.rotary = 4;
    other.port = "1-2";
    other.number = 3;
    bus.plug(other);
    const Finished ambiguous = run(command({"--duration", "0.1"}));
    EXPECT_EQ(ambiguous.status, 2);
    EXPECT_THAT(ambiguous.output, AllOf(HasSubstr("--device usb"), HasSubstr("rotary switch 0"),
                                        HasSubstr("rotary switch 4"), HasSubstr("device.rotary")));
    EXPECT_EQ(run(command({"--duration", "0.1", "--set", "device.rotary=4"})).status, 0);
}

}  // namespace
}  // namespace haptic::test
