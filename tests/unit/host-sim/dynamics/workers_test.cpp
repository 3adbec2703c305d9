#include "dynamics/workers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <stdexcept>
#include <thread>
#include <vector>

#include "haptic/denormals.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {
namespace {

TEST(Workers, DoEachItemOnce) {
    for (const int threads : {1, 2, 5}) {
        Workers workers(threads);
        EXPECT_EQ(workers.threads(), threads);
        for (std::size_t count = 0; count < 200; ++count) {
            std::vector<int> done(count, 0);
            workers.for_each(count, [&](std::size_t k) { ++done[k]; });
            ASSERT_EQ(std::count(done.begin(), done.end(), 1), static_cast<std::ptrdiff_t>(count)) << threads;
        }
    }
}

TEST(Workers, DoEachRangeOnce) {
    Workers workers(3);
    std::vector<int> done(1000, 0);
    workers.for_ranges(ParticleRange{100, 903}, 50, [&](std::size_t begin, std::size_t end) {
        EXPECT_LE(end - begin, 50u);
        for (std::size_t k = begin; k < end; ++k) {
            ++done[k];
        }
    });
    for (std::size_t k = 0; k < done.size(); ++k) {
        ASSERT_EQ(done[k], k >= 100 && k < 903 ? 1 : 0) << k;
    }
    workers.for_ranges(ParticleRange{7, 7}, 50, [](std::size_t, std::size_t) { FAIL(); });
}

TEST(Workers, DoNotMixLoopsThatFollowOneAnother) {
    // Each loop writes what the one before it wrote, plus one.
    Workers workers(4);
    std::vector<std::uint64_t> now(63, 0);
    constexpr std::uint64_t kLoops = 20'000;
    for (std::uint64_t loop = 0; loop < kLoops; ++loop) {
        workers.for_each(2 + loop % 62, [&](std::size_t k) { now[k] = loop; });
    }
    for (std::size_t k = 0; k < now.size(); ++k) {
        std::uint64_t last = kLoops - 1;
        while (k >= 2 + last % 62) {
            --last;
        }
        EXPECT_EQ(now[k], last) << k;
    }
}

TEST(Workers, TakePartAndWakeUp) {
    // Every item waits until as many threads are there as there are items.
    Workers workers(3);
    for (int round = 0; round < 3; ++round) {
        std::atomic<int> here = 0;
        workers.for_each(3, [&](std::size_t) {
            ++here;
            while (here < 3) {
                std::this_thread::yield();
            }
        });
        EXPECT_EQ(here, 3);
        // Long enough for them to fall asleep.
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
}

TEST(Workers, FlushDenormalsAsTheCallerDoes) {
    Workers workers(2);
    const volatile double smallest = std::numeric_limits<double>::min();
    const auto halves = [&] {
        std::atomic<int> here = 0;
        std::vector<double> half(2, 1.0);
        workers.for_each(2, [&](std::size_t k) {
            half[k] = smallest / 2.0;
            ++here;
            while (here < 2) {
                std::this_thread::yield();
            }
        });
        return half;
    };
    EXPECT_FALSE(denormals_are_flushed());
    EXPECT_GT(halves()[0], 0.0);
    EXPECT_GT(halves()[1], 0.0);
    const FlushDenormals flush;
    if (denormals_are_flushed()) {
        EXPECT_EQ(halves(), std::vector<double>(2, 0.0));
    }
}

TEST(Workers, RefuseNumbersOfThreadsOutOfRange) {
    EXPECT_THROW(Workers(0), std::invalid_argument);
    EXPECT_THROW(Workers(Workers::kMaxThreads + 1), std::invalid_argument);
    EXPECT_GE(usable_processors(), 1);
}

}  // namespace
}  // namespace haptic::sim
