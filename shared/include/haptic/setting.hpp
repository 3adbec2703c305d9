// Setting tables: one description of each configuration key, used for everything that concerns the key.
//
// A component lists the keys of a struct once, in a SettingTable: name, unit, range, meaning and member. The table
// reads the keys from a Config into the struct, and describes them for the default file, the reference page, the man
// page, shell completion and the live view (setting_documents.hpp). A default is the value that the member of the
// struct has before the table reads it, so it is written only in the struct.
//
//     const SettingTable<SolverSettings>& solver_settings() {
//         using S = SolverSettings;
//         using V = SettingValues<S>;
//         static const SettingTable<S> table{
//             "solver", "Position-based dynamics.",
//             {{{.key = "step", .unit = "s", .meaning = "Length of a step."}, V::number(&S::step, {1e-4, 0.1})}}};
//         return table;
//     }
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/types.hpp"

namespace haptic {

/// The words about one key. `meaning` is one or more sentences of plain text.
struct SettingText {
    std::string_view key;                // without its table: "step"
    std::string_view unit = {};          // "m/s"; empty: none
    std::string_view label = {};         // of the live view's control; empty: fixed while the process runs
    std::string_view old_key = {};       // former name with its table, still accepted with a notice
    std::string_view default_note = {};  // replaces the default in documents if it is not one constant
    bool required = false;               // no default at all: the table must give it
    std::string_view meaning = {};
};

/// The values that a key accepts.
struct SettingType {
    std::string name;  // "number", "integer", "true or false", "text", "choice", ...
    std::optional<Range> range = std::nullopt;
    std::vector<std::string> choices = {};  // the words that it takes, if it takes words
};

/// All that documents say about one key.
struct SettingDescription {
    std::string key;  // without its table
    SettingType type;
    std::string unit;
    std::string label;
    std::string old_key;
    std::string default_value;  // TOML; empty: none
    std::string default_note;
    bool required = false;
    std::string meaning;
};

enum class SectionKind : std::uint8_t {
    Table,     // [path]; the same as an empty table if it is missing
    Optional,  // [path], whose absence means something
    Repeated   // [[path]], any number of times
};

/// One table of a configuration file.
struct SettingSection {
    std::string path;  // "solver"; empty: the keys before the first table
    SectionKind kind = SectionKind::Table;
    std::string meaning;
    std::vector<SettingDescription> settings;
    std::string same_keys_as = {};  // path of a table whose keys, and those of its tables, each of these tables has too
    bool or_text = false;           // a text may take the place of the table
};

/// A member that takes a number or one of some words.
struct NumberOrWord {
    std::optional<double> number;
    std::string word;  // used if there is no number
};

// Values as TOML: shortest form that reads back to the same bits, numbers always with a point or an exponent.
[[nodiscard]] std::string toml_value(double value);
[[nodiscard]] std::string toml_value(std::int64_t value);
[[nodiscard]] std::string toml_value(bool value);
[[nodiscard]] std::string toml_value(const std::string& value);
[[nodiscard]] std::string toml_value(const std::vector<double>& values);
[[nodiscard]] std::string toml_value(const Vec3& value);
[[nodiscard]] std::string toml_value(const Quat& value);

/// How one key is read into a struct S, and how the struct's value is shown.
template <typename S>
struct SettingValue {
    SettingType type;
    std::function<void(const Config& config, const std::string& key, S& settings)> read;  // throws ConfigError
    std::function<std::string(const S& settings)> show;                                   // as TOML
};

/// Makes the SettingValue of a member of S. A member is a pointer to member, or a function from S& to a reference for
/// members of members: `[](S& s) -> auto& { return s.limits.force; }`.
template <typename S>
class SettingValues {
    template <typename Member>
    using Type = std::remove_cvref_t<std::invoke_result_t<Member, S&>>;

