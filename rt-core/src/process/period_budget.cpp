#include "process/period_budget.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <system_error>
#include <vector>

namespace haptic::rt {
namespace {

/// USB at one speed.
struct UsbTiming {
    std::size_t packet_bytes;    // largest bulk packet
    std::size_t overhead_bytes;  // of a transaction
    std::size_t frame_bytes;     // a (micro)frame
    std::int64_t frame_ns;
    const char* frame;
};
constexpr UsbTiming kFullSpeed{64, 13, 1500, 1'000'000, "frames of 1 ms"};
constexpr UsbTiming kHighSpeed{512, 55, 7500, 125'000, "microframes of 125 us"};

constexpr int kBitsPerByte = 10;  // on a serial line: start, 8 data, stop
// What a USB adapter adds to an exchange while it collects bytes: its shortest latency timer.
constexpr std::int64_t kAdapterNs = 1'000'000;
// Round trip through the network and both of its ends, on a quiet local network.
constexpr std::int64_t kNetworkNs = 200'000;
// A transfer to the board, and one from it, end in an interrupt each.
constexpr int kWakeupsPerAnswer = 2;
// The least that we have seen, ns: interrupt to running thread, and a tick with one proxy.
constexpr std::int64_t kLeastWakeupNs = 2'000;
constexpr std::int64_t kLeastComputeNs = 3'000;

constexpr double kMicro = 1e-3;  // ns to us

const UsbTiming& timing_of(BusSpeed speed) noexcept {
    return speed == BusSpeed::High ? kHighSpeed : kFullSpeed;
}

std::size_t bus_bytes(const UsbTiming& usb, std::size_t packet) noexcept {
    // A packet longer than a transaction is divided; an empty one is none.
    const std::size_t transactions = (packet + usb.packet_bytes - 1) / usb.packet_bytes;
    return packet + transactions * usb.overhead_bytes;
}

std::int64_t usb_wire_ns(const PeriodDemand& demand) noexcept {
    const UsbTiming& usb = timing_of(demand.speed);
    const std::size_t bytes = bus_bytes(usb, demand.packets.out[0]) + bus_bytes(usb, demand.packets.out[1]) +
                              bus_bytes(usb, demand.packets.in);
    return static_cast<std::int64_t>(bytes) * usb.frame_ns / static_cast<std::int64_t>(usb.frame_bytes);
}

/// An exchange, rounded up to whole (micro)frames.
std::int64_t usb_frames_ns(const PeriodDemand& demand) noexcept {
    const std::int64_t frame_ns = timing_of(demand.speed).frame_ns;
    return (usb_wire_ns(demand) + frame_ns - 1) / frame_ns * frame_ns;
}

std::int64_t exchange_needs_ns(const PeriodDemand& demand) noexcept {
    switch (demand.route) {
        case Route::InProcess:
        case Route::Pty:
            return 0;
        case Route::Usb:
            return usb_frames_ns(demand);
        case Route::Usbip:
            return kNetworkNs + usb_frames_ns(demand);
        case Route::Uart:
            return wire_ns(demand);
        case Route::UartAdapter:
            break;
    }
    return wire_ns(demand) + kAdapterNs;
}

bool waits_for_board(Route route) noexcept {
    return route != Route::InProcess;
}

int wakeups_of(const PeriodDemand& demand) noexcept {
    // The deadline, and each answer that is waited for.
    const int awaited = demand.exchanges == 2 && demand.awaits_second ? 2 : 1;
    return 1 + (waits_for_board(demand.route) ? kWakeupsPerAnswer * awaited : 0);
}

std::string us_of(std::int64_t time_ns) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.1f us", static_cast<double>(time_ns) * kMicro);
    return text.data();
}

std::string line_of(const char* part, std::int64_t time_ns, const std::string& how) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "  %-12s %8.1f us", part, static_cast<double>(time_ns) * kMicro);
    return text.data() + (how.empty() ? how : "  " + how) + "\n";
}

std::string packets_text(const device::ExchangePackets& packets) {
    return std::to_string(packets.out[0]) +
           (packets.out[1] > 0 ? " and " + std::to_string(packets.out[1]) : std::string()) + " bytes out, " +
           std::to_string(packets.in) + " in";
}

