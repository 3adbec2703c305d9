// Setting documents: the default file, the reference page, the man page section and completion words of described keys.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "haptic/setting.hpp"

namespace haptic {

/// All tables of one kind of configuration file.
using SettingReference = std::vector<SettingSection>;

/// Adds a section; one with the path of an earlier section is appended to that section.
void add_section(SettingReference& reference, SettingSection section);

/// "solver.step"; for the keys of a repeated section, "model.regions.fixed".
[[nodiscard]] std::string full_key(const SettingSection& section, const SettingDescription& setting);

/// The description of a full key. Throws std::out_of_range if there is none.
[[nodiscard]] const SettingDescription& find_setting(const SettingReference& reference, std::string_view full_key);

/// A TOML file with every key, its default, unit, range and meaning. Keys without a constant default, and optional and
/// repeated sections, are commented out. Reads back to the defaults. `heading` becomes a comment.
[[nodiscard]] std::string commented_toml(std::string_view heading, const SettingReference& reference);

/// A page of Markdown with one table of keys per section, below `heading`, which is Markdown.
[[nodiscard]] std::string markdown_reference(std::string_view heading, const SettingReference& reference);

/// The same for a man page: one .SS per section.
[[nodiscard]] std::string roff_reference(const SettingReference& reference);

/// Words that may follow --set: "solver.step=", and "contact.method=thesis" for keys that take words.
[[nodiscard]] std::vector<std::string> completion_words(const SettingReference& reference);

/// Text as it may appear in a roff page.
[[nodiscard]] std::string roff_text(std::string_view text);

/// The same as one argument of a macro: in quotes, with quotes within it written twice.
[[nodiscard]] std::string roff_argument(std::string_view text);

}  // namespace haptic
