#include "view/triple_buffer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>

#include "view/bounded_queue.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::uint64_t kLast = 200'000;

TEST(TripleBufferThread, ReturnsTheNewestValueOnce) {
    TripleBuffer<int> newest;
    EXPECT_FALSE(newest.take());
    newest.back() = 1;
    newest.publish();
    newest.back() = 2;
    newest.publish();
    EXPECT_TRUE(newest.take());
    EXPECT_EQ(newest.front(), 2);
    EXPECT_FALSE(newest.take());
    EXPECT_EQ(newest.front(), 2);
}

TEST(TripleBufferThread, IsNeverTornNeverGoesBackAndEndsWithTheLast) {
    // All words of a value are equal; a torn value would have two different ones.
    TripleBuffer<std::array<std::uint64_t, 64>> newest;
    std::thread writer([&] {
        for (std::uint64_t k = 1; k <= kLast; ++k) {
            newest.back().fill(k);
            newest.publish();
        }
    });
    std::uint64_t before = 0;
    bool whole = true;
    bool forward = true;
    while (before < kLast) {
        if (!newest.take()) {
            continue;
        }
        const auto& value = newest.front();
        for (const std::uint64_t word : value) {
            whole = whole && word == value[0];
        }
        forward = forward && value[0] > before;
        before = value[0];
    }
    writer.join();
    EXPECT_TRUE(whole);
    EXPECT_TRUE(forward);
    EXPECT_FALSE(newest.take());
}

TEST(BoundedQueueThread, RejectsAValueWhenFullAndKeepsTheRest) {
    BoundedQueue<std::string, 4> queue;
    for (int k = 0; k < 4; ++k) {
        EXPECT_TRUE(queue.push(std::to_string(k)));
    }
    std::string fifth = "4";
    EXPECT_FALSE(queue.push(std::move(fifth)));
    EXPECT_EQ(fifth, "4");  // NOLINT(bugprone-use-after-move): what is refused stays
    std::string value;
    for (int k = 0; k < 4; ++k) {
        ASSERT_TRUE(queue.pop(value));
        EXPECT_EQ(value, std::to_string(k));
    }
    EXPECT_FALSE(queue.pop(value));
    EXPECT_EQ(value, "3");
}

TEST(BoundedQueueThread, ReturnsEveryValueOnceAndInOrder) {
    BoundedQueue<std::uint64_t, 16> queue;
    std::thread producer([&] {
        for (std::uint64_t k = 0; k < kLast;) {
            std::uint64_t value = k;
            if (queue.push(std::move(value))) {
                ++k;
            } else {
                std::this_thread::yield();
            }
        }
    });
    bool ordered = true;
    for (std::uint64_t expected = 0; expected < kLast;) {
        std::uint64_t value = 0;
        if (queue.pop(value)) {
            ordered = ordered && value == expected;
            ++expected;
        } else {
            std::this_thread::yield();
        }
    }
    producer.join();
    EXPECT_TRUE(ordered);
}

}  // namespace
}  // namespace haptic::sim::view
