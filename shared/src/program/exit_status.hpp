// Exit statuses: what a program's end means, the same for all of them.
#pragma once

#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

namespace haptic {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitRefused = 2;
inline constexpr int kExitFaulted = 3;
inline constexpr int kExitDiffers = 4;
inline constexpr int kExitUnfit = 5;
inline constexpr int kExitUsage = 64;  // EX_USAGE of sysexits.h

/// These statuses with their meanings, for a man page. Throws std::out_of_range for a number that is none.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> exit_statuses(std::initializer_list<int> statuses);

}  // namespace haptic
