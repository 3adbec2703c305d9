// Two processes pass millions of checksummed frames through a ring at full speed: none is torn, repeated or out of
// order.
#include <gtest/gtest.h>
#include <sched.h>

#include <atomic>
#include <cstdio>
#include <memory>
#include <random>

#include "haptic/ring.hpp"
#include "ring_pattern.hpp"
#include "ring_session.hpp"

namespace haptic {
namespace {

using test::fill;
using test::is_whole;
using test::PatternWriter;
using test::RingSession;
using test::Shared;
using test::start_process;
using test::wait_for;

struct Progress {
    std::atomic<std::uint64_t> taken{0};  // sequence of the last frame read
    std::atomic<bool> enough{false};
    std::atomic<std::uint64_t> published{0};
};

/// Spins for a while, because the wait is usually a few hundred nanoseconds, then yields.
class SpinWait {
  public:
    void pause() {
        if (++spins_ % kSpins == 0) {
            sched_yield();
        }
    }

  private:
    static constexpr unsigned kSpins = 128;
    unsigned spins_ = 0;
};

/// Publishes bursts of up to 16 frames without pause, twice around the ring, then lets the reader take one, so that
/// both make progress on a single core, too. The ring itself never waits.
template <class Slot>
int publish_until_enough(const std::string& session, Progress& progress) {
    PatternWriter<Slot> writer(session);
    std::mt19937 random(7);
    auto slot = std::make_unique<Slot>();
    std::uint64_t sequence = 0;
    SpinWait wait;
    while (!progress.enough.load()) {
        const std::uint64_t burst_begin = sequence;
        for (std::uint64_t left = 1 + random() % 16; left > 0; --left) {
            sequence = writer.publish_pattern(*slot, 0);
        }
        while (progress.taken.load() <= burst_begin && !progress.enough.load()) {
            wait.pause();
        }
    }
    progress.published.store(sequence);
    return 0;
}

/// Reads `wanted` frames, then the remaining one, and checks each completely.
template <class Slot>
void expect_whole_frames(std::uint64_t wanted) {
    const RingSession session;
    const Shared<Progress> progress;
    RingReader<Slot> reader(session.name());
    const pid_t writer = start_process([&] { return publish_until_enough<Slot>(session.name(), *progress); });
    auto slot = std::make_unique<Slot>();
    std::uint64_t torn = 0;
    std::uint64_t not_rising = 0;
    std::uint64_t first = 0;
    std::uint64_t last = 0;
    const auto take = [&] {
        if (!reader.read_newest(*slot)) {
            return false;
        }
        torn += is_whole(*slot) ? 0u : 1u;
        not_rising += slot->sequence > last ? 0u : 1u;
        first = first == 0 ? slot->sequence : first;
        last = slot->sequence;
        progress->taken.store(last);
        return true;
    };
    SpinWait wait;
    for (std::uint64_t taken = 0; taken < wanted;) {
        if (take()) {
            ++taken;
        } else {
            wait.pause();
        }
    }
    progress->enough.store(true);
    EXPECT_EQ(wait_for(writer), 0);
    take();
    EXPECT_EQ(torn, 0u);
    EXPECT_EQ(not_rising, 0u);
    EXPECT_EQ(last, progress->published.load()) << "the last frame must be seen";
    EXPECT_EQ(reader.counts().frames + reader.counts().skipped, last - first + 1) << "each frame is counted once";
    testing::Test::RecordProperty("published", std::to_string(progress->published.load()));
    testing::Test::RecordProperty("overtaken", std::to_string(reader.counts().overtaken));
    std::printf("%llu frames taken of %llu published; %llu copies were overtaken and thrown away\n",
                static_cast<unsigned long long>(reader.counts().frames),
                static_cast<unsigned long long>(progress->published.load()),
                static_cast<unsigned long long>(reader.counts().overtaken));
}

TEST(RingTwoProcesses, TenMillionDeviceStatesArriveWhole) {
    expect_whole_frames<DeviceState>(HAPTIC_TEST_FRAMES);
}

TEST(RingTwoProcesses, AMillionFullContactFramesArriveWhole) {
    expect_whole_frames<ContactFrame>(HAPTIC_TEST_FRAMES / 10);
}

/// Verifies the checker: it must reject invalid frames.
TEST(RingTwoProcesses, ATornFrameWouldBeNoticed) {
    auto frame = std::make_unique<ContactFrame>();
    frame->session = 5;
    frame->sequence = 41;
    fill(*frame, 41, 5);
    ASSERT_TRUE(is_whole(*frame));
    auto other = std::make_unique<ContactFrame>(*frame);
    fill(*other, 41 + kRingSlots, 5);
    for (const std::size_t proxy : {0u, 31u, 63u}) {
        auto torn = std::make_unique<ContactFrame>(*frame);
        torn->proxies[proxy].position[1] = other->proxies[proxy].position[1];
        EXPECT_FALSE(is_whole(*torn));
    }
    frame->proxy_count -= 1;
    EXPECT_FALSE(is_whole(*frame));
}

}  // namespace
}  // namespace haptic