  public:
    template <typename Member>
    static SettingValue<S> number(Member member, Range range) {
        static_assert(std::same_as<Type<Member>, double>);
        return make(
            member, {"number", range},
            [range](const Config& c, const std::string& key, double& v) { v = c.number(key, v, range); },
            [](double v) { return toml_value(v); });
    }

    /// A number without a default: absent means something else than any number.
    template <typename Member>
    static SettingValue<S> optional_number(Member member, Range range) {
        return make(
            member, {"number", range},
            [range](const Config& c, const std::string& key, std::optional<double>& v) {
                const double given = c.number(key, 0.0, range);  // notes the key as known, even if it is absent
                if (c.has(key)) {
                    v = given;
                }
            },
            [](const std::optional<double>& v) { return v ? toml_value(*v) : std::string(); });
    }

    template <typename Member>
    static SettingValue<S> integer(Member member, Range range) {
        using T = Type<Member>;
        static_assert(std::integral<T>);
        return make(
            member, {"integer", range},
            [range](const Config& c, const std::string& key, T& v) {
                v = static_cast<T>(c.integer(key, static_cast<std::int64_t>(v), range));
            },
            [](T v) { return toml_value(static_cast<std::int64_t>(v)); });
    }

    /// A member in nanoseconds, a key in seconds.
    template <typename Member>
    static SettingValue<S> duration(Member member, Range range_s) {
        static_assert(std::same_as<Type<Member>, std::int64_t>);
        return make(
            member, {"number", range_s},
            [range_s](const Config& c, const std::string& key, std::int64_t& ns) {
                ns = nanoseconds(c.number(key, seconds(ns), range_s));
            },
            [](std::int64_t ns) { return toml_value(seconds(ns)); });
    }

    template <typename Member>
    static SettingValue<S> flag(Member member) {
        return make(
            member, {"true or false"}, [](const Config& c, const std::string& key, bool& v) { v = c.flag(key, v); },
            [](bool v) { return toml_value(v); });
    }

    template <typename Member>
    static SettingValue<S> text(Member member) {
        return make(
            member, {"text"}, [](const Config& c, const std::string& key, std::string& v) { v = c.text(key, v); },
            [](const std::string& v) { return toml_value(v); });
    }

    template <typename Member>
    static SettingValue<S> number_or_word(Member member, Range range, const std::vector<std::string>& words) {
        return make(
            member, {"number or choice", range, words},
            [range, words](const Config& c, const std::string& key, NumberOrWord& v) {
                if (c.has(key) && !c.has_text(key)) {
                    v.number = c.number(key, 0.0, range);
                } else {
                    v.word = c.choice(key, v.word, words);
                }
            },
            [](const NumberOrWord& v) { return v.number ? toml_value(*v.number) : toml_value(v.word); });
    }

    /// One of some names; each stands for a value of the member.
    template <typename Member>
    static SettingValue<S> choice(
        Member member, const std::vector<std::pair<std::string, std::type_identity_t<Type<Member>>>>& names) {
        using T = Type<Member>;
        std::vector<std::string> words;
        words.reserve(names.size());
        for (const auto& [name, value] : names) {
            words.push_back(name);
        }
        const auto name_of = [names](const T& value) {
            for (const auto& [name, meant] : names) {
                if (meant == value) {
                    return name;
                }
            }
            return std::string();
        };
        return make(
            member, {"choice", std::nullopt, words},
            [names, words, name_of](const Config& c, const std::string& key, T& v) {
                const std::string chosen = c.choice(key, name_of(v), words);
                for (const auto& [name, value] : names) {
                    if (name == chosen) {
                        v = value;
                    }
                }
            },
            [name_of](const T& v) { return toml_value(name_of(v)); });
    }

    /// A value that a function of the component reads: Type parse(config, key). `shown` is its default, as TOML.
    template <typename Member, typename Parse>
    static SettingValue<S> parsed(Member member, SettingType type, const std::string& shown, Parse parse) {
        return make(
            member, std::move(type),
            [parse](const Config& c, const std::string& key, Type<Member>& v) { v = parse(c, key); },
            [shown](const Type<Member>&) { return shown; });
    }

