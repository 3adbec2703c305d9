#include "haptic/setting_documents.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <stdexcept>

#include "joined.hpp"

namespace haptic {
namespace {

using detail::joined;

constexpr std::size_t kLineWidth = 120;
constexpr std::size_t kMaxCommentColumn = 36;  // comments of longer assignments begin after the assignment

/// Shortest form that reads back to the same bits, with exponents as people write them: 1e6, 2e-5.
std::string shortest(double value) {
    char buffer[32];
    const double size = std::abs(value);
    const auto form =
        size == 0.0 || (size >= 1e-4 && size < 1e6) ? std::chars_format::fixed : std::chars_format::general;
    std::string text(std::begin(buffer), std::to_chars(std::begin(buffer), std::end(buffer), value, form).ptr);
    if (const std::size_t e = text.find('e'); e != std::string::npos) {
        const bool negative = text[e + 1] == '-';
        const std::size_t digits = std::min(text.find_first_not_of("+-0", e + 1), text.size() - 1);
        text = text.substr(0, e + 1) + (negative ? "-" : "") + text.substr(digits);
    }
    return text;
}

std::string quoted_choices(const SettingType& type) {
    std::vector<std::string> quoted;
    quoted.reserve(type.choices.size());
    for (const std::string& choice : type.choices) {
        quoted.push_back(toml_value(choice));
    }
    return joined(quoted, ", ");
}

/// The values that a key takes: "0.9 to 1", "\"a\", \"b\"", "true or false".
std::string values_of(const SettingType& type) {
    std::vector<std::string> parts;
    if (type.name == "text" || type.name == "unit quaternion" || type.name == "true or false") {
        parts.push_back(type.name);
    }
    if (type.name == "text or integer") {
        parts.emplace_back("text");
    }
    if (type.range) {
        const bool single = type.name != "3 numbers" && type.name != "list of numbers";
        parts.push_back((single ? "" : type.name + ", each ") + shortest(type.range->min) + " to " +
                        shortest(type.range->max));
    }
    if (!type.choices.empty()) {
        parts.push_back(quoted_choices(type));
    }
    return joined(parts, " or ");
}

/// "m, 0 to 10: meaning".
std::string comment_of(const SettingDescription& setting) {
    std::vector<std::string> facts;
    if (!setting.unit.empty()) {
        facts.push_back(setting.unit);
    }
    if (setting.type.name != "text") {
        facts.push_back(values_of(setting.type));
    }
    if (!setting.default_note.empty()) {
        facts.push_back("default: " + setting.default_note);
    }
    return facts.empty() ? setting.meaning : joined(facts, ", ") + ". " + setting.meaning;
}

std::vector<std::string> wrapped(std::string_view text, std::size_t width) {
    std::vector<std::string> lines;
    std::string line;
    while (!text.empty()) {
        const std::string_view word = text.substr(0, text.find(' '));
        text.remove_prefix(std::min(text.size(), word.size() + 1));
        if (!line.empty() && line.size() + 1 + word.size() > width) {
            lines.push_back(std::move(line));
            line.clear();
        }
        line += (line.empty() ? "" : " ") + std::string(word);
    }
    lines.push_back(std::move(line));
    return lines;
}

std::string as_comment(std::string_view text) {
    std::string out;
    for (const std::string& line : wrapped(text, kLineWidth - 2)) {
        out += "# " + line + '\n';
    }
    return out;
}

std::string assignment_of(const SettingSection& section, const SettingDescription& setting) {
    // A default that depends on something else must not become a constant by being written.
    const bool constant = !setting.default_value.empty() && setting.default_note.empty();
    const bool commented = section.kind != SectionKind::Table || !constant;
    return (commented ? "# " : "") + setting.key + " = " +
           (setting.default_value.empty() ? "..." : setting.default_value);
}

void write_toml(std::string& out, const SettingSection& section) {
    const std::string lead = section.kind == SectionKind::Table ? "" : "# ";
    if (!section.path.empty()) {
        const bool repeated = section.kind == SectionKind::Repeated;
        out += '\n' + lead + (repeated ? "[[" : "[") + section.path + (repeated ? "]]\n" : "]\n");
    }
    if (!section.meaning.empty()) {
        out += as_comment(section.meaning);
    }
    std::size_t column = 0;
    for (const SettingDescription& setting : section.settings) {
        const std::size_t width = assignment_of(section, setting).size() + 2;
        column = std::max(column, width <= kMaxCommentColumn ? width : 0);
    }
    for (const SettingDescription& setting : section.settings) {
        std::string line = assignment_of(section, setting);
        line.resize(std::max(column, line.size() + 2), ' ');
        const std::size_t indent = line.size();
        const std::size_t width = std::max<std::size_t>(50, kLineWidth - std::min(indent + 2, kLineWidth));
        for (const std::string& part : wrapped(comment_of(setting), width)) {
            out.append(line).append("# ").append(part).append("\n");
            line.assign(indent, ' ');
        }
    }
}

/// A cell of a Markdown table.
std::string cell(std::string_view text) {
    std::string out;
    for (const char c : text) {
        out += c == '|' ? "\\|" : std::string(1, c);
    }
    return out;
}

std::string code(const std::string& text) {
    return text.empty() ? "" : "`" + text + "`";
}

std::string default_of(const SettingDescription& setting) {
    return setting.default_note.empty() ? code(setting.default_value) : cell(setting.default_note);
}

std::string remarks_of(const SettingDescription& setting) {
    std::string text;
    if (!setting.label.empty()) {
        text += " Can be changed while the scene runs.";
    }
    if (!setting.old_key.empty()) {
        text += " Former name: " + setting.old_key + ".";
    }
    return text;
}

std::string heading_of(const SettingSection& section) {
    if (section.path.empty()) {
        return "Top level";
    }
    return section.kind == SectionKind::Repeated ? "[[" + section.path + "]]" : "[" + section.path + "]";
}

}  // namespace

std::string toml_value(double value) {
    const std::string text = shortest(value);
    return text.find_first_not_of("-0123456789") == std::string::npos ? text + ".0" : text;
}

std::string toml_value(std::int64_t value) {
    return std::to_string(value);
}

std::string toml_value(bool value) {
    return value ? "true" : "false";
}

std::string toml_value(const std::string& value) {
    std::string text = "\"";
    for (const char c : value) {
        text += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    }
    return text + "\"";
}

std::string toml_value(const std::vector<double>& values) {
    std::vector<std::string> texts;
    texts.reserve(values.size());
    for (const double value : values) {
        texts.push_back(toml_value(value));
    }
    return "[" + joined(texts, ", ") + "]";
}

std::string toml_value(const Vec3& value) {
    return toml_value(std::vector<double>{value.x, value.y, value.z});
}

std::string toml_value(const Quat& value) {
    return toml_value(std::vector<double>{value.w, value.x, value.y, value.z});
}

void add_section(SettingReference& reference, SettingSection section) {
    const auto found = std::find_if(reference.begin(), reference.end(),
                                    [&](const SettingSection& earlier) { return earlier.path == section.path; });
    if (found == reference.end()) {
        reference.push_back(std::move(section));
        return;
    }
    found->meaning += (found->meaning.empty() || section.meaning.empty() ? "" : " ") + section.meaning;
    std::move(section.settings.begin(), section.settings.end(), std::back_inserter(found->settings));
}

std::string full_key(const SettingSection& section, const SettingDescription& setting) {
    return section.path.empty() ? setting.key : section.path + "." + setting.key;
}

const SettingDescription& find_setting(const SettingReference& reference, std::string_view key) {
    for (const SettingSection& section : reference) {
        for (const SettingDescription& setting : section.settings) {
            if (full_key(section, setting) == key) {
                return setting;
            }
        }
    }
    throw std::out_of_range("no setting is named " + std::string(key));
}

std::string commented_toml(std::string_view heading, const SettingReference& reference) {
    std::string out = as_comment(heading);
    for (const SettingSection& section : reference) {
        out += section.path.empty() ? "\n" : "";
        write_toml(out, section);
    }
    return out;
}

std::string markdown_reference(std::string_view heading, const SettingReference& reference) {
    std::string out(heading);
    for (const SettingSection& section : reference) {
        const std::string name = heading_of(section);
        out += "\n## " + (section.path.empty() ? name : code(name)) + "\n\n";
        out += section.meaning.empty() ? "" : section.meaning + "\n\n";
        if (section.settings.empty()) {
            continue;
        }
        out += "| Key | Default | Unit | Values | Meaning |\n|---|---|---|---|---|\n";
        for (const SettingDescription& setting : section.settings) {
            out += "| " + code(setting.key) + " | " + default_of(setting) + " | " + cell(setting.unit) + " | " +
                   cell(values_of(setting.type)) + " | " + cell(setting.meaning + remarks_of(setting)) + " |\n";
        }
    }
    return out;
}

std::string roff_text(std::string_view text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '\\':
                out += "\\e";
                break;
            case '-':
                out += "\\-";
                break;
            case '\'':
            case '.':
                // A control character only at the start of a line.
                out += (out.empty() || out.back() == '\n' ? "\\&" : "") + std::string(1, c);
                break;
            default:
                out += c;
        }
    }
    return out;
}

