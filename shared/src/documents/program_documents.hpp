// Documents of a program: man pages, shell completion, default configuration with its schema, reference page.
#pragma once

#include <optional>
#include <string>

#include "documents/completion.hpp"
#include "documents/man_page.hpp"
#include "haptic/setting_documents.hpp"

namespace CLI {
class App;
}

namespace haptic {

/// A configuration file, with its man page of section 5.
struct SettingsDocument {
    std::string page;  // name of the man page: "rt-core.toml"
    ManText text;
    std::string default_name;  // file name of the commented default file
    std::string default_file;  // its content
    std::string markdown;      // the reference page
    SettingReference reference;
};

struct ProgramDocuments {
    ManText text;
    CompletionWords words;
    std::optional<SettingsDocument> settings;
};

/// Writes into a folder: NAME.1, NAME.bash, _NAME and NAME.fish; with settings also PAGE.5, the default file,
/// settings.md and PAGE.schema.json. Throws std::runtime_error.
void write_documents(const std::string& folder, const CLI::App& app, const ProgramDocuments& documents);

/// Adds the hidden option --generate DIR, which writes the documents and ends the program. The build calls it. `make`
/// is called only then.
void add_generate_option(CLI::App& app, ProgramDocuments (*make)());

}  // namespace haptic
