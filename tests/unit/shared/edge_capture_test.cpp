#include "haptic/edge_capture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <span>
#include <thread>
#include <vector>

#include "fake_lines.hpp"

namespace haptic {
namespace {

using test::FakeEdges;
using test::FakeWire;

constexpr auto kLeave = [](std::span<const Edge> /*edges*/) {};

TEST(EdgeCapture, TakesEveryEdgeInItsOrderWhateverComesWhileItStops) {
    constexpr int kEdges = 20'000;
    const auto wire = std::make_unique<FakeWire>();
    std::vector<Edge> taken;
    EdgeCapture capture(std::make_unique<FakeEdges>(*wire),
                        [&](std::span<const Edge> edges) { taken.insert(taken.end(), edges.begin(), edges.end()); });
    for (int i = 0; i < kEdges; ++i) {
        wire->set(i % 2 == 0);
    }
    capture.stop();
    capture.stop();
    ASSERT_EQ(taken.size(), static_cast<std::size_t>(kEdges));
    EXPECT_TRUE(std::equal(taken.begin(), taken.end(), wire->edges().begin(), [](const Edge& a, const Edge& b) {
        return a.time_ns == b.time_ns && a.rising == b.rising;
    }));
    EXPECT_EQ(capture.problem(), "");
}

TEST(EdgeCapture, SaysWhyALineCouldNotBeReadAnyMore) {
    const auto wire = std::make_unique<FakeWire>();
    wire->broken = true;
    EdgeCapture capture(std::make_unique<FakeEdges>(*wire), kLeave);
    capture.stop();
    EXPECT_THAT(capture.problem(), testing::HasSubstr("reading a wire"));
}

TEST(EdgeCapture, PreparesItsThreadAndNoOther) {
    const auto wire = std::make_unique<FakeWire>();
    std::thread::id prepared;
    EdgeCapture capture(std::make_unique<FakeEdges>(*wire), kLeave,
                        [&prepared] { prepared = std::this_thread::get_id(); });
    capture.stop();
    EXPECT_NE(prepared, std::thread::id());
    EXPECT_NE(prepared, std::this_thread::get_id());
}

}  // namespace
}  // namespace haptic
