// Checks of option values, for CLI11. CLI11's own accept "nan" as a number, and name limits with 309 digits.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <limits>
#include <string>

namespace haptic {

/// A finite number from `low` to `high`.
[[nodiscard]] CLI::Validator number_in(double low, double high);
/// A finite number above 0, and up to `high`.
[[nodiscard]] CLI::Validator positive_number(double high = std::numeric_limits<double>::max());
/// Longest duration of an option, in seconds (32 years). Its nanoseconds, added to a clock's, fit in 64 bits.
inline constexpr double kLongestDuration = 1e9;
/// A finite number of 0 or more.
[[nodiscard]] CLI::Validator number_of_0_or_more();
/// A whole number from 0 to `high`.
[[nodiscard]] CLI::Validator whole_number_to(std::uint64_t high);
/// A file that a result can be written to: its folder exists and can be written, and it is no folder itself. It is
/// checked before a run, so that no result is lost after it.
[[nodiscard]] CLI::Validator result_file();

/// A folder that results can be written to, or that can be created.
[[nodiscard]] CLI::Validator result_folder();

}  // namespace haptic
