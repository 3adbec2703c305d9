// Many, dead, slow, misbehaving and short-lived viewers: the run continues, well-behaved viewers are served, and
// nothing of the others remains. No claims about time: on a busy machine a step can be late for many reasons.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "process.hpp"
#include "unique_session.hpp"
#include "view_client.hpp"

namespace haptic::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::size_t kHundred = 100;
constexpr std::size_t kDead = 20;
constexpr std::uint64_t kSome = 20;  // frames that show that the stream is alive
constexpr std::size_t kMegabyte = 1'000'000;

class ViewCrowd : public testing::Test {
  protected:
    ViewCrowd() {
        if (sim_.wait_for_text("the live view is at", seconds(20))) {
            port_ = view_port_in(sim_.output()).value_or(0);
        }
    }
    void SetUp() override { ASSERT_NE(port_, 0) << sim_.output(); }

    std::unique_ptr<ViewClient> viewer(int receive_buffer = 0) {
        return std::make_unique<ViewClient>(port_, receive_buffer);
    }
    /// Whether this viewer receives more frames while the others read theirs.
    bool is_served(ViewClient& good, const ViewClients& others = {}) {
        std::vector<ViewClient*> all{&good};
        for (const auto& other : others) {
            all.push_back(other.get());
        }
        const std::uint64_t before = good.frames();
        return take_until(all, seconds(20), [&] { return good.frames() >= before + kSome; });
    }
    /// Whether the process reaches this number of open descriptors while one viewer continues to read.
    bool comes_to_descriptors(std::size_t wanted, ViewClient& good) {
        return take_until({&good}, seconds(20), [&] { return open_descriptors(sim_.pid()) == wanted; });
    }
    /// The run ends cleanly on request, having made steps until then.
    void expect_sound_end(ViewClient& good) {
        const double before = good.step();
        EXPECT_TRUE(is_served(good)) << "at the end as at the beginning";
        EXPECT_GT(good.step(), before);
        sim_.signal(SIGINT);
        EXPECT_TRUE(take_until({&good}, seconds(10), [&] { return good.closed(); }));
        EXPECT_EQ(good.count("bye"), 1u);
        ASSERT_EQ(sim_.wait_for(seconds(10)), 0) << sim_.output();
        const auto report = nlohmann::json::parse(std::ifstream(folder_ / "report.json"));
        EXPECT_GE(report.at("steps").get<double>(), good.step());
        EXPECT_EQ(report.at("contact").at("escapes"), 0);
    }

    ScratchFolder folder_;
    std::uint16_t port_ = 0;
    Process sim_{{HOST_SIM, "run", "four-fish", "--view", "127.0.0.1:0", "--clock", "real", "--session",
                  unique_session(), "--duration", "0", "--verify", "--report", folder_ / "report.json"},
                 folder_ / "host-sim.log"};
};

TEST_F(ViewCrowd, ServesAHundredViewersAndReleasesTheirResources) {
    auto good = viewer();
    ASSERT_TRUE(is_served(*good));
    const std::size_t descriptors = open_descriptors(sim_.pid());
    const std::size_t memory = resident_bytes(sim_.pid());
    for (int round = 0; round < 3; ++round) {
        ViewClients crowd;
        std::vector<ViewClient*> all;
        for (std::size_t i = 0; i < kHundred - 1; ++i) {
            crowd.push_back(viewer());
            all.push_back(crowd.back().get());
        }
        EXPECT_TRUE(take_until(all, seconds(60), [&] {
            return std::all_of(crowd.begin(), crowd.end(), [](const auto& each) { return each->frames() >= 3; });
        })) << "each sees the scene move";
        for (const auto& each : crowd) {
            EXPECT_EQ(each->count("scene"), 1u);
            EXPECT_EQ(each->count("geometry"), 1u);
        }
        EXPECT_TRUE(is_served(*good, crowd));
        crowd.clear();
        EXPECT_TRUE(comes_to_descriptors(descriptors, *good));
        // A frame of four-fish has some 50 kB; each connection holds at most one.
        EXPECT_LT(resident_bytes(sim_.pid()), memory + 60 * kMegabyte);
    }
    expect_sound_end(*good);
}

TEST_F(ViewCrowd, ClosesViewersThatDoNotReadWithoutDelayingOthers) {
    auto good = viewer();
    ASSERT_TRUE(is_served(*good));
    const std::size_t descriptors = open_descriptors(sim_.pid());
    const std::size_t memory = resident_bytes(sim_.pid());
    ViewClients dead;  // like a stopped browser: connected, never reading
    for (std::size_t i = 0; i < kDead; ++i) {
        dead.push_back(viewer(4096));
    }
    ASSERT_TRUE(
        take_until({good.get()}, seconds(20), [&] { return open_descriptors(sim_.pid()) == descriptors + kDead; }));
    std::size_t peak = 0;
    for (int i = 0; i < 10; ++i) {
        ASSERT_TRUE(is_served(*good));
        peak = std::max(peak, resident_bytes(sim_.pid()));
    }
    EXPECT_LT(peak, memory + 20 * kMegabyte) << "200 frames more would be 10 MB for each of the dead";
    EXPECT_TRUE(comes_to_descriptors(descriptors, *good)) << "in the end they are let go";
    expect_sound_end(*good);
}

