#include "haptic/edge_capture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <thread>

#include "fake_lines.hpp"

namespace haptic {
namespace {

using test::FakeEdges;
using test::FakeWire;

TEST(EdgeCapture, TakesEveryEdgeInItsOrderWhateverComesWhileItStops) {
    constexpr int kEdges = 20'000;
    const auto wire = std::make_unique<FakeWire>();
    EdgeCapture capture(std::make_unique<FakeEdges>(*wire), kEdges);
    for (int i = 0; i < kEdges; ++i) {
        wire->set(i % 2 == 0);
    }
    capture.stop();
    capture.stop();
    ASSERT_EQ(capture.edges().size(), static_cast<std::size_t>(kEdges));
    EXPECT_TRUE(
        std::equal(capture.edges().begin(), capture.edges().end(), wire->edges().begin(),
                   [](const Edge& a, const Edge& b) { return a.time_ns == b.time_ns && a.rising == b.rising; }));
    EXPECT_EQ(capture.dropped(), 0u);
    EXPECT_EQ(capture.problem(), "");
}

TEST(EdgeCapture, CountsWhatFindsNoRoom) {
    const auto wire = std::make_unique<FakeWire>();
    for (int i = 0; i < 1000; ++i) {
        wire->set(i % 2 == 0);
    }
    EdgeCapture capture(std::make_unique<FakeEdges>(*wire), 300);
    capture.stop();
    ASSERT_EQ(capture.edges().size(), 300u);
    EXPECT_EQ(capture.edges().back().time_ns, wire->edges()[299].time_ns) << "the first ones are kept";
    EXPECT_EQ(capture.dropped(), 700u);
}

TEST(EdgeCapture, SaysWhyALineCouldNotBeReadAnyMore) {
    const auto wire = std::make_unique<FakeWire>();
    wire->broken = true;
    EdgeCapture capture(std::make_unique<FakeEdges>(*wire), 10);
    capture.stop();
    EXPECT_THAT(capture.problem(), testing::HasSubstr("reading a wire"));
}

TEST(EdgeCapture, PreparesItsThreadAndNoOther) {
    const auto wire = std::make_unique<FakeWire>();
    std::thread::id prepared;
    EdgeCapture capture(std::make_unique<FakeEdges>(*wire), 10, [&prepared] { prepared = std::this_thread::get_id(); });
    capture.stop();
    EXPECT_NE(prepared, std::thread::id());
    EXPECT_NE(prepared, std::this_thread::get_id());
}

}  // namespace
}  // namespace haptic
