#include "process/period_budget.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr device::ExchangePackets kSh4Packets{{512, 0}, 512};
constexpr device::ExchangePackets kSimplePackets{{32, 32}, 32};
constexpr device::ExchangePackets kOneUartBoard{{61, 0}, 41};
constexpr device::ExchangePackets kTwoUartBoards{{74, 0}, 34};

PeriodDemand usb(BusSpeed speed, int exchanges, const device::ExchangePackets& packets = kSh4Packets) {
    return {.route = Route::Usb, .speed = speed, .exchanges = exchanges, .awaits_second = false, .packets = packets};
}

PeriodDemand line(Route route, int exchanges, const device::ExchangePackets& packets = kTwoUartBoards) {
    return {.route = route, .exchanges = exchanges, .packets = packets};
}

TEST(PeriodBudget, TakesTheWireTimeOfUsbFromTheOverheadOfItsTransactions) {
    // High speed, of 7500 bytes in 125 us: two transactions of 512 + 55 bytes.
    EXPECT_EQ(wire_ns(usb(BusSpeed::High, 2)), 2 * 567 * 125'000 / 7500);
    // Full speed, of 1500 bytes in 1 ms: sixteen transactions of 64 + 13 bytes.
    EXPECT_EQ(wire_ns(usb(BusSpeed::Full, 2)), std::int64_t{16} * 77 * 1'000'000 / 1500);
    // Simple board: three packets of 32 bytes.
    EXPECT_EQ(wire_ns(usb(BusSpeed::High, 2, kSimplePackets)), 3 * 87 * 125'000 / 7500);
    EXPECT_EQ(wire_ns(usb(BusSpeed::Full, 2, kSimplePackets)), 3 * 45 * 1'000'000 / 1500);
    // As many full packets as the tables of the specification give for a (micro)frame, and no more.
    constexpr std::size_t high = 13;
    constexpr std::size_t full = 19;
    EXPECT_LE(wire_ns(usb(BusSpeed::High, 1, {{high * 512, 0}, 0})), 125'000);
    EXPECT_GT(wire_ns(usb(BusSpeed::High, 1, {{(high + 1) * 512, 0}, 0})), 125'000);
    EXPECT_LE(wire_ns(usb(BusSpeed::Full, 1, {{full * 64, 0}, 0})), 1'000'000);
    EXPECT_GT(wire_ns(usb(BusSpeed::Full, 1, {{(full + 1) * 64, 0}, 0})), 1'000'000);
}

TEST(PeriodBudget, TakesTheWireTimeOfASerialLineFromTheBytesThatClockTheAnswerOut) {
    // 10 bits a byte at 2 Mbit/s: 5 us.
    EXPECT_EQ(wire_ns(line(Route::Uart, 2, kOneUartBoard)), 61 * 5'000);
    EXPECT_EQ(wire_ns(line(Route::Uart, 2)), 74 * 5'000);
    PeriodDemand slow = line(Route::UartAdapter, 2);
    slow.baud = 1'000'000;
    EXPECT_EQ(wire_ns(slow), 74 * 10'000);
    EXPECT_EQ(wire_ns(line(Route::Pty, 2)), 0);
    EXPECT_EQ(wire_ns({}), 0);
}

TEST(PeriodBudget, RoundsEachExchangeOverUsbUpToWholeFrames) {
    EXPECT_EQ(budget_of(usb(BusSpeed::High, 2)).needs.exchanges_ns, 2 * 125'000);
    EXPECT_EQ(budget_of(usb(BusSpeed::High, 1)).needs.exchanges_ns, 125'000);
    EXPECT_EQ(budget_of(usb(BusSpeed::Full, 2)).needs.exchanges_ns, 2 * 1'000'000);
    // Twice the bytes of a frame: two frames an exchange.
    EXPECT_EQ(budget_of(usb(BusSpeed::Full, 1, {{1024, 0}, 512})).needs.exchanges_ns, 2 * 1'000'000);
    EXPECT_EQ(budget_of(usb(BusSpeed::High, 2)).least.exchanges_ns, 2 * wire_ns(usb(BusSpeed::High, 2)));
}

TEST(PeriodBudget, CountsOneWakeUpForTheDeadlineAndTwoForEachAwaitedAnswer) {
    EXPECT_EQ(budget_of({}).wakeups, 1);
    EXPECT_EQ(budget_of(usb(BusSpeed::High, 1)).wakeups, 3);
    EXPECT_EQ(budget_of(usb(BusSpeed::High, 2)).wakeups, 3) << "the next tick collects the second answer";
    PeriodDemand waits = usb(BusSpeed::High, 2);
    waits.awaits_second = true;
    EXPECT_EQ(budget_of(waits).wakeups, 5);
    EXPECT_EQ(budget_of(waits).needs.exchanges_ns, budget_of(usb(BusSpeed::High, 2)).needs.exchanges_ns);
    EXPECT_EQ(budget_of(line(Route::Uart, 2)).wakeups, 5);
}

TEST(PeriodBudget, ReservesTheRestOfThePeriod) {
    PeriodDemand demand = usb(BusSpeed::High, 2);
    demand.wakeup_ns = 12'000;
    demand.compute_ns = 31'000;
    const PeriodBudget budget = budget_of(demand);
    EXPECT_EQ(budget.reserve_ns(), 1'000'000 - 250'000 - 3 * 12'000 - 31'000);
    EXPECT_THAT(text_of(budget),
                AllOf(HasSubstr("exchanges       250.0 us"), HasSubstr("wake-ups         36.0 us"),
                      HasSubstr("computation      31.0 us"), HasSubstr("reserve         683.0 us"), HasSubstr("68 %")));
}

TEST(PeriodBudget, HoldsUpToTheRateThatEachRouteAllows) {
    constexpr auto holds = PeriodVerdict::Holds;
    constexpr auto tight = PeriodVerdict::Tight;
    constexpr auto short_ = PeriodVerdict::TooShort;
    struct Row {
        const char* name;
        PeriodDemand demand;
        std::array<PeriodVerdict, 4> at;  // 1, 2, 4 and 8 kHz
    };
    const PeriodDemand network = {.route = Route::Usbip, .awaits_second = false, .packets = kSh4Packets};
    PeriodDemand slow_network = network;
    slow_network.speed = BusSpeed::Full;
    const std::vector<Row> rows = {
        {"emulated", {}, {holds, holds, holds, holds}},
        {"SH4, high speed, two", usb(BusSpeed::High, 2), {holds, holds, tight, tight}},
        {"SH4, high speed, one", usb(BusSpeed::High, 1), {holds, holds, holds, tight}},
        {"SH4, full speed, two", usb(BusSpeed::Full, 2), {short_, short_, short_, short_}},
        {"SH4, full speed, one", usb(BusSpeed::Full, 1), {tight, short_, short_, short_}},
        {"Simple, high speed, two", usb(BusSpeed::High, 2, kSimplePackets), {holds, holds, tight, tight}},
        {"Simple, high speed, one", usb(BusSpeed::High, 1, kSimplePackets), {holds, holds, holds, tight}},
        {"Simple, full speed, two", usb(BusSpeed::Full, 2, kSimplePackets), {tight, tight, tight, short_}},
        {"Simple, full speed, one", usb(BusSpeed::Full, 1, kSimplePackets), {tight, tight, tight, tight}},
        {"usbip, high speed", network, {holds, tight, tight, tight}},
        {"usbip, full speed", slow_network, {tight, tight, tight, tight}},
        {"serial line, two", line(Route::Uart, 2), {holds, short_, short_, short_}},
        {"serial line, one", line(Route::Uart, 1), {holds, holds, short_, short_}},
        {"serial line of one board, two", line(Route::Uart, 2, kOneUartBoard), {holds, short_, short_, short_}},
        {"serial line of one board, one", line(Route::Uart, 1, kOneUartBoard), {holds, holds, short_, short_}},
        {"adapter, two", line(Route::UartAdapter, 2), {tight, short_, short_, short_}},
        {"adapter, one", line(Route::UartAdapter, 1), {tight, tight, short_, short_}},
        {"pseudo-terminal", line(Route::Pty, 2), {holds, holds, holds, holds}},
    };
    for (const Row& row : rows) {
        for (std::size_t i = 0; i < row.at.size(); ++i) {
            PeriodDemand demand = row.demand;
            demand.period_ns = 1'000'000 >> i;
            EXPECT_EQ(verdict_name(budget_of(demand).verdict()), verdict_name(row.at[i]))
                << row.name << " at " << (1 << i) << " kHz";
        }
    }
}

TEST(PeriodBudget, NamesThePartThatDoesNotFitAndOnlyRemediesThatHold) {
    // Full speed at 1 kHz: one exchange alone would still not be sure.
    const PeriodBudget full = budget_of(usb(BusSpeed::Full, 2));
    EXPECT_THAT(
        describe_shortage(full),
        HasSubstr("a period of 1000.0 us cannot hold its two exchanges with USB at 12 Mbit/s, which take 1642.7 us"));
    EXPECT_THAT(describe_remedies(full), AllOf(HasSubstr("loop.period_s of at least 2050.0 us (487 Hz)"),
                                               HasSubstr("480 Mbit/s"), Not(HasSubstr("device.exchanges"))));
    // High speed at 4 kHz: one exchange holds.
    PeriodDemand fast = usb(BusSpeed::High, 2);
    fast.period_ns = 250'000;
    EXPECT_THAT(describe_shortage(budget_of(fast)), HasSubstr("may not hold its 3 wake-ups"));
    EXPECT_THAT(describe_remedies(budget_of(fast)),
                AllOf(HasSubstr("device.exchanges = \"one\""), HasSubstr("(3333 Hz)"), Not(HasSubstr("480"))));
    // An adapter.
    EXPECT_THAT(describe_remedies(budget_of(line(Route::UartAdapter, 2))), HasSubstr("instead of an adapter"));
    // A computation that takes too long.
    PeriodDemand heavy;
    heavy.compute_ns = 1'500'000;
    EXPECT_THAT(describe_shortage(budget_of(heavy)), HasSubstr("may not hold its computation"));
    EXPECT_THAT(describe_remedies(budget_of(heavy)), HasSubstr("1510.0 us (662 Hz)"));
    EXPECT_THAT(describe_shortage(budget_of({})), IsEmpty());
}

TEST(PeriodBudget, HoldsAtTheRateThatItProposes) {
    for (PeriodDemand demand : {usb(BusSpeed::Full, 2), usb(BusSpeed::High, 2), line(Route::UartAdapter, 1)}) {
        demand.period_ns = 125'000;
        const std::string remedies = describe_remedies(budget_of(demand));
        const std::size_t at = remedies.find('(');
        ASSERT_NE(at, std::string::npos) << remedies;
        demand.period_ns = 1'000'000'000 / std::stoll(remedies.substr(at + 1));
        EXPECT_EQ(budget_of(demand).verdict(), PeriodVerdict::Holds) << remedies;
    }
}

TEST(PeriodBudget, TellsLinesApartByTheirDevices) {
    EXPECT_EQ(route_of_line("/dev/ttyS0"), Route::Uart);
    EXPECT_EQ(route_of_line("/dev/ttyUSB3"), Route::UartAdapter);
    EXPECT_EQ(route_of_line("/dev/ttyACM0"), Route::UartAdapter);
    // A link to a pseudo-terminal, as `firmware-host serve --tty` makes one.
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    ASSERT_GE(master, 0);
    ASSERT_EQ(unlockpt(master), 0);
    const auto link = std::filesystem::path(testing::TempDir()) / ("line-" + std::to_string(getpid()));
    std::filesystem::remove(link);
    std::filesystem::create_symlink(ptsname(master), link);
    EXPECT_EQ(route_of_line(link), Route::Pty);
    std::filesystem::remove(link);
    close(master);
}

}  // namespace
}  // namespace haptic::rt
