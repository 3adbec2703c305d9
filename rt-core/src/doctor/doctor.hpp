// Doctor: checks whether a machine is set up for a real-time loop, and names the command that fixes each problem.
// Read-only.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/device/exchange_packets.hpp"
#include "haptic/device/usb_discovery.hpp"
#include "process/machine.hpp"

namespace haptic::rt {

enum class Verdict { Good, Bad, Unknown };
[[nodiscard]] std::string_view verdict_name(Verdict verdict) noexcept;

/// Result of one check.
struct Finding {
    std::string name;  // stable between versions: "kernel", "isolation", ...
    Verdict verdict = Verdict::Unknown;
    std::string found;   // state of this machine
    std::string why;     // effect on the loop
    std::string remedy;  // command that fixes it; empty if nothing needs fixing
};

/// Settings that rt-core would run with.
struct DoctorSettings {
    int priority = 80;                             // SCHED_FIFO, of the loop; its watchdog runs one higher
    int cpu = -1;                                  // -1: choose_cpu() of cpu_list.hpp
    int idle_exit_us = 0;                          // loop.idle_exit_us
    std::int64_t period_ns = 1'000'000;            // of the loop
    std::optional<device::UsbSelection> usb = {};  // the board; empty for a board on a serial line
    int exchanges = 2;                             // a tick
    int baud = 2'000'000;                          // bit/s, of a serial line
    device::ExchangePackets packets = {{512, 0}, 512};
};

struct Diagnosis {
    int cpu = 0;  // processor of the loop
    std::vector<Finding> findings;

    /// True if no finding is Bad; Unknown findings do not count.
    [[nodiscard]] bool good() const noexcept;
};

/// Runs all checks, in the order of the text.
[[nodiscard]] Diagnosis examine(const Machine& machine, const DoctorSettings& settings);

/// One line per finding; a finding that is not good also gets its reason and its command.
[[nodiscard]] std::string text_of(const Diagnosis& diagnosis);
/// {processor, good, checks: [{name, verdict, found, why, remedy}, ...]}
[[nodiscard]] nlohmann::json json_of(const Diagnosis& diagnosis);

}  // namespace haptic::rt
