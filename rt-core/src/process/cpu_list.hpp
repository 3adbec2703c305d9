// Lists of processors as the kernel writes them, and which of them the loop gets.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace haptic::rt {

/// "0-2,5" as {0, 1, 2, 5}: ascending, each once. Empty for an empty list, and for what is none.
[[nodiscard]] std::vector<int> parse_cpu_list(std::string_view text);

/// The reverse: "0-2,5".
[[nodiscard]] std::string cpu_list_text(const std::vector<int>& cpus);

/// What loop.cpu = -1 goes by. Lists are ascending.
struct CpuChoice {
    std::vector<int> allowed;   // affinity of the process
    std::vector<int> online;    // /sys/devices/system/cpu/online
    std::vector<int> isolated;  // /sys/devices/system/cpu/isolated
};

/// The last isolated processor, where the kernel keeps one free; else the last allowed one. A process whose affinity
/// was narrowed to some processors, by taskset or a cpuset, stays among them: without that it is all that are not
/// isolated.
[[nodiscard]] int choose_cpu(const CpuChoice& choice);

}  // namespace haptic::rt
