// CPU lists in the kernel's format, and the choice of the loop's processor.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace haptic::rt {

/// Parses "0-2,5" to {0, 1, 2, 5}, ascending and unique. Empty for an empty or malformed list.
[[nodiscard]] std::vector<int> parse_cpu_list(std::string_view text);

/// Parses a mask in hexadecimal groups of 32 bits, "ff,00000001" to {0, 32, ..., 39}. Empty for a malformed mask.
[[nodiscard]] std::vector<int> parse_cpu_mask(std::string_view text);

/// Formats a list like the one that parse_cpu_list() reads.
[[nodiscard]] std::string cpu_list_text(const std::vector<int>& cpus);

/// Inputs of choose_cpu(). Lists are ascending.
struct CpuChoice {
    std::vector<int> allowed;   // affinity of the process
    std::vector<int> online;    // /sys/devices/system/cpu/online
    std::vector<int> isolated;  // /sys/devices/system/cpu/isolated
};

/// The loop's processor for loop.cpu = -1: the last isolated one, else the last allowed one. A process whose affinity
/// was narrowed by taskset or a cpuset stays within it; by default the affinity is all processors that are not
/// isolated.
[[nodiscard]] int choose_cpu(const CpuChoice& choice);

}  // namespace haptic::rt
