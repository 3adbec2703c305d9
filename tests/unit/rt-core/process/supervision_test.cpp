#include "process/supervision.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>

#include "process/stop_input.hpp"
#include "process/watchdog.hpp"
#include "shared_board.hpp"
#include "tick_rig.hpp"
#include "wait_for.hpp"

namespace haptic::rt {
namespace {

using haptic::test::wait_for;

constexpr std::int64_t kMs = 1'000'000;

/// Bits of the supervisors that a look every 10 ms for this long finds lost, while `beat` is called before each look.
template <class Beat>
std::uint32_t lost_after(SupervisionPage& page, std::optional<Supervisor> self, int looks, Beat beat,
                         std::int64_t step_ns = 10 * kMs) {
    SupervisorCheck check({&page, 150 * kMs}, self);
    for (int i = 0; i < looks; ++i) {
        beat();
        check.check(1'000 * kMs + i * step_ns);
    }
    return page.lost.load();
}

TEST(SupervisorCheck, FindsTheOneThatIsSilentAndNobodyElse) {
    SupervisionPage page;
    page.beat(Supervisor::Watchdog);
    page.beat(Supervisor::Guard);
    const auto beat = [&page] { page.beat(Supervisor::Watchdog); };
    EXPECT_EQ(lost_after(page, std::nullopt, 15, beat), 0u) << "140 ms";
    EXPECT_EQ(lost_after(page, std::nullopt, 20, beat), 1u << static_cast<unsigned>(Supervisor::Guard));
    EXPECT_EQ(supervisor_names(page.lost), "guard");
}

TEST(SupervisorCheck, DoesNotMissOneThatDoesNotExistOrHasLeft) {
    SupervisionPage page;
    page.beat(Supervisor::StopLine);
    page.leave(Supervisor::StopLine);
    EXPECT_EQ(lost_after(page, std::nullopt, 100, [] {}), 0u);
}

TEST(SupervisorCheck, DoesNotLookAtItself) {
    SupervisionPage page;
    page.beat(Supervisor::Watchdog);
    EXPECT_EQ(lost_after(page, Supervisor::Watchdog, 100, [] {}), 0u);
}

TEST(SupervisorCheck, TakesItsOwnSleepForNobodysSilence) {
    // A process that was stopped for an hour and continues: the others beat again in the next milliseconds.
    SupervisionPage page;
    page.beat(Supervisor::Guard);
    EXPECT_EQ(lost_after(page, std::nullopt, 3, [] {}, 3'600'000 * kMs), 0u);
}

TEST(SupervisorCheck, NamesAllThatAreLost) {
    EXPECT_EQ(supervisor_names(0), "");
    EXPECT_EQ(supervisor_names(0b111), "watchdog, stop line, guard");
}

TEST(SharedSupervision, CannotBeShrunkByAnybody) {
    const SharedSupervision shared;
    EXPECT_NE(ftruncate(shared.descriptor(), 0), 0);
    const SharedSupervision other(dup(shared.descriptor()));
    shared.page().beat(Supervisor::Guard);
    EXPECT_EQ(other.page().beats[static_cast<std::size_t>(Supervisor::Guard)], 1u);
}

/// A line whose chip does not answer, as behind a bus that hangs: its thread is blocked in the kernel.
class BlockedLine final : public StopLine {
  public:
    explicit BlockedLine(const std::atomic<bool>& blocked) : blocked_(&blocked) {}
    [[nodiscard]] bool says_stop() override {
        while (*blocked_) {
            test::sleep_ms(1);
        }
        return false;
    }

  private:
    const std::atomic<bool>* blocked_;
};

/// A tick, its gate and its watchdog, without a loop.
struct Supervised {
    explicit Supervised(const Supervision& supervision)
        : board(motors),
          gate(board),
          frames(session),
          states(session),
          tick({}, gate, frames, states, &test::still_clock),
          watchdog({.limit_ns = 40 * kMs}, tick, gate, supervision) {}

    test::SharedMotors motors;
    std::string session = test::unique_session();
    test::SharedBoard board;
    MotorGate gate;
    RingReader<ContactFrame> frames;
    RingWriter<DeviceState> states;
    Tick tick;
    Watchdog watchdog;
};

TEST(Supervision, TheWatchdogNoticesAStopLineWhoseThreadIsBlocked) {
    SupervisionPage page;
    const Supervision supervision{&page, 100 * kMs};
    std::atomic<bool> blocked{false};
    Supervised supervised(supervision);
    const StopLineMonitor line(std::make_unique<BlockedLine>(blocked), [] {}, {.supervision = supervision});
    test::sleep_ms(300);
    EXPECT_EQ(page.lost, 0u);
    blocked = true;
    EXPECT_TRUE(wait_for([&page] { return page.has_lost(); }));
    EXPECT_EQ(supervisor_names(page.lost), "stop line");
    blocked = false;
}

TEST(Supervision, TheStopLineNoticesAWatchdogThatIsSilent) {
    SupervisionPage page;
    page.beat(Supervisor::Watchdog);  // once, and never again
    const std::atomic<bool> blocked{false};
    const StopLineMonitor line(std::make_unique<BlockedLine>(blocked), [] {}, {.supervision = {&page, 100 * kMs}});
    EXPECT_TRUE(wait_for([&page] { return page.has_lost(); }));
    EXPECT_EQ(supervisor_names(page.lost), "watchdog");
}

TEST(Supervision, TellsWhichThreadsAreScheduledInRealTime) {
    SupervisionPage page;
    Supervised supervised({&page, 100 * kMs});
    const std::atomic<bool> blocked{false};
    const StopLineMonitor line(std::make_unique<BlockedLine>(blocked), [] {}, {.priority = 81});
    // Where the kernel grants it at all, it grants it to both.
    EXPECT_EQ(line.priority() > 0, supervised.watchdog.priority() > 0);
    EXPECT_LE(line.priority(), 81);
}

}  // namespace
}  // namespace haptic::rt
