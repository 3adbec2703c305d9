#include "process/frame_thread.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <thread>

#include "haptic/clock.hpp"
#include "rendering/floor_frame.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kTakeNs = 1'000'000;

/// Offers frames with 1 to kMaxProxies proxies, by their number, so that the rows tell whether all of one frame is
/// seen.
class NumberedFrames final : public FrameSource {
  public:
    /// From any thread: the newest frame has this number.
    void offer(std::uint64_t number) { newest_.store(number); }
    /// From any thread: defective frames from now on.
    void spoil() { spoilt_.store(true); }

    [[nodiscard]] bool read_newest(ContactFrame& frame) HAPTIC_RT override {
        const std::uint64_t number = newest_.load();
        if (number == read_) {
            return false;
        }
        read_ = number;
        frame = test::floor_frame(0.0, 100.0, 0);
        frame.sequence = number;
        frame.proxy_count = proxies_of(number);
        for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
            frame.proxies[i] = frame.proxies[0];
        }
        if (spoilt_.load()) {
            frame.stiffness = std::numeric_limits<double>::quiet_NaN();
        }
        return true;
    }

    static std::uint32_t proxies_of(std::uint64_t number) {
        return 1 + static_cast<std::uint32_t>(number % kMaxProxies);
    }

  private:
    std::atomic<std::uint64_t> newest_{0};
    std::atomic<bool> spoilt_{false};
    std::uint64_t read_ = 0;
};

/// Takes frames every period, as a tick does.
class FrameThreadTest : public testing::Test {
  protected:
    bool take() { return thread_.take(inbox_, monotonic_now_ns()); }
    /// Takes until there is a frame, for ten seconds at most.
    bool take_next() {
        for (int i = 0; i < 10'000; ++i) {
            if (take()) {
                return true;
            }
            std::this_thread::sleep_for(std::chrono::nanoseconds(kTakeNs));
        }
        return false;
    }

    NumberedFrames source_;
    std::unique_ptr<PreparedFrame> own_ = std::make_unique<PreparedFrame>();
    PreparedFrame* inbox_ = own_.get();
    FrameThread thread_{{.period_ns = kTakeNs}, source_};
};

TEST_F(FrameThreadTest, LeavesTheInboxAsItIsWithoutAFrame) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_FALSE(take());
    EXPECT_EQ(inbox_, own_.get());
}

TEST_F(FrameThreadTest, GivesEachFrameOncePreparedAndInExchangeForTheInbox) {
    for (std::uint64_t number = 1; number <= 20; ++number) {
        source_.offer(number);
        const PreparedFrame* const before = inbox_;
        ASSERT_TRUE(take_next());
        EXPECT_NE(inbox_, before);
        EXPECT_EQ(inbox_->frame.sequence, number);
        EXPECT_EQ(inbox_->defect(), FrameDefect::None);
        EXPECT_EQ(inbox_->row_count(), NumberedFrames::proxies_of(number));
        EXPECT_FALSE(take());
    }
}

TEST_F(FrameThreadTest, PreviewsFramesFromTheEndOfTheLastTick) {
    FrameStart start;
    start.grip.position = Vec3(0.0, -0.002, 0.0);
    for (std::uint64_t number = 1; number <= 5; ++number) {
        start.time_ns = static_cast<std::int64_t>(number);
        thread_.expect(start);
        source_.offer(number);
        ASSERT_TRUE(take_next());
        const FramePreview* const preview = inbox_->preview_from(start);
        ASSERT_NE(preview, nullptr);
        EXPECT_NEAR(preview->wrench.force.y, 0.002, 1e-15) << "per stiffness";
        start.time_ns = -1;
        EXPECT_EQ(inbox_->preview_from(start), nullptr);
    }
}

TEST_F(FrameThreadTest, SaysOfADefectiveFrameThatItIsOne) {
    source_.spoil();
    source_.offer(1);
    ASSERT_TRUE(take_next());
    EXPECT_EQ(inbox_->defect(), FrameDefect::NonFinite);
}

TEST_F(FrameThreadTest, NeverGivesAnOlderFrameNorAMixtureHoweverFastTheyCome) {
    std::atomic<bool> done{false};
    std::thread writer([&] {
        for (std::uint64_t number = 1; !done.load(); ++number) {
            source_.offer(number);
        }
    });
    std::uint64_t last = 0;
    int taken = 0;
    for (int i = 0; i < 1'000'000 && taken < 100; ++i) {
        if (!take()) {
            std::this_thread::yield();
            continue;
        }
        ++taken;
        EXPECT_GT(inbox_->frame.sequence, last);
        last = inbox_->frame.sequence;
        EXPECT_EQ(inbox_->proxies(), NumberedFrames::proxies_of(last));
        EXPECT_EQ(inbox_->row_count(), NumberedFrames::proxies_of(last));
    }
    done.store(true);
    writer.join();
    EXPECT_GT(taken, 0);
}

}  // namespace
}  // namespace haptic::rt
