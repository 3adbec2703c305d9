// Device messages to viewers, from a real rt-core.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>

#include "process.hpp"
#include "unique_session.hpp"
#include "view_client.hpp"

namespace haptic::test {
namespace {

using nlohmann::json;
using std::chrono::seconds;
using testing::IsEmpty;

class ViewDevice : public testing::Test {
  protected:
    std::unique_ptr<Process> start_rt_core(const std::string& name) {
        return std::make_unique<Process>(
            std::vector<std::string>{RT_CORE, "run", "--device", "emulated", "--session", session_, "--duration", "60"},
            folder_ / (name + ".log"));
    }
    void SetUp() override {
        ASSERT_TRUE(sim_.wait_for_text("the live view is at", seconds(20))) << sim_.output();
        viewer_ = std::make_unique<ViewClient>(view_port_in(sim_.output()).value());
    }
    /// Waits for a device message that satisfies the condition; it is the newest then.
    bool comes(const std::function<bool(const json&)>& is_so) {
        return take_until({viewer_.get()}, seconds(20), [&] {
            const std::string text = viewer_->newest("device");
            if (!text.empty()) {
                device_ = json::parse(text);
            }
            return !text.empty() && is_so(device_);
        });
    }

    ScratchFolder folder_;
    std::string session_ = unique_session();
    Process sim_{{HOST_SIM, "run", "cloth-drop", "--view", "127.0.0.1:0", "--session", session_},
                 folder_ / "host-sim.log"};
    std::unique_ptr<ViewClient> viewer_;
    json device_;
};

bool is_running(const json& device) {
    return device.at("connected") && device.at("state") == "running" && device.at("frame_age_ms").at("p50") > 0.0;
}

TEST_F(ViewDevice, ReportsRunningDyingAndReturning) {
    EXPECT_TRUE(comes([](const json& device) { return !device.at("connected").get<bool>(); }));
    EXPECT_EQ(device_.at("state"), "absent");

    auto rt = start_rt_core("first");
    ASSERT_TRUE(comes(is_running)) << device_ << rt->output() << sim_.output();
    EXPECT_THAT(device_.at("faults"), IsEmpty());
    EXPECT_GT(device_.at("rate_hz"), 0.0);
    // No claim about regularity: 1 ms ticks on a busy machine.
    EXPECT_GT(device_.at("period_us").at("p50"), 100.0);
    EXPECT_LT(device_.at("period_us").at("p50"), 10'000.0);
    const auto counts = device_.at("period_us").at("counts").get<std::vector<std::uint64_t>>();
    EXPECT_EQ(device_.at("period_us").at("edges").size(), counts.size() + 1);
    EXPECT_GT(std::accumulate(counts.begin(), counts.end(), std::uint64_t{0}), 0u);
    EXPECT_LE(device_.at("frame_age_ms").at("p50"), device_.at("frame_age_ms").at("max"));

    rt->signal(SIGKILL);
    EXPECT_EQ(rt->wait_for(seconds(10)), 128 + SIGKILL);
    EXPECT_TRUE(comes([](const json& device) { return device.at("state") == "absent"; })) << device_;

    rt = start_rt_core("second");
    EXPECT_TRUE(comes(is_running)) << device_;

    rt->signal(SIGINT);
    EXPECT_EQ(rt->wait_for(seconds(10)), 0) << rt->output();
    EXPECT_TRUE(comes([](const json& device) { return device.at("state") == "absent"; })) << device_;
    sim_.signal(SIGINT);
    EXPECT_EQ(sim_.wait_for(seconds(10)), 0) << sim_.output();
}

}  // namespace
}  // namespace haptic::test
