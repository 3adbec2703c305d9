// firmware-host: command line of the emulated Spidar-G6 boards.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "commands/commands.hpp"
#include "commands/firmware_host_documents.hpp"
#include "commands/reach_command.hpp"
#include "commands/serve_command.hpp"
#include "haptic/numeric.hpp"
#include "haptic/pose_track.hpp"
#include "parsed_number.hpp"
#include "program/exit_status.hpp"
#include "program/run_program.hpp"

namespace {

using haptic::device::DeviceGeometry;
using haptic::device::ExchangeRequest;

// s; representable in nanoseconds with 64 bits.
constexpr double kMaxTime = 9e9;
// m; half the length that a 16-bit counter covers.
constexpr double kMaxDistance = 0.5;

/// Parses "a,b,c" into finite numbers. Throws CLI::ValidationError that names the option.
std::vector<double> numbers_of(const std::string& option, std::string_view text) {
    std::vector<double> numbers;
    while (true) {
        const std::size_t comma = text.find(',');
        const std::string_view cell = text.substr(0, comma);
        const std::optional<double> number = haptic::detail::parsed_signed_number<double>(cell);
        if (!number || !std::isfinite(*number)) {
            throw CLI::ValidationError(option, "'" + std::string(cell) + "' is not a finite number");
        }
        numbers.push_back(*number);
        if (comma == std::string_view::npos) {
            return numbers;
        }
        text.remove_prefix(comma + 1);
    }
}

haptic::Pose pose_of(const std::string& text) {
    const std::vector<double> v = numbers_of("--pose", text);
    if (v.size() != 3 && v.size() != 7) {
        throw CLI::ValidationError("--pose", "must be x,y,z or x,y,z,qw,qx,qy,qz, not " + std::to_string(v.size()) +
                                                 (v.size() == 1 ? " number" : " numbers"));
    }
    haptic::Pose pose{{v[0], v[1], v[2]}, {1.0, 0.0, 0.0, 0.0}};
    if (v.size() == 7) {
        pose.orientation = haptic::Quat(v[3], v[4], v[5], v[6]);
        const double length = glm::length(pose.orientation);
        if (!(std::abs(length - 1.0) <= haptic::kUnitTolerance)) {
            throw CLI::ValidationError("--pose", "the quaternion has length " + std::to_string(length) + ", not 1");
        }
        pose.orientation = glm::normalize(pose.orientation);
    }
    return pose;
}

double tension_of(const std::string& option, double tension, const DeviceGeometry& geometry) {
    if (!std::isfinite(tension) || tension < 0.0 || tension > geometry.maximum_tension) {
        throw CLI::ValidationError(option, "a tension must be between 0 and " +
                                               std::to_string(geometry.maximum_tension) + " N, not " +
                                               std::to_string(tension));
    }
    return tension;
}

/// Command line after `exchange`.
struct ExchangeArguments {
    std::string hand;
    double at_s = 0.0;
    std::string pose;
    double tension = 0.0;
    std::string tensions;
    bool hex = false;
};

CLI::App* add_exchange(CLI::App& app, ExchangeArguments& arguments, const DeviceGeometry& geometry) {
    CLI::App* exchange = app.add_subcommand(
        "exchange", "Send one packet to an emulated board; show both packets and the wrench of the strings");
    arguments.tension = geometry.minimum_tension;
    CLI::Option* hand = exchange->add_option("--hand", arguments.hand,
                                             "Recording (CSV: time_s,x_m,y_m,z_m[,qw,qx,qy,qz]) that the hand follows");
    exchange->add_option("--at", arguments.at_s, "Time in the recording, s")->needs(hand)->capture_default_str();
    exchange->add_option("--pose", arguments.pose, "x,y,z[,qw,qx,qy,qz]: pose of the hand, m and unit quaternion")
        ->excludes(hand);
    CLI::Option* tension =
        exchange->add_option("--tension", arguments.tension, "Tension of every string, N")->capture_default_str();
    exchange->add_option("--tensions", arguments.tensions, "Tension of each string, N: t0,...,t7")->excludes(tension);
    exchange->add_flag("--hex", arguments.hex, "Also show the packets' bytes");
    return exchange;
}

ExchangeRequest request_of(const ExchangeArguments& arguments, const DeviceGeometry& geometry) {
    ExchangeRequest request;
    request.hex = arguments.hex;
    if (!std::isfinite(arguments.at_s) || arguments.at_s < 0.0 || arguments.at_s > kMaxTime) {
        throw CLI::ValidationError("--at", "must be a time of 0 s or more, not " + std::to_string(arguments.at_s));
    }
    if (!arguments.pose.empty()) {
        request.grip = pose_of(arguments.pose);
    }
    if (arguments.tensions.empty()) {
        request.tensions.fill(tension_of("--tension", arguments.tension, geometry));
    } else {
        const std::vector<double> tensions = numbers_of("--tensions", arguments.tensions);
        if (tensions.size() != haptic::kStrings) {
            throw CLI::ValidationError(
                "--tensions", "must be 8 numbers, one for each string, not " + std::to_string(tensions.size()));
        }
        for (std::size_t i = 0; i < tensions.size(); ++i) {
            request.tensions[i] = tension_of("--tensions", tensions[i], geometry);
        }
    }
    if (!arguments.hand.empty()) {
        request.grip = haptic::PoseTrack::load(arguments.hand).at(haptic::nanoseconds(arguments.at_s));
    }
    if (!(glm::length(request.grip.position) <= kMaxDistance)) {
        throw CLI::ValidationError(arguments.hand.empty() ? "--pose" : "--hand",
                                   "the hand is more than 0.5 m from the centre, where the counters wrap");
    }
    return request;
}

int program(int argc, char** argv) {
    const DeviceGeometry geometry = haptic::device::spidar_g6_x3r();
    CLI::App app{"Emulated Spidar-G6 boards: device geometries, packets, and an emulated device.", "firmware-host"};
    app.require_subcommand(0, 1);
    haptic::add_generate_option(app, haptic::device::firmware_host_documents);
    ExchangeArguments arguments;
    const CLI::App* exchange = add_exchange(app, arguments, geometry);
    std::vector<std::string> geometry_files;
    const auto add_geometries = [&](const char* name) {
        CLI::App* const command = app.add_subcommand(
            name, "Show geometry, constants and reach of the built-in device geometries, or of files");
        command->add_option("FILE", geometry_files, "TOML files to check and show instead of the built-in ones");
        return command;
    };
    const CLI::App* const geometries = add_geometries("geometries");
    // The former name; CLI11 hides subcommands without a group from the help.
    const CLI::App* const variants = add_geometries("variants")->group("");
    haptic::device::ReachArguments reach_arguments;
    const CLI::App* reach = haptic::device::add_reach(app, reach_arguments);
    haptic::device::ServeArguments serve_arguments;
    (void)haptic::device::add_serve(app, serve_arguments);

    return haptic::run_program(app, argc, argv, [&] {
        if (variants->parsed()) {
            std::fputs("firmware-host: `variants` is now called `geometries`\n", stderr);
        }
        if (geometries->parsed() || variants->parsed()) {
            haptic::device::run_geometries(geometry_files);
            return haptic::kExitDone;
        }
        if (exchange->parsed()) {
            const bool replied = haptic::device::run_exchange(geometry, request_of(arguments, geometry));
            return replied ? haptic::kExitDone : haptic::kExitFailed;
        }
        if (reach->parsed()) {
            haptic::device::run_reach(reach_arguments);
            return haptic::kExitDone;
        }
        haptic::device::run_serve(serve_arguments);
        return haptic::kExitDone;
    });
}

}  // namespace

int main(int argc, char** argv) {
    return haptic::run_main(program, argc, argv);
}