/// How the time of the exchanges comes about.
std::string exchanges_text(const PeriodDemand& demand) {
    if (demand.route == Route::InProcess) {
        return "the board is in this process";
    }
    std::string text = std::to_string(demand.exchanges) + " of " + packets_text(demand.packets);
    if (demand.route == Route::Pty) {
        return text + ", through a program instead of a line";
    }
    text += ": " + us_of(wire_ns(demand)) + " on the wire each";
    if (demand.route == Route::Usb || demand.route == Route::Usbip) {
        text += std::string(", in whole ") + timing_of(demand.speed).frame;
    }
    if (demand.route == Route::Usbip) {
        text += ", and " + us_of(kNetworkNs) + " of network";
    }
    if (demand.route == Route::UartAdapter) {
        text += ", and " + us_of(kAdapterNs) + " in the adapter";
    }
    return text;
}

/// Highest rate at which these parts fit, in whole Hz.
std::int64_t highest_rate(const PeriodParts& parts) noexcept {
    constexpr std::int64_t second_ns = 1'000'000'000;
    return second_ns / std::max<std::int64_t>(parts.sum_ns(), 1);
}

/// A change of the demand that helps, and its name.
struct Change {
    PeriodDemand demand;
    std::string name;
};

std::vector<Change> changes_of(const PeriodDemand& demand) {
    std::vector<Change> changes;
    PeriodDemand slower = demand;
    const std::int64_t rate = highest_rate(budget_of(demand).needs);
    slower.period_ns = (1'000'000'000 + rate - 1) / rate;
    changes.push_back({slower, "loop.period_s of at least " + us_of(budget_of(demand).needs.sum_ns()) + " (" +
                                   std::to_string(rate) + " Hz)"});
    if (demand.exchanges == 2) {
        PeriodDemand one = demand;
        one.exchanges = 1;
        changes.push_back({one, "one exchange a tick (device.exchanges = \"one\": the force is sent a period later)"});
    }
    const bool usb = demand.route == Route::Usb || demand.route == Route::Usbip;
    if (usb && demand.speed == BusSpeed::Full) {
        PeriodDemand fast = demand;
        fast.speed = BusSpeed::High;
        changes.push_back({fast, "a link of 480 Mbit/s (a port of the machine itself, a cable for USB 2.0)"});
    }
    if (demand.route == Route::UartAdapter) {
        PeriodDemand direct = demand;
        direct.route = Route::Uart;
        changes.push_back({direct, "a serial line of the machine instead of an adapter"});
    }
    return changes;
}

}  // namespace

Route route_of_line(const std::filesystem::path& line) {
    std::error_code error;
    const std::filesystem::path device = std::filesystem::canonical(line, error);
    const std::string name = error ? line.string() : device.string();
    if (name.starts_with("/dev/pts/")) {
        return Route::Pty;
    }
    const bool adapter = name.starts_with("/dev/ttyUSB") || name.starts_with("/dev/ttyACM");
    return adapter ? Route::UartAdapter : Route::Uart;
}

PeriodVerdict PeriodBudget::verdict() const noexcept {
    if (reserve_ns() >= 0) {
        return PeriodVerdict::Holds;
    }
    return least.sum_ns() <= demand.period_ns ? PeriodVerdict::Tight : PeriodVerdict::TooShort;
}

std::int64_t wire_ns(const PeriodDemand& demand) noexcept {
    switch (demand.route) {
        case Route::InProcess:
        case Route::Pty:
            return 0;
        case Route::Usb:
        case Route::Usbip:
            return usb_wire_ns(demand);
        case Route::Uart:
        case Route::UartAdapter:
            break;
    }
    // The answer is clocked out by the bytes of the command.
    const auto bits = static_cast<std::int64_t>(kBitsPerByte * demand.packets.out_bytes());
    return bits * 1'000'000'000 / demand.baud;
}

PeriodBudget budget_of(const PeriodDemand& demand) noexcept {
    PeriodBudget budget;
    budget.demand = demand;
    budget.wakeups = wakeups_of(demand);
    budget.needs = {demand.exchanges * exchange_needs_ns(demand), budget.wakeups * demand.wakeup_ns, demand.compute_ns};
    // The far end of a network may be a program without a bus.
    const std::int64_t least_wire_ns = demand.route == Route::Usbip ? 0 : wire_ns(demand);
    budget.least = {demand.exchanges * least_wire_ns, budget.wakeups * kLeastWakeupNs, kLeastComputeNs};
    return budget;
}

