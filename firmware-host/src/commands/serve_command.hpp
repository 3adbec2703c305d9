// `firmware-host serve`: an emulated board for other processes and machines.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic::device {

/// What was typed after `serve`.
struct ServeArguments {
    std::string usbip;  // ADDR:PORT
    CLI::Option* usbip_asked = nullptr;
    std::string tty;  // LINK, empty for none
    CLI::Option* tty_asked = nullptr;
    std::string variant = "SpidarG6X3R";
    std::optional<std::filesystem::path> hand;
    double hand_delay_s = 0.5;
    std::vector<std::string> faults;              // fault.hpp
    std::optional<std::filesystem::path> config;  // of which the table [emulated] counts
    std::vector<std::string> assignments;         // --set
};

/// Adds the subcommand; the arguments must outlive the parsing.
CLI::App* add_serve(CLI::App& app, ServeArguments& arguments);

/// Serves until SIGINT, SIGTERM or SIGHUP. Prints a line for each server that listens, and one for each client that
/// comes or goes. Throws ConfigError, CLI::ValidationError for arguments that cannot be, and std::runtime_error for
/// what the system refuses.
void run_serve(const ServeArguments& arguments);

}  // namespace haptic::device
