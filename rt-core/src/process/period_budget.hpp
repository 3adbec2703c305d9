// Period budget: where the period of a loop goes, and whether it can hold its exchanges with the board.
//
//     period = exchanges on the bus + wake-ups + computation + reserve
//
// Two answers for each part: what it takes with certainty or by usual values (needs), and the least that it takes: the
// time on the wire, and for wake-ups and computation the least that we have seen. A period that is shorter than the sum
// of the latter is refused.
//
// USB: a transaction of n bytes takes n plus the overhead of the protocol, of the bytes of a (micro)frame. A host
// controller may begin a transfer only with the next (micro)frame, so an exchange needs a whole number of them; xHCI
// mostly begins at once, and then the time on the wire is all.
// @source USB 2.0 specification, 5.8.4: table 5-9 (full speed, 13 bytes, 1500 bytes a frame of 1 ms) and table 5-10
// (high speed, 55 bytes, 7500 bytes a microframe of 125 us)
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "haptic/device/exchange_packets.hpp"

namespace haptic::rt {

enum class Route : std::uint8_t {
    InProcess,    // the emulated device: no bus
    Usb,          // a host controller of this machine
    Usbip,        // USB packets over a network
    Uart,         // a serial line of this machine
    UartAdapter,  // a serial line behind a USB adapter
    Pty           // a program in place of a serial line
};

enum class BusSpeed : std::uint8_t { Full, High };
/// Of a link of so many Mbit/s, as the kernel names it; an unknown speed (0) counts as high.
[[nodiscard]] constexpr BusSpeed bus_speed(std::int64_t mbit) noexcept {
    return mbit > 0 && mbit < 480 ? BusSpeed::Full : BusSpeed::High;
}
/// Route to a serial line: by the name of its device, symbolic links resolved.
[[nodiscard]] Route route_of_line(const std::filesystem::path& line);

/// What a tick asks of the bus and of the processor.
struct PeriodDemand {
    Route route = Route::InProcess;
    BusSpeed speed = BusSpeed::High;    // USB only
    int baud = 2'000'000;               // bit/s, serial lines only
    int exchanges = 2;                  // a tick, 1 or 2
    bool awaits_second = true;          // the tick waits for the answer of its second exchange
    device::ExchangePackets packets{};  // of an exchange
    std::int64_t period_ns = 1'000'000;
    std::int64_t wakeup_ns = 10'000;   // one wake-up: interrupt to running thread
    std::int64_t compute_ns = 20'000;  // a tick without its exchanges, 64 proxies
};

/// Time of each part, ns.
struct PeriodParts {
    std::int64_t exchanges_ns = 0;
    std::int64_t wakeups_ns = 0;
    std::int64_t compute_ns = 0;

    [[nodiscard]] std::int64_t sum_ns() const noexcept { return exchanges_ns + wakeups_ns + compute_ns; }
};

enum class PeriodVerdict : std::uint8_t {
    Holds,    // what the parts need fits
    Tight,    // fits only if the bus or the machine is faster than one may rely on
    TooShort  // even the least does not fit
};

struct PeriodBudget {
    PeriodDemand demand;
    PeriodParts needs;
    PeriodParts least;
    int wakeups = 0;  // a tick

    [[nodiscard]] std::int64_t reserve_ns() const noexcept { return demand.period_ns - needs.sum_ns(); }
    [[nodiscard]] PeriodVerdict verdict() const noexcept;
};

[[nodiscard]] PeriodBudget budget_of(const PeriodDemand& demand) noexcept;

/// Time of the transactions of one exchange on the wire, ns; 0 without a wire.
[[nodiscard]] std::int64_t wire_ns(const PeriodDemand& demand) noexcept;

/// Table: a line for the connection, and one for each part.
[[nodiscard]] std::string text_of(const PeriodBudget& budget);
/// The same in one line.
[[nodiscard]] std::string describe_parts(const PeriodBudget& budget);
/// The first part that does not fit. Empty if the verdict is Holds.
[[nodiscard]] std::string describe_shortage(const PeriodBudget& budget);
/// What would hold: a longer period, high speed, one exchange a tick, a line without an adapter.
[[nodiscard]] std::string describe_remedies(const PeriodBudget& budget);
/// "holds", "tight", "too short"
[[nodiscard]] std::string_view verdict_name(PeriodVerdict verdict) noexcept;
/// "USB at 480 Mbit/s"
[[nodiscard]] std::string route_text(const PeriodDemand& demand);

}  // namespace haptic::rt