std::string_view verdict_name(PeriodVerdict verdict) noexcept {
    switch (verdict) {
        case PeriodVerdict::Holds:
            return "holds";
        case PeriodVerdict::Tight:
            return "tight";
        case PeriodVerdict::TooShort:
            break;
    }
    return "too short";
}

std::string route_text(const PeriodDemand& demand) {
    std::string usb = demand.speed == BusSpeed::High ? "USB at 480 Mbit/s" : "USB at 12 Mbit/s";
    std::string line = "a serial line of " + std::to_string(demand.baud) + " bit/s";
    switch (demand.route) {
        case Route::InProcess:
            return "an emulated device";
        case Route::Usb:
            return usb;
        case Route::Usbip:
            return usb + " over a network";
        case Route::Uart:
            return line;
        case Route::UartAdapter:
            return line + " behind a USB adapter";
        case Route::Pty:
            break;
    }
    return "a pseudo-terminal";
}

std::string text_of(const PeriodBudget& budget) {
    const PeriodDemand& demand = budget.demand;
    std::string text = "a period of " + us_of(demand.period_ns) + " with " + route_text(demand) + ": " +
                       std::string(verdict_name(budget.verdict())) + "\n";
    text += line_of("exchanges", budget.needs.exchanges_ns, exchanges_text(demand));
    text += line_of("wake-ups", budget.needs.wakeups_ns,
                    std::to_string(budget.wakeups) + " of " + us_of(demand.wakeup_ns) + ", assumed");
    text += line_of("computation", budget.needs.compute_ns, "assumed");
    std::array<char, 32> share{};
    std::snprintf(share.data(), share.size(), "%.0f %%",
                  100.0 * static_cast<double>(budget.reserve_ns()) / static_cast<double>(demand.period_ns));
    return text + line_of("reserve", budget.reserve_ns(), share.data());
}

std::string describe_parts(const PeriodBudget& budget) {
    const PeriodDemand& demand = budget.demand;
    return "a period of " + us_of(demand.period_ns) + " with " + route_text(demand) + ": exchanges " +
           us_of(budget.needs.exchanges_ns) + ", wake-ups " + us_of(budget.needs.wakeups_ns) + ", computation " +
           us_of(budget.needs.compute_ns) + ", reserve " + us_of(budget.reserve_ns());
}

std::string describe_shortage(const PeriodBudget& budget) {
    const PeriodVerdict verdict = budget.verdict();
    if (verdict == PeriodVerdict::Holds) {
        return {};
    }
    // The first part with which the sum exceeds the period.
    const PeriodParts& parts = verdict == PeriodVerdict::TooShort ? budget.least : budget.needs;
    const std::int64_t period_ns = budget.demand.period_ns;
    const std::string exchanges = budget.demand.exchanges == 2 ? "two exchanges" : "one exchange";
    const std::string with = " with " + route_text(budget.demand);
    std::string text =
        "a period of " + us_of(period_ns) + (verdict == PeriodVerdict::TooShort ? " cannot" : " may not");
    if (parts.exchanges_ns > period_ns) {
        text += " hold its " + exchanges + with + ", which take " + us_of(parts.exchanges_ns);
    } else if (parts.exchanges_ns + parts.wakeups_ns > period_ns) {
        text += " hold its " + std::to_string(budget.wakeups) + " wake-ups" + with + ", which take " +
                us_of(parts.wakeups_ns) + " beside " + us_of(parts.exchanges_ns) + " of exchanges";
    } else {
        text += " hold its computation" + with + ", which takes " + us_of(parts.compute_ns) + " beside " +
                us_of(parts.exchanges_ns + parts.wakeups_ns) + " of exchanges and wake-ups";
    }
    return text;
}

std::string describe_remedies(const PeriodBudget& budget) {
    // Each change alone.
    std::string remedies;
    for (const Change& change : changes_of(budget.demand)) {
        if (budget_of(change.demand).verdict() == PeriodVerdict::Holds) {
            remedies += (remedies.empty() ? "" : "; or ") + change.name;
        }
    }
    return remedies;
}

}  // namespace haptic::rt
