// Man pages in roff: section 1 for a program, section 5 for its configuration file.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "documents/command_text.hpp"
#include "haptic/setting_documents.hpp"

namespace haptic {

/// The parts of a man page that the command line does not say. Texts are plain; an empty line separates paragraphs.
struct ManText {
    std::string summary;  // after the name, in lower case and without a full stop
    std::string description;
    std::vector<std::pair<std::string, std::string>> exit_status;  // "0", "the run was ended in an orderly way"
    std::vector<std::pair<std::string, std::string>> files;
    std::vector<std::pair<std::string, std::string>> examples;  // command, what it does
    std::vector<std::string> see_also;                          // "host-sim(1)"
};

[[nodiscard]] std::string program_man_page(const CommandText& program, const ManText& text);

/// `name` is that of the page: "rt-core.toml".
[[nodiscard]] std::string settings_man_page(const std::string& name, const ManText& text,
                                            const SettingReference& reference);

}  // namespace haptic
