#include "program/option_checks.hpp"

#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <system_error>

#include "haptic/csv.hpp"
#include "parsed_number.hpp"

namespace haptic {
namespace {

CLI::Validator finite_number(std::function<bool(double)> accepts, const std::string& which, const std::string& shown) {
    return CLI::Validator(
        [accepts = std::move(accepts), which](const std::string& text) {
            const std::optional<double> value = detail::parsed_signed_number<double>(text);
            const bool valid = value && std::isfinite(*value) && accepts(*value);
            return valid ? std::string() : "must be a number " + which + ", is " + text;
        },
        shown);
}

std::string problem_of_result_file(const std::string& name) {
    const std::filesystem::path file(name);
    const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    std::error_code error;
    if (name.empty() || std::filesystem::is_directory(file, error)) {
        return name + ": is a folder, not a file to write to";
    }
    if (!std::filesystem::is_directory(folder, error)) {
        return name + ": the folder " + folder.string() + " does not exist";
    }
    // An existing file is written itself; a new one in its folder.
    const std::filesystem::path written = std::filesystem::exists(file, error) ? file : folder;
    if (access(written.c_str(), written == file ? W_OK : W_OK | X_OK) != 0) {
        return name + ": cannot be written: " + std::generic_category().message(errno);
    }
    return {};
}

std::string problem_of_result_folder(const std::string& name) {
    // The part of the path that exists is what must be writable.
    std::error_code error;
    std::filesystem::path existing = std::filesystem::absolute(name, error);
    while (!std::filesystem::exists(existing, error) && existing.has_relative_path()) {
        existing = existing.parent_path();
    }
    if (name.empty() || !std::filesystem::is_directory(existing, error)) {
        return name + ": is not a folder";
    }
    if (access(existing.c_str(), W_OK | X_OK) != 0) {
        return name + ": cannot be written: " + std::generic_category().message(errno);
    }
    return {};
}

}  // namespace

CLI::Validator number_in(double low, double high) {
    const std::string range = text_of(CsvCell{low}) + " to " + text_of(CsvCell{high});
    return finite_number([low, high](double value) { return value >= low && value <= high; }, "from " + range, range);
}

CLI::Validator positive_number(double high) {
    const std::string limit = high < std::numeric_limits<double>::max() ? " and at most " + text_of(CsvCell{high}) : "";
    return finite_number([high](double value) { return value > 0.0 && value <= high; }, "above 0" + limit, "POSITIVE");
}

CLI::Validator number_of_0_or_more() {
    return finite_number([](double value) { return value >= 0.0; }, "of 0 or more", "NONNEGATIVE");
}

CLI::Validator whole_number_to(std::uint64_t high) {
    return CLI::Validator(
        [high](const std::string& text) {
            const std::optional<std::uint64_t> value = detail::parsed_signed_number<std::uint64_t>(text);
            const bool valid = value && *value <= high;
            return valid ? std::string() : "must be a whole number from 0 to " + std::to_string(high) + ", is " + text;
        },
        "");
}

CLI::Validator result_file() {
    return CLI::Validator([](const std::string& text) { return problem_of_result_file(text); }, "");
}

CLI::Validator result_folder() {
    return CLI::Validator([](const std::string& text) { return problem_of_result_folder(text); }, "");
}

}  // namespace haptic
