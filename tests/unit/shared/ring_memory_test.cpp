#include "ring_memory.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

namespace haptic::detail {
namespace {

constexpr std::size_t kWords = 40;
constexpr std::uint64_t kFrames = 200'000;
using Frame = std::array<std::uint64_t, kWords>;

/// Each word is determined by the frame's sequence and its index, so that a word of another frame is detected.
std::uint64_t word_of(std::uint64_t sequence, std::size_t i) {
    return (sequence * 0x9E3779B97F4A7C15 + i) * 0xD6E8FEB86659FD93;
}

Frame frame_of(std::uint64_t sequence) {
    Frame frame{};
    for (std::size_t i = 0; i < kWords; ++i) {
        frame[i] = word_of(sequence, i);
    }
    return frame;
}

/// A ring in ordinary memory, so that ThreadSanitizer sees both ends (it would treat two mappings of a segment as
/// different memory).
class RingMemoryTest : public testing::Test {
  protected:
    RingMemoryTest() { ring_.initialise(RingKind::Contact); }

    struct alignas(kCacheLine) Line {
        std::byte bytes[kCacheLine];
    };
    std::vector<Line> storage_{RingMemory::bytes(sizeof(Frame)) / kCacheLine};
    RingMemory ring_{storage_.data(), sizeof(Frame)};

    void publish(std::uint64_t sequence) {
        const Frame frame = frame_of(sequence);
        ring_.publish(sequence, frame.data(), sizeof frame, static_cast<std::int64_t>(sequence));
    }
    /// Slot of a sequence number.
    RingSlotHeader& slot_of(std::uint64_t sequence) {
        const std::size_t stride = (RingMemory::bytes(sizeof(Frame)) - sizeof(RingHeader)) / kRingSlots;
        auto* const base = reinterpret_cast<std::byte*>(storage_.data());
        return *reinterpret_cast<RingSlotHeader*>(base + sizeof(RingHeader) + (sequence % kRingSlots) * stride);
    }
};

TEST_F(RingMemoryTest, ATornFrameIsNotReturned) {
    publish(1);
    Frame out{};
    slot_of(1).stamp.store(2 * (1 + kRingSlots) - 1);  // the writer wrapped around and has started to overwrite it
    const RingMemory::Read read = ring_.read_newest(0, out.data());
    EXPECT_EQ(read.sequence, 0u);
    EXPECT_EQ(read.overtaken, static_cast<std::uint64_t>(kRingReadAttempts));
}

TEST_F(RingMemoryTest, AFrameThatItsWriterDiedInIsNotSeenAndWrittenAnew) {
    publish(1);
    // Frame 2, writer killed half-way: odd stamp, some new words.
    slot_of(2).stamp.store(3);
    slot_of(2).words.store(kWords);
    Frame out{};
    EXPECT_EQ(ring_.read_newest(0, out.data()).sequence, 1u);
    EXPECT_EQ(out, frame_of(1));
    publish(2);
    EXPECT_EQ(ring_.read_newest(1, out.data()).sequence, 2u);
    EXPECT_EQ(out, frame_of(2));
}

TEST_F(RingMemoryTest, AFrameThatIsCompleteButNotAnnouncedIsWrittenAnew) {
    publish(1);
    publish(2);
    ring_.header().progress.head.store(1);  // killed between the last stamp and head
    Frame out{};
    EXPECT_EQ(ring_.read_newest(0, out.data()).sequence, 1u);
    Frame second = frame_of(200);
    ring_.publish(2, second.data(), sizeof second, 0);
    EXPECT_EQ(ring_.read_newest(1, out.data()).sequence, 2u);
    EXPECT_EQ(out, second);
}

TEST_F(RingMemoryTest, ADamagedWordCountAddressesNothingBeyondTheSlot) {
    publish(1);
    slot_of(1).words.store(~std::uint64_t{0});
    std::array<std::uint64_t, kWords + 8> out{};
    out.back() = 42;
    EXPECT_EQ(ring_.read_newest(0, out.data()).sequence, 1u);
    EXPECT_EQ(out[kWords], 0u);
    EXPECT_EQ(out.back(), 42u);
}

TEST_F(RingMemoryTest, ADamagedHeadAddressesNothingBeyondTheRing) {
    publish(1);
    Frame out{};
    for (const std::uint64_t head : {std::uint64_t{7}, ~std::uint64_t{0}, std::uint64_t{1} << 63}) {
        ring_.header().progress.head.store(head);
        EXPECT_EQ(ring_.read_newest(0, out.data()).sequence, 0u);
    }
}

TEST_F(RingMemoryTest, WorksUpToTheLastSequence) {
    Frame out{};
    for (std::uint64_t sequence = kLastSequence - 20; sequence <= kLastSequence; ++sequence) {
        publish(sequence);
        ASSERT_EQ(ring_.read_newest(sequence - 1, out.data()).sequence, sequence);
        ASSERT_EQ(out, frame_of(sequence));
    }
}

TEST_F(RingMemoryTest, TwoThreadsNeverSeeATornFrame) {
    std::thread writer([&] {
        for (std::uint64_t sequence = 1; sequence <= kFrames; ++sequence) {
            publish(sequence);
        }
    });
    std::uint64_t last = 0;
    std::uint64_t torn = 0;
    Frame out{};
    while (last < kFrames) {
        const RingMemory::Read read = ring_.read_newest(last, out.data());
        if (read.sequence == 0) {
            std::this_thread::yield();
            continue;
        }
        ASSERT_GT(read.sequence, last);
        last = read.sequence;
        torn += out == frame_of(last) ? 0u : 1u;
    }
    writer.join();
    EXPECT_EQ(torn, 0u);
}

TEST_F(RingMemoryTest, ReadsEachOfTheLastFramesUntilItsSlotIsTaken) {
    const std::uint64_t head = 20;
    for (std::uint64_t sequence = 1; sequence <= head; ++sequence) {
        publish(sequence);
    }
    Frame out{};
    for (std::uint64_t sequence = head - kRingSlots + 1; sequence <= head; ++sequence) {
        ASSERT_TRUE(ring_.read(sequence, out.data())) << sequence;
        EXPECT_EQ(out, frame_of(sequence));
    }
    EXPECT_FALSE(ring_.read(head - kRingSlots, out.data())) << "is overwritten";
    EXPECT_FALSE(ring_.read(head + 1, out.data())) << "is not written yet";
    slot_of(head + 1).stamp.store(2 * (head + 1) - 1);
    EXPECT_FALSE(ring_.read(head + 1 - kRingSlots, out.data())) << "is being overwritten";
}

TEST_F(RingMemoryTest, ReadingAnyOfTheLastFramesBesideAWriterNeverGivesATornOne) {
    std::thread writer([&] {
        for (std::uint64_t sequence = 1; sequence <= kFrames; ++sequence) {
            publish(sequence);
        }
    });
    std::uint64_t torn = 0;
    std::uint64_t read = 0;
    Frame out{};
    std::uint64_t head = 0;
    while (head < kFrames) {
        head = ring_.header().progress.head.load();
        for (std::uint64_t sequence = head > kRingSlots ? head - kRingSlots : 1; sequence <= head; ++sequence) {
            if (ring_.read(sequence, out.data())) {
                ++read;
                torn += out == frame_of(sequence) ? 0u : 1u;
            }
        }
        std::this_thread::yield();
    }
    writer.join();
    EXPECT_EQ(torn, 0u);
    EXPECT_GE(read, kRingSlots) << "the last ones at least";
}

}  // namespace
}  // namespace haptic::detail
