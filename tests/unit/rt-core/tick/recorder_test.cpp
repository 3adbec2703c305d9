#include "tick/recorder.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

namespace haptic::rt {
namespace {

constexpr std::int64_t kRecords = 50'000;

TickRecord numbered(std::int64_t number) {
    TickRecord record;
    record.now_ns = number;
    record.compute_ns = ~number;
    return record;
}

TEST(BlackBox, KeepsAllRecordsUntilFullThenTheLatest) {
    BlackBox box(5);
    EXPECT_EQ(box.size(), 0u);
    for (std::int64_t i = 0; i < 23; ++i) {
        box.push(numbered(i));
        ASSERT_EQ(box.size(), static_cast<std::size_t>(i < 5 ? i + 1 : 5));
        for (std::size_t k = 0; k < box.size(); ++k) {
            ASSERT_EQ(box.at(k).now_ns, i - static_cast<std::int64_t>(box.size() - 1 - k));
        }
    }
}

TEST(BlackBox, CanBeReadFromTheMemoryThatItsProcessLeft) {
    std::vector<std::byte> memory(BlackBox::bytes(5));
    BlackBox box(5);
    box.push(numbered(99));
    box.store_in(memory);
    EXPECT_EQ(box.size(), 0u) << "ticks of other memory stay there";
    for (std::int64_t i = 0; i < 4; ++i) {
        box.push(numbered(i));
    }
    {
        const BlackBox left(memory);
        ASSERT_EQ(left.size(), 4u);
        EXPECT_EQ(left.at(0).now_ns, 0);
        EXPECT_EQ(left.at(3).now_ns, 3);
    }
    for (std::int64_t i = 4; i < 23; ++i) {
        box.push(numbered(i));
    }
    // Killed while it overwrites the oldest record, 18.
    reinterpret_cast<TickRecord*>(memory.data() + BlackBox::bytes(0))[23 % 5].now_ns = -1;
    const BlackBox left(memory);
    ASSERT_EQ(left.size(), 4u);
    for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_EQ(left.at(k).now_ns, 19 + static_cast<std::int64_t>(k));
    }
}

TEST(BlackBox, RefusesMemoryThatIsNoneOrWasCutShort) {
    std::vector<std::byte> memory(BlackBox::bytes(5));
    EXPECT_THROW(BlackBox left(memory), std::runtime_error);
    BlackBox box(5);
    box.store_in(memory);
    const std::span<std::byte> all(memory);
    EXPECT_THROW(BlackBox left(all.first(memory.size() - 1)), std::runtime_error);
    EXPECT_THROW(BlackBox left(all.first(10)), std::runtime_error);
    EXPECT_THROW(box.store_in(std::span(memory).first(memory.size() - 1)), std::invalid_argument);
}

TEST(Recorder, ReturnsRecordsInOrder) {
    Recorder recorder(8);
    TickRecord record;
    EXPECT_FALSE(recorder.pop(record));
    for (std::int64_t round = 0; round < 100; ++round) {
        for (std::int64_t i = 0; i < 5; ++i) {
            recorder.push(numbered(5 * round + i));
        }
        for (std::int64_t i = 0; i < 5; ++i) {
            ASSERT_TRUE(recorder.pop(record));
            ASSERT_EQ(record.now_ns, 5 * round + i);
        }
    }
    EXPECT_FALSE(recorder.pop(record));
    EXPECT_EQ(recorder.dropped(), 0u);
}

TEST(Recorder, DropsAndCountsRecordsWhenFull) {
    Recorder recorder(8);
    for (std::int64_t i = 0; i < 11; ++i) {
        recorder.push(numbered(i));
    }
    EXPECT_EQ(recorder.dropped(), 3u);
    TickRecord record;
    for (std::int64_t i = 0; i < 8; ++i) {
        ASSERT_TRUE(recorder.pop(record));
        EXPECT_EQ(record.now_ns, i);
    }
}

TEST(Recorder, LosesOnlyCountedRecordsAndTearsNoneBetweenTwoThreads) {
    Recorder recorder(64);
    std::atomic<bool> done{false};
    std::int64_t received = 0;
    std::thread reader([&] {
        TickRecord record;
        std::int64_t last = -1;
        for (bool last_look = false; !last_look;) {
            last_look = done.load();  // before popping: everything pushed before it is seen below
            while (recorder.pop(record)) {
                ++received;
                ASSERT_GT(record.now_ns, last);
                ASSERT_EQ(record.compute_ns, ~record.now_ns);
                last = record.now_ns;
            }
            std::this_thread::yield();
        }
    });
    for (std::int64_t i = 0; i < kRecords; ++i) {
        recorder.push(numbered(i));
    }
    done.store(true);
    reader.join();
    EXPECT_EQ(received + static_cast<std::int64_t>(recorder.dropped()), kRecords);
}

}  // namespace
}  // namespace haptic::rt
