// An observer of writers that end in an orderly way or are killed, with the segment removed and recreated in between:
// it sees only complete frames, and no writer is affected.
#include <gtest/gtest.h>
#include <sched.h>

#include <atomic>
#include <csignal>
#include <memory>
#include <random>
#include <set>

#include "haptic/ring_observer.hpp"
#include "ring_pattern.hpp"
#include "ring_session.hpp"

namespace haptic {
namespace {

using test::is_whole;
using test::PatternWriter;
using test::RingSession;
using test::Shared;
using test::start_process;
using test::wait_for;

constexpr int kWriters = 60;

/// An observer that checks every slot.
class Watch {
  public:
    explicit Watch(const std::string& session) : observer_(session) {}

    /// Reads all available slots, then checks for a new segment as if a long time had passed.
    void look() {
        while (observer_.next(*frame_)) {
            torn_ += is_whole(*frame_) ? 0u : 1u;
            not_rising_ += frame_->sequence > last_ ? 0u : 1u;
            last_ = frame_->sequence;
            sessions_.insert(frame_->session);
        }
        const std::uint64_t before = observer_.counts().segments;
        observer_.attend(now_ns_ += kRingAttendNs);
        last_ = observer_.counts().segments == before ? last_ : 0;
    }
    [[nodiscard]] const RingObserver<ContactFrame>& observer() const { return observer_; }
    [[nodiscard]] std::uint64_t torn() const { return torn_; }
    [[nodiscard]] std::uint64_t not_rising() const { return not_rising_; }
    [[nodiscard]] std::size_t sessions() const { return sessions_.size(); }

  private:
    RingObserver<ContactFrame> observer_;
    std::unique_ptr<ContactFrame> frame_ = std::make_unique<ContactFrame>();
    std::int64_t now_ns_ = 0;
    std::uint64_t last_ = 0;
    std::uint64_t torn_ = 0;
    std::uint64_t not_rising_ = 0;
    std::set<std::uint64_t> sessions_;
};

struct Orders {
    std::atomic<bool> end{false};
    std::atomic<std::uint64_t> published{0};
};

int publish_until_told(const std::string& session, Orders& orders) {
    PatternWriter<ContactFrame> writer(session);
    auto frame = std::make_unique<ContactFrame>();
    while (!orders.end.load()) {
        writer.publish_pattern(*frame, 0);
        orders.published.fetch_add(1);
        sched_yield();
    }
    return 0;
}

TEST(RingObserverProcesses, SeesOnlyWholeFramesWhateverBecomesOfTheWriters) {
    const RingSession session;
    const Shared<Orders> orders;
    Watch watch(session.name());
    std::mt19937 random(5);
    int removed = 0;
    for (int i = 0; i < kWriters; ++i) {
        orders->end = false;
        orders->published = 0;
        const pid_t writer = start_process([&] { return publish_until_told(session.name(), *orders); });
        const std::uint64_t enough = 1 + random() % 200;
        while (orders->published.load() < enough || watch.sessions() < static_cast<std::size_t>(i + 1)) {
            watch.look();
            sched_yield();
        }
        const bool in_order = random() % 2 == 0;
        orders->end = in_order;
        ASSERT_TRUE(in_order || kill(writer, SIGKILL) == 0);
        const int status = wait_for(writer);
        ASSERT_TRUE(in_order ? WIFEXITED(status) && WEXITSTATUS(status) == 0 : WIFSIGNALED(status)) << status;
        watch.look();
        EXPECT_EQ(session.exists(RingKind::Contact), !in_order) << "the observer keeps nothing and removes nothing";
        removed += in_order ? 1 : 0;
        EXPECT_FALSE(watch.observer().has_writer());
    }
    EXPECT_EQ(watch.torn(), 0u);
    EXPECT_EQ(watch.not_rising(), 0u);
    EXPECT_EQ(watch.sessions(), static_cast<std::size_t>(kWriters)) << "each writer was heard";
    EXPECT_GE(watch.observer().counts().segments, static_cast<std::uint64_t>(removed));
}

}  // namespace
}  // namespace haptic
