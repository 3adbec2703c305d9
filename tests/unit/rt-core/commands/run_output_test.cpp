#include "commands/run_output.hpp"

#include <gtest/gtest.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace haptic::rt {
namespace {

/// A log that blocks until it is let go, as a pipe whose reader has stopped.
class BlockedLog final : public spdlog::sinks::base_sink<std::mutex> {
  public:
    std::atomic<bool> blocked{true};
    std::vector<std::string> lines;

  protected:
    void sink_it_(const spdlog::details::log_msg& line) override {
        blocked.wait(true);
        lines.emplace_back(line.payload.begin(), line.payload.end());
    }
    void flush_() override {}
};

class RunOutputTest : public testing::Test {
  protected:
    void SetUp() override { spdlog::default_logger()->sinks() = {log}; }
    void TearDown() override { spdlog::default_logger()->sinks() = before; }

    std::shared_ptr<BlockedLog> log = std::make_shared<BlockedLog>();
    std::vector<spdlog::sink_ptr> before = spdlog::default_logger()->sinks();
};

TEST_F(RunOutputTest, HoldsUpNobodyWhoLogsAndSaysHowManyLinesWereDropped) {
    constexpr int lines = 5000;
    const StopSignals signals;
    const RunOutput output;
    for (int i = 0; i < lines; ++i) {
        spdlog::info("{}", i);
    }
    log->blocked = false;
    log->blocked.notify_all();
    EXPECT_EQ(output.finish(signals, 7), 7);
    // The oldest ones are kept, in order, and the gap is named where it is.
    ASSERT_EQ(log->lines.size(), 1001u);
    EXPECT_EQ(log->lines[0], "0");
    EXPECT_EQ(log->lines[999], "999");
    EXPECT_EQ(log->lines[1000], std::to_string(lines - 1000) + " lines of this log were dropped");
}

TEST_F(RunOutputTest, LeavesALogThatStaysBlocked) {
    const auto begin = std::chrono::steady_clock::now();
    {
        const RunOutput output;
        spdlog::info("first");
    }
    spdlog::info("second");  // does not block either
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
    log->blocked = false;
    log->blocked.notify_all();
}

}  // namespace
}  // namespace haptic::rt
