// firmware-host: the Spidar-G6's board, hosted on Linux.
#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "commands/commands.hpp"
#include "haptic/pose_track.hpp"
#include "commands/serve_command.hpp"

namespace {

using haptic::device::ExchangeRequest;
using haptic::device::Variant;

constexpr int kFailed = 1;
constexpr int kWrongArguments = 2;
constexpr double kUnitTolerance = 1e-6;
// s, within this a time in nanoseconds fits the 64 bits that hold it.
constexpr double kLongest = 9e9;
// m, half the length that 16 bits count.
constexpr double kFurthest = 0.5;

/// The numbers of "a,b,c", all finite. Throws CLI::ValidationError that names the option.
std::vector<double> numbers_of(const std::string& option, std::string_view text) {
    std::vector<double> numbers;
    while (true) {
        const std::size_t comma = text.find(',');
        std::string_view cell = text.substr(0, comma);
        if (cell.starts_with('+')) {
            cell.remove_prefix(1);
        }
        double number = 0.0;
        const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), number);
        if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(number)) {
            throw CLI::ValidationError(option, "'" + std::string(cell) + "' is not a finite number");
        }
        numbers.push_back(number);
        if (comma == std::string_view::npos) {
            return numbers;
        }
        text.remove_prefix(comma + 1);
    }
}

haptic::Pose pose_of(const std::string& text) {
    const std::vector<double> v = numbers_of("--pose", text);
    if (v.size() != 3 && v.size() != 7) {
        throw CLI::ValidationError("--pose", "needs x,y,z or x,y,z,qw,qx,qy,qz, not " + std::to_string(v.size()) +
                                                 (v.size() == 1 ? " number" : " numbers"));
    }
    haptic::Pose pose{{v[0], v[1], v[2]}, {1.0, 0.0, 0.0, 0.0}};
    if (v.size() == 7) {
        pose.orientation = haptic::Quat(v[3], v[4], v[5], v[6]);
        const double length = glm::length(pose.orientation);
        if (!(std::abs(length - 1.0) <= kUnitTolerance)) {
            throw CLI::ValidationError("--pose", "the quaternion has length " + std::to_string(length) + ", not 1");
        }
        pose.orientation = glm::normalize(pose.orientation);
    }
    return pose;
}

double tension_of(const std::string& option, double tension, const Variant& variant) {
    if (!std::isfinite(tension) || tension < 0.0 || tension > variant.maximum_tension) {
        throw CLI::ValidationError(option, "a tension must be within 0 and " + std::to_string(variant.maximum_tension) +
                                               " N, not " + std::to_string(tension));
    }
    return tension;
}

/// What was typed after `exchange`, as typed.
struct ExchangeArguments {
    std::string hand;
    double at_s = 0.0;
    std::string pose;
    double tension = 0.0;
    std::string tensions;
    bool hex = false;
};

CLI::App* add_exchange(CLI::App& app, ExchangeArguments& arguments, const Variant& variant) {
    CLI::App* exchange = app.add_subcommand(
        "exchange", "Send one packet to an emulated board and show what goes both ways, and what the strings then do");
    arguments.tension = variant.minimum_tension;
    CLI::Option* hand = exchange->add_option("--hand", arguments.hand,
                                             "Recording (CSV: time_s,x_m,y_m,z_m[,qw,qx,qy,qz]) that the hand follows");
    exchange->add_option("--at", arguments.at_s, "s, the time in the recording")->needs(hand)->capture_default_str();
    exchange
        ->add_option("--pose", arguments.pose,
                     "x,y,z[,qw,qx,qy,qz] in m and as a unit quaternion: a hand that holds still")
        ->excludes(hand);
    CLI::Option* tension =
        exchange->add_option("--tension", arguments.tension, "N, of every string")->capture_default_str();
    exchange->add_option("--tensions", arguments.tensions, "N, of each string: t0,...,t7")->excludes(tension);
    exchange->add_flag("--hex", arguments.hex, "Show the packets' bytes too");
    return exchange;
}

ExchangeRequest request_of(const ExchangeArguments& arguments, const Variant& variant) {
    ExchangeRequest request;
    request.hex = arguments.hex;
    if (!std::isfinite(arguments.at_s) || arguments.at_s < 0.0 || arguments.at_s > kLongest) {
        throw CLI::ValidationError("--at", "needs a time of 0 s or more, not " + std::to_string(arguments.at_s));
    }
    if (!arguments.pose.empty()) {
        request.grip = pose_of(arguments.pose);
    }
    if (arguments.tensions.empty()) {
        request.tensions.fill(tension_of("--tension", arguments.tension, variant));
    } else {
        const std::vector<double> tensions = numbers_of("--tensions", arguments.tensions);
        if (tensions.size() != haptic::kStrings) {
            throw CLI::ValidationError("--tensions",
                                       "needs 8 numbers, one for each string, not " + std::to_string(tensions.size()));
        }
        for (std::size_t i = 0; i < tensions.size(); ++i) {
            request.tensions[i] = tension_of("--tensions", tensions[i], variant);
        }
    }
    if (!arguments.hand.empty()) {
        request.grip = haptic::PoseTrack::load(arguments.hand).at(haptic::nanoseconds(arguments.at_s));
    }
    if (!(glm::length(request.grip.position) <= kFurthest)) {
        throw CLI::ValidationError(arguments.hand.empty() ? "--pose" : "--hand",
                                   "the hand is more than 0.5 m from the centre, where the counters wrap");
    }
    return request;
}

int run(int argc, char** argv) {
    const Variant variant = haptic::device::spidar_g6_x3r();
    CLI::App app{"The Spidar-G6's board, hosted on Linux: its geometry, its packets, and an emulated device."};
    app.require_subcommand(1);
    ExchangeArguments arguments;
    const CLI::App* exchange = add_exchange(app, arguments, variant);
    CLI::App* const variants = app.add_subcommand(
        "variants", "Show geometry, constants and reach of each frame that is built in, or of those in files");
    std::vector<std::string> variant_files;
    variants->add_option("FILE", variant_files, "TOML files, checked and shown instead of what is built in");
    haptic::device::ServeArguments serve_arguments;
    const CLI::App* serve = haptic::device::add_serve(app, serve_arguments);

    bool held = true;
    try {
        app.parse(argc, argv);
        if (variants->parsed()) {
            haptic::device::run_variants(variant_files);
        }
        if (exchange->parsed()) {
            held = haptic::device::run_exchange(variant, request_of(arguments, variant));
        }
        if (serve->parsed()) {
            haptic::device::run_serve(serve_arguments);
        }
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : kWrongArguments;
    }
    if (std::fflush(stdout) != 0) {
        std::perror("firmware-host: standard output");
        return kFailed;
    }
    return held ? 0 : kFailed;
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "firmware-host: %s\n", error.what());
        return kFailed;
    }
}
