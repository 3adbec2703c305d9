// Program: the frame of an executable's main(), the same for all of them.
#pragma once

#include <exception>
#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace haptic {

/// Parses the command line, runs `command`, and returns the exit status (exit_status.hpp).
///
/// Adds --version. One of the commands must be given. For an unknown command or option the message
/// names the nearest known one. An exception of `command` ends in one line on stderr and kExitFailed, one of CLI11 in
/// kExitUsage. Standard output that could not be written completely is an error too.
[[nodiscard]] int run_program(CLI::App& app, int argc, const char* const* argv, const std::function<int()>& command);

/// Version of all programs, as --version shows it.
[[nodiscard]] std::string program_version();

/// Calls `program` with the arguments of main(), which lets no exception out: one ends in a line on stderr and
/// kExitFailed.
[[nodiscard]] int run_main(int (*program)(int argc, char** argv), int argc, char** argv) noexcept;

/// The message of an exception for a person: that of a std::filesystem_error names a C++ function otherwise.
[[nodiscard]] std::string message_of(const std::exception& error);

}  // namespace haptic
