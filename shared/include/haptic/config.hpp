// Configuration and scene files in TOML: every key has a type and a range, every error names file, line and remedy.
//
// The typed getters mark each key that they read as known; reject_unknown() then refuses every other key, with its line
// and the nearest known name. Keys are dotted: "tension.rate". In an array of tables ([[string]]) the index of the
// table is part of the key, from 0: "string.7.motor". Settings are best read through a SettingTable (setting.hpp).
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

/// A wrong key or value. what() begins with "FILE:LINE: " or "--set KEY: " and says how to correct it.
class ConfigError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// A closed interval of allowed values.
struct Range {
    double min;
    double max;
    std::string_view reason = {};  // why more is refused, for messages; empty: evident
};

/// The key of an assignment as Config::set() takes it, "KEY = VALUE", without blanks around it. Refers to the same
/// characters; all of them if there is no '='.
[[nodiscard]] std::string_view assigned_key(std::string_view assignment);

class Config {
    struct State;

  public:
    /// Where a key or table is. Settings keep it for errors that are found after they were read. Empty for settings
    /// that were made in code. Outlives the Config.
    class Place {
      public:
        Place() = default;
        /// The place of a key of this table if that is given, else this one, to which defaults belong.
        [[nodiscard]] Place of(std::string_view key) const;
        /// As Config::where(). "" if empty.
        [[nodiscard]] std::string where() const;
        /// Throws ConfigError with where() before the problem.
        [[noreturn]] void fail(const std::string& problem) const;

      private:
        friend class Config;
        Place(std::shared_ptr<const State> state, std::string key);

        std::shared_ptr<const State> state_;
        std::string key_;
    };

    /// An empty configuration: every getter returns its default.
    Config();
    /// Throws ConfigError: missing file, malformed TOML.
    [[nodiscard]] static Config load(const std::filesystem::path& file);
    /// The same from memory; `name` takes the place of the file name in messages.
    [[nodiscard]] static Config parse(std::string_view toml, std::string_view name);

    Config(Config&&) noexcept;
    Config& operator=(Config&&) noexcept;
    ~Config();

    /// Overrides one key, as on the command line: "solver.iterations=5". The value is TOML; a bare word is a string.
    void set(std::string_view assignment);

    // Getters: the value of the key, or `otherwise` if the key is missing. They throw ConfigError for a value of the
    // wrong type, not finite, out of range, with the wrong number of elements, or not among the choices.
    [[nodiscard]] double number(const std::string& key, double otherwise, Range range) const;
    [[nodiscard]] std::int64_t integer(const std::string& key, std::int64_t otherwise, Range range) const;
    [[nodiscard]] bool flag(const std::string& key, bool otherwise) const;
    [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise) const;
    [[nodiscard]] std::string choice(const std::string& key, const std::string& otherwise,
                                     const std::vector<std::string>& choices) const;
    [[nodiscard]] Vec3 vec3(const std::string& key, const Vec3& otherwise, Range range_of_each) const;
    /// Unit quaternion (w, x, y, z); refused if its length differs from 1 by more than 1e-6, else normalised.
    [[nodiscard]] Quat quat(const std::string& key, const Quat& otherwise) const;
    [[nodiscard]] std::vector<double> numbers(const std::string& key, const std::vector<double>& otherwise,
                                              Range range_of_each) const;

    /// Number of tables [[key]]; 0 if the file has none.
    [[nodiscard]] std::size_t tables(const std::string& key) const;

    [[nodiscard]] bool has(const std::string& key) const;
    /// The key has a value, and that is a string. For keys that take a number or a word.
    [[nodiscard]] bool has_text(const std::string& key) const;
    /// The key has a value, and that is a table.
    [[nodiscard]] bool has_table(const std::string& key) const;
    /// Renames a key that has a former name, and writes a notice with its line to standard error. A value from set()
    /// overrides one from the file, whichever name each uses. Throws ConfigError if one source gives both names.
    void accept_old_key(const std::string& old_key, const std::string& key) const;
    /// All values from file and set(), as TOML that parse() reads back to the same values.
    [[nodiscard]] std::string toml() const;
    /// "FILE:LINE: KEY: " or "--set KEY: ", as errors begin; "KEY: " without a file. For notices that the component
    /// writes.
    [[nodiscard]] std::string where(const std::string& key) const;
    /// Throws ConfigError with "FILE:LINE: KEY: problem". For checks between keys, made by the component.
    [[noreturn]] void fail(const std::string& key, const std::string& problem) const;
    /// The place of a key or table, for settings to keep.
    [[nodiscard]] Place place(const std::string& key) const;
    /// Path of the file that is this key's value, `file`: relative to the folder of the configuration, or, from set(),
    /// to the current one. An empty value is no file. Throws ConfigError, with the path, unless it can be read.
    [[nodiscard]] std::string input_file(const std::string& key, const std::string& file) const;
    /// The keys that getters have read, in alphabetical order.
    [[nodiscard]] std::vector<std::string> known_keys() const;
    /// Throws ConfigError for the first key, by line, that no getter has read.
    void reject_unknown() const;

  private:
    std::shared_ptr<State> state_;
};

}  // namespace haptic
