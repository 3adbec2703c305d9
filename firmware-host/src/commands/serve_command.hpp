// `firmware-host serve`: makes an emulated board available to other processes and machines.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic::device {

/// Command line after `serve`.
struct ServeArguments {
    std::string usbip;  // ADDR:PORT
    CLI::Option* usbip_option = nullptr;
    std::string usbredir;  // path of the socket
    CLI::Option* usbredir_option = nullptr;
    std::string speed = "high";  // or "full"
    std::string tty;             // LINK, empty for none
    CLI::Option* tty_option = nullptr;
    std::string geometry = "SpidarG6X3R";
    std::optional<std::filesystem::path> hand;
    double hand_delay_s = 0.5;
    std::optional<std::filesystem::path> record;  // of the motors' DAC codes
    std::vector<std::string> faults;              // fault.hpp
    std::vector<std::string> wiring;              // wiring.hpp
    std::optional<std::filesystem::path> config;  // only its table [emulated] is used
    std::vector<std::string> assignments;         // --set
};

/// Adds the subcommand. The arguments must outlive the parsing.
CLI::App* add_serve(CLI::App& app, ServeArguments& arguments);

/// Serves until SIGINT, SIGTERM or SIGHUP. Prints a line for each listening server, and for each client that connects
/// or disconnects. Throws ConfigError, CLI::ValidationError for invalid arguments, and std::runtime_error for errors of
/// the system.
void run_serve(const ServeArguments& arguments);

}  // namespace haptic::device