    template <typename Member>
    static SettingValue<S> vector(Member member, Range range_of_each) {
        return make(
            member, {"3 numbers", range_of_each},
            [range_of_each](const Config& c, const std::string& key, Vec3& v) { v = c.vec3(key, v, range_of_each); },
            [](const Vec3& v) { return toml_value(v); });
    }

    /// A unit quaternion (w, x, y, z).
    template <typename Member>
    static SettingValue<S> rotation(Member member) {
        return make(
            member, {"unit quaternion"}, [](const Config& c, const std::string& key, Quat& v) { v = c.quat(key, v); },
            [](const Quat& v) { return toml_value(v); });
    }

    template <typename Member>
    static SettingValue<S> numbers(Member member, Range range_of_each) {
        return make(
            member, {"list of numbers", range_of_each},
            [range_of_each](const Config& c, const std::string& key, std::vector<double>& v) {
                v = c.numbers(key, v, range_of_each);
            },
            [](const std::vector<double>& v) { return toml_value(v); });
    }

  private:
    template <typename Member, typename Read, typename Show>
    static SettingValue<S> make(Member member, SettingType type, const Read& read, const Show& show) {
        return {std::move(type),
                [member, read](const Config& c, const std::string& key, S& s) { read(c, key, std::invoke(member, s)); },
                [member, show](const S& s) {
                    S copy = s;  // a function member takes S&
                    return show(std::invoke(member, copy));
                }};
    }
};

template <typename S>
struct Setting {
    SettingText text;
    SettingValue<S> value;
};

/// The keys of one table of a configuration file that belong to one struct.
template <typename S>
class SettingTable {
  public:
    SettingTable(std::string path, std::string meaning, std::vector<Setting<S>> settings,
                 SectionKind kind = SectionKind::Table)
        : path_(std::move(path)), meaning_(std::move(meaning)), settings_(std::move(settings)), kind_(kind) {}

    /// Reads every key that the configuration has; other members stay as they are. Throws ConfigError.
    void read(const Config& config, S& settings) const { read(config, path_, settings); }
    /// The same from another table with these keys: "objects.0".
    void read(const Config& config, const std::string& path, S& settings) const {
        for (const Setting<S>& setting : settings_) {
            read_one(config, path, setting, settings);
        }
    }
    /// Reads one key, for defaults of others that depend on it.
    void read_key(const Config& config, const std::string& path, std::string_view key, S& settings) const {
        for (const Setting<S>& setting : settings_) {
            if (setting.text.key == key) {
                read_one(config, path, setting, settings);
            }
        }
    }

    /// The descriptions, with the values of `defaults`.
    [[nodiscard]] SettingSection describe(const S& defaults = S()) const {
        SettingSection section{path_, kind_, meaning_, {}};
        for (const Setting<S>& setting : settings_) {
            const SettingText& text = setting.text;
            section.settings.push_back({.key = std::string(text.key),
                                        .type = setting.value.type,
                                        .unit = std::string(text.unit),
                                        .label = std::string(text.label),
                                        .old_key = std::string(text.old_key),
                                        .default_value = setting.value.show(defaults),
                                        .default_note = std::string(text.required ? "required" : text.default_note),
                                        .required = text.required,
                                        .meaning = std::string(text.meaning)});
        }
        return section;
    }

  private:
    static void read_one(const Config& config, const std::string& path, const Setting<S>& setting, S& settings) {
        const std::string key = (path.empty() ? "" : path + ".") + std::string(setting.text.key);
        if (!setting.text.old_key.empty()) {
            config.accept_old_key(std::string(setting.text.old_key), key);
        }
        setting.value.read(config, key, settings);
    }

    std::string path_;
    std::string meaning_;
    std::vector<Setting<S>> settings_;
    SectionKind kind_;
};

}  // namespace haptic
