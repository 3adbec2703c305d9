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

TEST(Workers, DoWhatComesLastOnceToo) {
    for (const int threads : {1, 3}) {
        Workers workers(threads);
        for (std::size_t count = 0; count < 20; ++count) {
            std::vector<int> done(count, 0);
            int last = 0;
            workers.for_each(count, [&](std::size_t k) { ++done[k]; }, [&] { ++last; });
            ASSERT_EQ(last, 1);
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

TEST(Workers, EndWhateverTheyAreAbout) {
    // More threads than processors: some stand still between any two steps of their search for a loop.
    for (int times = 0; times < 200; ++times) {
        Workers workers(4 * usable_processors());
        for (int loop = 0; loop < 100; ++loop) {
            workers.for_each(8, [](std::size_t) {});
        }
    }
}

/// How often a test tries to have all threads run at a time.
constexpr int kAttempts = 200;

/// Calls item(k) for as many items as there are threads, on all of them at a time: each item waits a moment until the
/// others have begun. Returns false where a thread was left out, as may happen while other programs run. The same
/// workers may then leave it out for long: use others.
template <class Item>
bool do_together(Workers& workers, const Item& item) {
    const auto threads = static_cast<std::size_t>(workers.threads());
    std::atomic<std::size_t> here = 0;
    std::atomic<std::size_t> together = 0;
    workers.for_each(threads, [&](std::size_t k) {
        item(k);
        ++here;
        const auto begin = std::chrono::steady_clock::now();
        while (here < threads && std::chrono::steady_clock::now() - begin < std::chrono::milliseconds(100)) {
            std::this_thread::yield();
        }
        together += here == threads ? 1 : 0;
    });
    return together == threads;
}

TEST(Workers, TakePartAndWakeUp) {
    bool together = false;
    for (int attempt = 0; attempt < kAttempts && !together; ++attempt) {
        Workers workers(3);
        together = do_together(workers, [](std::size_t) {});
        for (int loop = 0; loop < 3 && together; ++loop) {
            // Long enough for them to fall asleep.
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            together = do_together(workers, [](std::size_t) {});
        }
    }
    EXPECT_TRUE(together);
}

TEST(Workers, AreLeftOutOnceTheyLoseTheirProcessors) {
    // Every processor has twice as many other threads as it can run.
    std::atomic<bool> ends = false;
    std::vector<std::thread> rivals;
    for (int k = 0; k < 2 * usable_processors(); ++k) {
        rivals.emplace_back([&ends] {
            while (!ends) {
            }
        });
    }
    Workers workers(2);
    std::vector<double> sums(64, 0.0);
    const auto begin = std::chrono::steady_clock::now();
    while (workers.losses() == 0 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(60)) {
        workers.for_each(sums.size(), [&sums](std::size_t k) {
            for (int i = 1; i < 1000; ++i) {
                sums[k] += 1.0 / i;
            }
        });
    }
    EXPECT_GT(workers.losses(), 0u);
    // The next loop is the caller's.
    std::atomic<int> by_others = 0;
    const std::thread::id caller = std::this_thread::get_id();
    workers.for_each(sums.size(), [&](std::size_t) { by_others += std::this_thread::get_id() != caller ? 1 : 0; });
    EXPECT_EQ(by_others, 0);
    ends = true;
    for (std::thread& rival : rivals) {
        rival.join();
    }
}

TEST(Workers, FlushDenormalsAsTheCallerDoes) {
    const volatile double smallest = std::numeric_limits<double>::min();
    const auto halves = [&] {
        std::vector<double> half(2, 1.0);
        for (int attempt = 0; attempt < kAttempts; ++attempt) {
            Workers workers(2);
            if (do_together(workers, [&](std::size_t k) { half[k] = smallest / 2.0; })) {
                return half;
            }
        }
        ADD_FAILURE() << "one thread did both items";
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
