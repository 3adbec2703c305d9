// Configuration and scene files: TOML, every key typed, ranged and known, every error with file, line and remedy.
//
// A component reads its keys through the typed getters, which note each key as known; reject_unknown() then refuses
// what nobody asked for, with its line and the nearest known name. Keys are dotted: "tension.minimum_n". Within a list
// of tables ([[string]]) the number of the table is a part of the key, from 0: "string.7.motor".
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/types.hpp"

namespace haptic {

/// what() begins with "FILE:LINE: " (or "--set KEY: "), says what is wrong and what would be right.
class ConfigError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// A closed interval of allowed values.
struct Range {
    double least;
    double most;
};

class Config {
  public:
    /// An empty configuration: every getter returns its default.
    Config();
    /// Throws ConfigError: missing file, malformed TOML.
    [[nodiscard]] static Config load(const std::filesystem::path& file);
    /// The same from memory; name stands for the file in messages.
    [[nodiscard]] static Config parse(std::string_view toml, std::string_view name);

    Config(Config&&) noexcept;
    Config& operator=(Config&&) noexcept;
    ~Config();

    /// Overrides one key, as on the command line: "solver.iterations=5". The value is TOML; a bare word is a string.
    void set(std::string_view assignment);

    // Getters: the value of the key, or the default where the file does not have it. They throw ConfigError for a value
    // of the wrong type, not finite, out of range, of the wrong number of elements, or not among the choices.
    [[nodiscard]] double number(const std::string& key, double otherwise, Range range) const;
    [[nodiscard]] std::int64_t integer(const std::string& key, std::int64_t otherwise, Range range) const;
    [[nodiscard]] bool flag(const std::string& key, bool otherwise) const;
    [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise) const;
    [[nodiscard]] std::string choice(const std::string& key, const std::string& otherwise,
                                     const std::vector<std::string>& choices) const;
    [[nodiscard]] Vec3 vec3(const std::string& key, const Vec3& otherwise, Range range_of_each) const;
    /// Unit quaternion (w, x, y, z); refused if its length differs from 1 by more than 1e-6, then normalised.
    [[nodiscard]] Quat quat(const std::string& key, const Quat& otherwise) const;
    [[nodiscard]] std::vector<double> numbers(const std::string& key, const std::vector<double>& otherwise,
                                              Range range_of_each) const;

    /// How many tables [[key]] there are; 0 where the file has none.
    [[nodiscard]] std::size_t tables(const std::string& key) const;

    [[nodiscard]] bool has(const std::string& key) const;
    /// The key is there and holds a string: for keys that take a number or a word.
    [[nodiscard]] bool has_text(const std::string& key) const;
    /// Everything that was given, by file and by set(), as TOML that parse() reads back to the same values.
    [[nodiscard]] std::string toml() const;
    /// Throws ConfigError with "FILE:LINE: KEY: problem", for checks between keys that only the component can make.
    [[noreturn]] void fail(const std::string& key, const std::string& problem) const;
    /// The keys that getters have asked for, in alphabetical order.
    [[nodiscard]] std::vector<std::string> known_keys() const;
    /// Throws ConfigError for the first key that no getter has asked for.
    void reject_unknown() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic
