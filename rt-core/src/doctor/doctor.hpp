// What of a machine keeps the loop from its period, and what mends it. Nothing is changed.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <haptic/device/usb_discovery.hpp>
#include "process/machine.hpp"

namespace haptic::rt {

enum class Verdict { Good, Bad, Unknown };
[[nodiscard]] std::string_view verdict_name(Verdict verdict) noexcept;

/// One thing that was looked at.
struct Finding {
    std::string name;  // stays the same between versions: "kernel", "isolation", ...
    Verdict verdict = Verdict::Unknown;
    std::string found;   // what holds here
    std::string why;     // what it does to the loop
    std::string remedy;  // the command that mends it; empty where nothing is to be mended
};

/// As rt-core would run.
struct DoctorSettings {
    int priority = 80;                             // of the loop; its watchdog has the next one
    int cpu = -1;                                  // -1: choose_cpu() of cpu_list.hpp
    int idle_exit_us = 0;                          // loop.idle_exit_us
    std::optional<device::UsbSelection> usb = {};  // the board; nothing for one that has a serial line
};

struct Diagnosis {
    int cpu = 0;  // the loop's processor
    std::vector<Finding> findings;

    /// Nothing is bad. What could not be found out counts as neither.
    [[nodiscard]] bool good() const noexcept;
};

[[nodiscard]] Diagnosis examine(const Machine& machine, const DoctorSettings& settings);

/// A line for each finding; for what is not good also why it matters, and the command.
[[nodiscard]] std::string text_of(const Diagnosis& diagnosis);
/// {processor, good, checks: [{name, verdict, found, why, remedy}, ...]}
[[nodiscard]] nlohmann::json json_of(const Diagnosis& diagnosis);

}  // namespace haptic::rt
