#include "measure/kernel_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

namespace haptic::rt {
namespace {

using testing::ElementsAre;

constexpr std::int64_t kWindow = KernelWatch::kWindowNs;

/// A /proc folder of a machine with two processors; the second is watched.
class KernelWatchTest : public testing::Test {
  protected:
    KernelWatchTest() { std::filesystem::create_directories(proc); }
    ~KernelWatchTest() override { std::filesystem::remove_all(proc); }

    void write(std::uint64_t timer, std::uint64_t disk, std::uint64_t stolen, std::uint64_t queued_ns) const {
        std::ofstream(proc / "interrupts") << "            CPU0       CPU1       \n"
                                           << "  4:       5        " << disk << "  IO-APIC   1-edge      disk0\n"
                                           << "  9:       7        0   IO-APIC   9-fasteoi   acpi\n"
                                           << "LOC:     100        " << timer << "   Local timer interrupts\n"
                                           << "ERR:          3\n";
        std::ofstream(proc / "stat") << "cpu  1 2 3 4 5 6 7 8 9 10\ncpu0 1 2 3 4 5 6 7 800 9 10\n"
                                     << "cpu1 1 2 3 4 5 6 7 " << stolen << " 9 10\nintr 1 2\n";
        std::ofstream(proc / "schedstat") << "version 15\ntimestamp 4295\ncpu0 0 0 0 0 0 0 1 2 3\ndomain0 3 1\n"
                                          << "cpu1 0 0 0 0 0 0 55 " << queued_ns << " 3\n";
    }
    /// Adds a tick that the log keeps.
    void late_tick(std::int64_t now_ns) {
        TickRecord record;
        record.number = ++number;
        record.now_ns = now_ns;
        record.deadline_ns = now_ns - lateness_ns;
        lateness_ns += 1000;
        log->add(record, {}, 0);
    }

    std::filesystem::path proc = std::filesystem::temp_directory_path() / ("kernel-watch-" + std::to_string(getpid()));
    std::unique_ptr<TimingLog> log = std::make_unique<TimingLog>();
    std::uint64_t number = 0;
    std::int64_t lateness_ns = 100'000;
};

TEST_F(KernelWatchTest, KeepsTheWindowAroundALateTick) {
    write(1000, 10, 5, 1'000'000);
    KernelWatch watch(1, proc);
    watch.restart(0);
    write(1100, 10, 5, 2'000'000);
    watch.poll(kWindow, *log);
    late_tick(kWindow + 1);
    write(1200, 510, 6, 9'000'000);
    watch.poll(2 * kWindow, *log);
    write(1300, 510, 6, 9'000'000);
    watch.poll(2 * kWindow + 1, *log);  // too early to close a window
    watch.finish(3 * kWindow, *log);

    EXPECT_EQ(watch.window_of(1), nullptr) << "nothing happened in it";
    EXPECT_EQ(watch.window_of(2 * kWindow + 1), nullptr);
    const KernelWindow* const window = watch.window_of(kWindow + 1);
    ASSERT_NE(window, nullptr);
    EXPECT_EQ(window->begin_ns, kWindow);
    EXPECT_EQ(window->end_ns, 2 * kWindow);
    EXPECT_THAT(watch.names(), ElementsAre("disk0", "acpi", "Local timer interrupts"));
    EXPECT_THAT(window->counts.interrupts, ElementsAre(500U, 0U, 100U));
    EXPECT_EQ(window->counts.stolen_ms, 1000 / sysconf(_SC_CLK_TCK));
    EXPECT_EQ(window->counts.queued_us, 7000);
    EXPECT_EQ(unusual_interrupts(*window, watch), "disk0 500");
    EXPECT_THAT(watch.total().interrupts, ElementsAre(500U, 0U, 300U));
    EXPECT_DOUBLE_EQ(watch.watched_s(), 0.3);
}

TEST_F(KernelWatchTest, IgnoresCountsDuringAPause) {
    write(1000, 0, 0, 0);
    KernelWatch watch(1, proc);
    watch.restart(0);
    write(1100, 0, 0, 0);
    watch.finish(kWindow, *log);
    write(9000, 0, 0, 0);
    watch.restart(50 * kWindow);
    write(9100, 0, 0, 0);
    watch.finish(51 * kWindow, *log);
    EXPECT_EQ(watch.total().interrupts.back(), 200U);
    EXPECT_DOUBLE_EQ(watch.watched_s(), 0.2);
}

TEST_F(KernelWatchTest, ReportsCountersThatTheKernelLacksAsUnknown) {
    KernelWatch watch(1, proc / "nowhere");
    watch.restart(0);
    late_tick(1);
    watch.finish(kWindow, *log);
    const KernelWindow* const window = watch.window_of(1);
    ASSERT_NE(window, nullptr);
    EXPECT_EQ(window->counts.stolen_ms, -1);
    EXPECT_EQ(window->counts.queued_us, -1);
    EXPECT_EQ(unusual_interrupts(*window, watch), "");
}

TEST_F(KernelWatchTest, KeepsAWindowWhoseTickIsReportedLater) {
    write(0, 0, 0, 0);
    KernelWatch watch(1, proc);
    watch.restart(0);
    watch.poll(kWindow, *log);
    watch.poll(2 * kWindow, *log);
    late_tick(kWindow - 1);
    for (int i = 3; i < 40; ++i) {
        watch.poll(i * kWindow, *log);
    }
    EXPECT_NE(watch.window_of(kWindow - 1), nullptr);
}

}  // namespace
}  // namespace haptic::rt
