#include "documents/program_documents.hpp"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "documents/json_schema.hpp"

namespace haptic {
namespace {

void write(const std::filesystem::path& file, const std::string& text) {
    std::ofstream stream(file, std::ios::binary);
    if (!(stream << text).flush()) {
        throw std::runtime_error(file.string() + ": cannot be written");
    }
}

}  // namespace

void write_documents(const std::string& folder, const CLI::App& app, const ProgramDocuments& documents) {
    const std::filesystem::path out = folder;
    std::filesystem::create_directories(out);
    const CommandText program = command_text(app);
    write(out / (program.name + ".1"), program_man_page(program, documents.text));
    write(out / (program.name + ".bash"), bash_completion(program, documents.words));
    write(out / ("_" + program.name), zsh_completion(program, documents.words));
    write(out / (program.name + ".fish"), fish_completion(program, documents.words));
    if (documents.settings) {
        const SettingsDocument& settings = *documents.settings;
        write(out / (settings.page + ".5"), settings_man_page(settings.page, settings.text, settings.reference));
        write(out / settings.default_name, settings.default_file);
        write(out / "settings.md", settings.markdown);
        write(out / (settings.page + ".schema.json"), json_schema(settings.text.summary, settings.reference));
    }
}

void add_generate_option(CLI::App& app, ProgramDocuments (*make)()) {
    app.add_option_function<std::string>("--generate",
                                         [&app, make](const std::string& folder) {
                                             write_documents(folder, app, make());
                                             throw CLI::Success();
                                         })
        ->trigger_on_parse()
        ->group("");
}

}  // namespace haptic
