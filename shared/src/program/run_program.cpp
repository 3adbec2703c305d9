#include "program/run_program.hpp"

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "edit_distance.hpp"
#include "joined.hpp"
#include "program/exit_status.hpp"

namespace haptic {
namespace {

int fail(const CLI::App& app, int status, const std::string& problem) {
    (void)std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), problem.c_str());
    return status;
}

/// The application or the command of it that was given: the one whose options the others are.
const CLI::App* innermost(const CLI::App* app) {
    const std::vector<CLI::App*> given = app->get_subcommands();
    return given.empty() ? app : innermost(given.front());
}

/// Commands and options that --help lists.
std::vector<std::string> commands_of(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::App* const command :
         app.get_subcommands([](const CLI::App* c) { return !c->get_group().empty(); })) {
        names.push_back(command->get_name());
    }
    return names;
}

std::vector<std::string> options_of(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::Option* const option :
         app.get_options([](const CLI::Option* o) { return !o->get_group().empty(); })) {
        for (const std::string& name : option->get_lnames()) {
            names.push_back("--" + name);
        }
    }
    return names;
}

/// What is wrong with the arguments, and what would be right.
std::string problem_of(const CLI::App& app, const CLI::ParseError& error) {
    const CLI::App* const command = innermost(&app);
    const std::vector<std::string> unknown = app.remaining(true);
    if (dynamic_cast<const CLI::ExtrasError*>(&error) == nullptr || unknown.empty()) {
        return error.what();
    }
    const std::string& word = unknown.front();
    if (word.starts_with("-")) {
        return "there is no option " + word + detail::guess(word.substr(0, word.find('=')), options_of(*command));
    }
    if (command == &app) {
        return "there is no command " + word + detail::guess(word, commands_of(app));
    }
    return error.what();
}

/// The status, unless some of the output is missing.
int with_output_written(const CLI::App& app, int status) {
    errno = 0;
    const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    // A reader that has seen enough, such as head, is no error.
    if (written || errno == EPIPE) {
        return status;
    }
    // A write before the last one failed with an error number that is gone.
    const std::string reason = errno == 0 ? "not written completely" : std::generic_category().message(errno);
    return fail(app, status == kExitDone ? kExitFailed : status, "standard output: " + reason);
}

}  // namespace

std::string message_of(const std::exception& error) {
    if (const auto* const file = dynamic_cast<const std::filesystem::filesystem_error*>(&error)) {
        return file->path1().string() + ": " + file->code().message();
    }
    return dynamic_cast<const std::bad_alloc*>(&error) != nullptr ? "out of memory" : error.what();
}

int run_program(CLI::App& app, int argc, const char* const* argv, const std::function<int()>& command) {
    app.set_version_flag("--version", app.get_name() + " " + HAPTIC_VERSION);
    int status = kExitFailed;
    try {
        app.parse(argc, argv);
        if (app.get_subcommands().empty()) {
            throw CLI::RequiredError("A command (" + detail::joined(commands_of(app), ", ") + ")");
        }
        status = command();
    } catch (const CLI::Success& request) {
        status = app.exit(request);  // --help, --version and the like
    } catch (const CLI::ParseError& error) {
        status = fail(app, kExitUsage, problem_of(app, error) + "\nRun with --help for more information.");
    } catch (const std::exception& error) {
        status = fail(app, kExitFailed, message_of(error));
    }
    return with_output_written(app, status);
}

std::string program_version() {
    return HAPTIC_VERSION;
}

int run_main(int (*program)(int argc, char** argv), int argc, char** argv) noexcept {
    try {
        return program(argc, argv);
    } catch (const std::exception& error) {
        (void)std::fprintf(stderr, "error: %s\n", error.what());
    } catch (...) {
        (void)std::fputs("error: unknown\n", stderr);
    }
    return kExitFailed;
}

}  // namespace haptic
