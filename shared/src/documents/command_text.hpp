// Command texts: what documents say about a program's command line, taken from its CLI11 application.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace haptic {

/// Kind of an option's value, for completion.
enum class ValueKind { None, Words, Settings, Folder, File, Other };

struct OptionText {
    std::vector<std::string> names;  // "--config", "-c"; of a positional argument its name alone
    std::string value;               // "F.toml"; empty: a flag
    bool value_optional = false;
    bool positional = false;
    bool required = false;
    bool repeatable = false;
    std::string default_value;
    std::vector<std::string> choices;
    std::string meaning;
    ValueKind kind = ValueKind::None;
};

struct CommandText {
    std::string name;
    std::string meaning;
    std::vector<OptionText> options;  // positional arguments too
    std::vector<CommandText> commands;
};

/// Reads an application with its options and subcommands. Hidden ones, which have no group, are left out.
[[nodiscard]] CommandText command_text(const CLI::App& app);

}  // namespace haptic
