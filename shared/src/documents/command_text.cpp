#include "documents/command_text.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstddef>
#include <string_view>

namespace haptic {
namespace {

std::vector<std::string> split(std::string_view text, char separator) {
    std::vector<std::string> parts;
    while (!text.empty()) {
        const std::string_view part = text.substr(0, text.find(separator));
        parts.emplace_back(part);
        text.remove_prefix(std::min(text.size(), part.size() + 1));
    }
    return parts;
}

/// The names of "{real,lockstep}", which is how CLI::IsMember describes itself; none for another text.
std::vector<std::string> members(std::string_view text) {
    const bool list = text.size() > 2 && text.front() == '{' && text.back() == '}';
    return list ? split(text.substr(1, text.size() - 2), ',') : std::vector<std::string>();
}

ValueKind kind_of(const OptionText& option) {
    const std::string_view value = option.value;
    if (value.empty()) {
        return ValueKind::None;
    }
    if (!option.choices.empty()) {
        return ValueKind::Words;
    }
    if (value.find("KEY=VALUE") != std::string_view::npos) {
        return ValueKind::Settings;
    }
    if (value.find("DIR") != std::string_view::npos) {
        return ValueKind::Folder;
    }
    // Text without a more precise type may be a file: offering one does no harm.
    const bool file = value == "TEXT" || value.find('.') != std::string_view::npos ||
                      value.find("FILE") != std::string_view::npos || value.find("SCENE") != std::string_view::npos;
    return file ? ValueKind::File : ValueKind::Other;
}

OptionText option_text(const CLI::Option& option) {
    OptionText text;
    for (const std::string& name : option.get_lnames()) {
        text.names.push_back("--" + name);
    }
    for (const std::string& name : option.get_snames()) {
        text.names.push_back("-" + name);
    }
    text.positional = text.names.empty();
    if (text.positional) {
        text.names.push_back(option.get_name(true));
    }
    if (option.get_items_expected_max() > 0) {
        // "TEXT:{a,b}": the type, then what each validator says of itself.
        const std::string type = option.get_type_name();
        const std::size_t colon = type.find(":{");
        text.value = colon == std::string::npos ? type : type.substr(0, colon);
        text.choices = colon == std::string::npos ? text.choices : members(type.substr(colon + 1));
        if (text.choices.empty()) {
            text.value = type;
        }
    }
    text.value_optional = option.get_items_expected_max() > 0 && option.get_items_expected_min() == 0;
    text.required = option.get_required();
    text.repeatable = option.get_expected_max() > 2 || option.get_allow_extra_args();
    text.default_value = option.get_default_str();
    text.meaning = option.get_description();
    text.kind = kind_of(text);
    return text;
}

}  // namespace

// NOLINTNEXTLINE(misc-no-recursion): as deep as subcommands are nested
CommandText command_text(const CLI::App& app) {
    CommandText text{app.get_name(), app.get_description(), {}, {}};
    for (const CLI::Option* const option :
         app.get_options([](const CLI::Option* o) { return !o->get_group().empty(); })) {
        text.options.push_back(option_text(*option));
    }
    for (const CLI::App* const command :
         app.get_subcommands([](const CLI::App* c) { return !c->get_group().empty(); })) {
        text.commands.push_back(command_text(*command));
    }
    return text;
}

}  // namespace haptic