std::string roff_argument(std::string_view text) {
    std::string out = "\"";
    for (const char c : roff_text(text)) {
        out += c == '"' ? "\"\"" : std::string(1, c);
    }
    return out + "\"";
}

std::string roff_reference(const SettingReference& reference) {
    std::string out;
    for (const SettingSection& section : reference) {
        out += ".SS " + roff_argument(heading_of(section)) + '\n';
        out += section.meaning.empty() ? "" : roff_text(section.meaning) + '\n';
        for (const SettingDescription& setting : section.settings) {
            out += ".TP\n.BR " + roff_argument(setting.key);
            if (setting.default_note.empty() && !setting.default_value.empty()) {
                out += " " + roff_argument(" = " + setting.default_value);
            }
            out += '\n' + roff_text(comment_of(setting) + remarks_of(setting)) + '\n';
        }
    }
    return out;
}

std::vector<std::string> completion_words(const SettingReference& reference) {
    std::vector<std::string> words;
    for (const SettingSection& section : reference) {
        if (section.kind == SectionKind::Repeated) {
            continue;  // --set cannot name an element of a list
        }
        for (const SettingDescription& setting : section.settings) {
            const std::string key = full_key(section, setting) + "=";
            std::vector<std::string> values = setting.type.choices;
            if (setting.type.name == "true or false") {
                values = {"true", "false"};
            }
            if (values.empty() || setting.type.range) {
                words.push_back(key);
            }
            for (const std::string& value : values) {
                words.push_back(key + value);
            }
        }
    }
    return words;
}

}  // namespace haptic
