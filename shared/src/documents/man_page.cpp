#include "documents/man_page.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "joined.hpp"

namespace haptic {
namespace {

std::string upper(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return text;
}

/// Paragraphs: an empty line starts a new one.
std::string paragraphs(std::string_view text) {
    std::string out;
    for (bool first = true; !text.empty(); first = false) {
        const std::string_view paragraph = text.substr(0, text.find("\n\n"));
        text.remove_prefix(std::min(text.size(), paragraph.size() + 2));
        out += (first ? "" : ".PP\n") + roff_text(paragraph) + '\n';
    }
    return out;
}

std::string head(const std::string& name, int section, const ManText& text) {
    return ".TH " + roff_argument(upper(name)) + " " + std::to_string(section) + " \"\" " +
           roff_argument("haptic " HAPTIC_VERSION) + " \"Haptic system\"\n.SH NAME\n" + roff_text(name) + " \\- " +
           roff_text(text.summary) + '\n';
}

/// A list of terms and their meanings under a heading; nothing for an empty list.
std::string list(const std::string& heading, const std::vector<std::pair<std::string, std::string>>& entries) {
    std::string out = entries.empty() ? "" : ".SH " + roff_argument(heading) + '\n';
    for (const auto& [term, meaning] : entries) {
        out += ".TP\n.B " + roff_argument(term) + '\n' + roff_text(meaning) + '\n';
    }
    return out;
}

std::string tail(const ManText& text) {
    std::string out =
        list("EXIT STATUS", text.exit_status) + list("FILES", text.files) + list("EXAMPLES", text.examples);
    out += text.see_also.empty() ? "" : ".SH SEE ALSO\n";
    for (std::size_t i = 0; i < text.see_also.size(); ++i) {
        const std::string& page = text.see_also[i];
        const std::size_t parenthesis = std::min(page.find('('), page.size());
        out += ".BR " + roff_argument(page.substr(0, parenthesis)) + " " +
               roff_argument(page.substr(parenthesis) + (i + 1 < text.see_also.size() ? "," : "")) + '\n';
    }
    return out;
}

std::string option_entry(const OptionText& option) {
    std::string out = ".TP\n";
    const std::string names = detail::joined(option.names, ", ");
    const bool optional = option.value_optional && !option.value.starts_with('[');
    const std::string value = optional ? "[" + option.value + "]" : option.value;
    if (option.positional) {
        out += ".I " + roff_argument(names) + '\n';
    } else if (value.empty()) {
        out += ".B " + roff_argument(names) + '\n';
    } else {
        out += ".BI " + roff_argument(names + " ") + " " + roff_argument(value) + '\n';
    }
    std::string meaning = option.meaning;
    const auto end_sentence = [&meaning] { meaning += meaning.ends_with('.') ? "" : "."; };
    end_sentence();
    if (!option.choices.empty()) {
        meaning += " One of " + detail::joined(option.choices, ", ");
        end_sentence();
    }
    if (!option.default_value.empty()) {
        meaning += " Default: " + option.default_value;
        end_sentence();
    }
    return out + roff_text(meaning) + '\n';
}

std::string option_entries(const CommandText& command) {
    std::string out;
    for (const OptionText& option : command.options) {
        out += option_entry(option);
    }
    return out;
}

std::string synopsis(const CommandText& program, const CommandText& command) {
    std::string out = ".B " + roff_argument(program.name + " " + command.name) + "\n[\\fIoptions\\fR]\n";
    for (const OptionText& option : command.options) {
        if (option.positional) {
            const std::string name = "\\fI" + roff_text(option.names[0]) + "\\fR";
            out += (option.required ? name : "[" + name + "]") + '\n';
        }
    }
    return out;
}

}  // namespace

std::string program_man_page(const CommandText& program, const ManText& text) {
    std::string out = head(program.name, 1, text) + ".SH SYNOPSIS\n";
    for (const CommandText& command : program.commands) {
        out += (command.name == program.commands.front().name ? "" : ".br\n") + synopsis(program, command);
    }
    out += ".SH DESCRIPTION\n" + paragraphs(text.description);
    out += ".SH OPTIONS\n" + option_entries(program) + ".SH COMMANDS\n";
    for (const CommandText& command : program.commands) {
        out += ".SS " + roff_argument(program.name + " " + command.name) + '\n' +
               roff_text(command.meaning + (command.meaning.ends_with('.') ? "" : ".")) + '\n' +
               option_entries(command);
    }
    return out + tail(text);
}

std::string settings_man_page(const std::string& name, const ManText& text, const SettingReference& reference) {
    return head(name, 5, text) + ".SH DESCRIPTION\n" + paragraphs(text.description) + ".SH KEYS\n" +
           roff_reference(reference) + tail(text);
}

}  // namespace haptic
