// Checks of option values, for CLI11. CLI11's own accept "nan" as a number, and name limits with 309 digits.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <span>
#include <string>

namespace haptic {

/// A finite number from `low` to `high`.
[[nodiscard]] CLI::Validator number_in(double low, double high);
/// A finite number above 0.
[[nodiscard]] CLI::Validator positive_number();
/// A finite number of 0 or more.
[[nodiscard]] CLI::Validator number_of_0_or_more();
/// A whole number from 0 to `high`.
[[nodiscard]] CLI::Validator whole_number_to(std::uint64_t high);
/// A file that a result can be written to: its folder exists and can be written, and it is no folder itself. It is
/// checked before a run, so that no result is lost after it.
[[nodiscard]] CLI::Validator result_file();

/// A folder that results can be written to, or that can be created.
[[nodiscard]] CLI::Validator result_folder();
/// Throws std::invalid_argument if `option` would overwrite `input`, which the run reads.
void require_other_file(const std::string& option, const std::string& written, const std::string& input);

/// What an option writes.
struct WrittenFile {
    std::string option;
    std::string file;  // or folder; empty: nothing
};
/// Throws std::invalid_argument if two options would write to the same file; to a device or a pipe they may.
void require_different_files(std::span<const WrittenFile> written);

}  // namespace haptic