TEST_F(ViewCrowd, IncompleteHandshakesDelayNobody) {
    auto good = viewer();
    ASSERT_TRUE(is_served(*good));
    const std::size_t descriptors = open_descriptors(sim_.pid());
    std::vector<std::unique_ptr<Socket>> halves;
    for (std::size_t i = 0; i < kDead; ++i) {
        halves.push_back(std::make_unique<Socket>(port_));  // sends nothing at all
        halves.push_back(std::make_unique<Socket>(port_));
        halves.back()->send("GET / HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port_) + "\r\nX-Slow: ");
        halves.push_back(std::make_unique<Socket>(port_));
        halves.back()->send("GET /stream HTTP/1.1\r\nUpgrade: websocket\r\nSec-WebSocket-Key: ");
    }
    // An endless header, byte by byte.
    for (int i = 0; i < 10; ++i) {
        for (const auto& half : halves) {
            half->send("x");
        }
        ASSERT_TRUE(is_served(*good));
    }
    auto late = viewer();
    EXPECT_TRUE(is_served(*late)) << "there is room for who comes now";
    late.reset();
    halves.clear();
    EXPECT_TRUE(comes_to_descriptors(descriptors, *good));
    expect_sound_end(*good);
}

TEST_F(ViewCrowd, ReleasesTheResourcesOfShortLivedConnections) {
    auto good = viewer();
    ASSERT_TRUE(is_served(*good));
    const std::size_t descriptors = open_descriptors(sim_.pid());
    const std::size_t memory = resident_bytes(sim_.pid());
    for (int i = 0; i < 300; ++i) {
        switch (i % 3) {
            case 0: {
                Socket nothing_said(port_);
                nothing_said.reset();
                break;
            }
            case 1:
                static_cast<void>(viewer());  // closed before the answer
                break;
            default: {
                auto each = viewer();
                take_until({each.get(), good.get()}, seconds(5), [&] { return each->count("scene") == 1; });
            }  // gone in the middle of its geometry
        }
        good->take();
    }
    EXPECT_TRUE(is_served(*good));
    EXPECT_TRUE(comes_to_descriptors(descriptors, *good));
    EXPECT_LT(resident_bytes(sim_.pid()), memory + 20 * kMegabyte);
    expect_sound_end(*good);
}

TEST_F(ViewCrowd, ClosesAMisbehavingViewerWithoutAffectingOthers) {
    auto good = viewer();
    ASSERT_TRUE(is_served(*good));
    // Sent in fragments while the geometry is still being received.
    const auto closed_with = [&](const std::string& text) {
        auto rude = viewer();
        EXPECT_TRUE(take_until({rude.get(), good.get()}, seconds(10), [&] { return rude->count("scene") == 1; }));
        rude->say(text);
        EXPECT_TRUE(take_until({rude.get(), good.get()}, seconds(10), [&] { return rude->closed(); })) << text;
        return rude->close_code();
    };
    EXPECT_EQ(closed_with("{"), 1008);
    EXPECT_EQ(closed_with(R"({"type":"format","disk":"c:"})"), 1008);
    EXPECT_EQ(closed_with(std::string(2000, ' ')), 1008);
    // Without --view-control a pause is refused; that does not close the connection.
    good->say(R"({"type":"pause","on":true})");
    EXPECT_TRUE(take_until({good.get()}, seconds(10), [&] { return good->count("refused") == 1; }));
    expect_sound_end(*good);
}

TEST_F(ViewCrowd, RejectsViewersBeyondTheLimit) {
    auto good = viewer();
    ASSERT_TRUE(is_served(*good));
    ViewClients crowd;
    std::vector<ViewClient*> all{good.get()};
    for (std::size_t i = 0; i < 200; ++i) {
        crowd.push_back(viewer());
        all.push_back(crowd.back().get());
    }
    EXPECT_TRUE(take_until(all, seconds(60), [&] {
        return std::all_of(crowd.begin(), crowd.end(),
                           [](const auto& each) { return each->status() != 0 || each->closed(); });
    }));
    const auto refused = std::count_if(crowd.begin(), crowd.end(), [](const auto& each) { return !each->open(); });
    EXPECT_GT(refused, 0);
    EXPECT_LE(refused, 200 - static_cast<std::ptrdiff_t>(kHundred - 1));
    EXPECT_TRUE(is_served(*good, crowd));
    crowd.clear();
    expect_sound_end(*good);
}

}  // namespace
}  // namespace haptic::test
