#include "commands/calibrate_command.hpp"

#include <unistd.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>

#include "commands/calibration_guide.hpp"
#include <haptic/config.hpp>
#include <haptic/device/digits.hpp>
#include <haptic/device/variant_file.hpp>
#include <haptic/device/variant_writer.hpp>
#include "process/settings.hpp"

namespace haptic::rt {
namespace {

constexpr double kGravity = 9.80665;  // m/s^2, standard
constexpr const char* kDefaultVariant = "SpidarG6X3R";
// What follows this word at the beginning of a line of the file's comment is of an earlier calibration.
constexpr std::string_view kMark = "Calibrated ";
// A geometry that leaves lengths contradicting by more than this share of what is a fault in a run is none.
constexpr double kWorstShare = 0.25;

Config load_config(const CalibrateOptions& options) {
    Config config;
    if (options.run.config) {
        config = Config::load(*options.run.config);
    } else if (options.fit) {
        const std::filesystem::path beside = std::filesystem::path(*options.fit).replace_extension("config.toml");
        config = std::filesystem::exists(beside) ? Config::load(beside) : Config();
    }
    for (const std::string& assignment : options.run.assignments) {
        config.set(assignment);
    }
    return config;
}

bool names_file(const std::string& variant) {
    return variant.find('/') != std::string::npos || variant.ends_with(".toml");
}

/// The comment at the head of the variant's file, without what earlier calibrations added.
std::string comment_of(const std::string& variant) {
    std::string text;
    if (names_file(variant)) {
        std::ifstream stream(variant);
        text.assign(std::istreambuf_iterator<char>(stream), {});
    } else {
        text = device::builtin_variant_text(variant);
    }
    std::string comment;
    for (std::size_t begin = 0; begin < text.size() && text[begin] == '#';) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        std::string line = text.substr(begin + 1, end - begin - 1);
        line.erase(0, line.starts_with(' ') ? 1 : 0);
        if (line.starts_with(kMark)) {
            break;
        }
        comment += line + "\n";
        begin = end + 1;
    }
    return comment;
}

std::filesystem::path output_file(const CalibrateOptions& options, const std::string& variant) {
    if (options.out) {
        return *options.out;
    }
    return names_file(variant) ? variant : variant + ".calibrated.toml";
}

std::string today() {
    const std::time_t now = std::time(nullptr);
    std::tm date{};
    localtime_r(&now, &date);
    char text[16];
    std::strftime(text, sizeof text, "%Y-%m-%d", &date);
    return text;
}

bool ask(const char* question) {
    std::printf("%s [y/N] ", question);
    std::fflush(stdout);
    std::string answer;
    return std::getline(std::cin, answer) && (answer == "y" || answer == "Y" || answer == "yes");
}

/// "3=0.200@31": string 3 just lifts 0.200 kg at digit 31.
void apply_weight(const std::string& weight, device::Variant& variant) {
    const auto number = [&weight](std::size_t begin, std::size_t end) {
        double value = 0.0;
        const char* const last = weight.data() + end;
        const auto [stop, error] = std::from_chars(weight.data() + begin, last, value);
        if (error != std::errc{} || stop != last || !std::isfinite(value)) {
            throw Refusal("--weigh " + weight + ": must be STRING=KILOGRAMS@DIGIT, as in 3=0.200@31");
        }
        return value;
    };
    const std::size_t equals = weight.find('=');
    const std::size_t at = weight.find('@');
    if (equals == std::string::npos || at == std::string::npos || at < equals) {
        throw Refusal("--weigh " + weight + ": must be STRING=KILOGRAMS@DIGIT, as in 3=0.200@31");
    }
    const double string = number(0, equals);
    const double mass = number(equals + 1, at);
    const double digit = number(at + 1, weight.size());
    if (string != std::floor(string) || string < 0.0 || string >= static_cast<double>(kStrings) || !(mass > 0.0) ||
        digit == 0.0 || std::fabs(digit) > device::kMaximumDigit) {
        throw Refusal("--weigh " + weight + ": strings are 0 to 7, masses positive, digits within +-4095 and not 0");
    }
    variant.strings[static_cast<std::size_t>(string)].newtons_per_digit = mass * kGravity / digit;
}

/// Runs the loop while a person, or the emulated hand, does what is asked; the recording of it.
std::filesystem::path guided_recording(const CalibrateOptions& options, const Settings& settings,
                                       const device::Variant& variant, const std::string& name,
                                       const std::filesystem::path& out) {
    const bool asks = !options.yes;
    if (asks && isatty(STDIN_FILENO) == 0) {
        throw Refusal("calibrate: standard input is no terminal, so that nobody can answer; --yes asks nothing");
    }
    std::printf(
        "Calibrating %s. Motors will pull with %.1f N a string.\n"
        "Put the grip at the centre of the frame, level, and hold it there with all eight strings taut.\n",
        variant.name.c_str(), settings.tick.variant.minimum_tension);
    if (asks && !ask("Begin?")) {
        throw Refusal("calibrate: nothing was done");
    }
    CalibrationGuide guide({.variant = variant,
                            .hold_s = options.hold_s,
                            .wiggle_s = options.wiggle_s,
                            .movement = settings.tick.safety.calibration_movement,
                            .residual = settings.tick.safety.residual,
                            .live = isatty(STDOUT_FILENO) != 0});
    RunOptions run = options.run;
    run.session = "calibrate-" + std::to_string(getpid());  // no simulation pushes meanwhile
    run.assignments.push_back("device.variant=" + name);
    run.record = options.run.record ? *options.run.record : std::filesystem::path(out).replace_extension("wiggle.csv");
    run.observer = &guide;
    if (const int status = run_command(run); status != 0) {
        throw Refusal("calibrate: the run ended in a fault; nothing was written but its recording " +
                      run.record->string());
    }
    if (!guide.complete()) {
        throw Refusal("calibrate: " + (guide.problem().empty() ? "stopped before it was done" : guide.problem()) +
                      "; nothing was changed");
    }
    return *run.record;
}

}  // namespace

int calibrate_command(const CalibrateOptions& options) {
    const Config config = load_config(options);
    const Settings settings = read_settings(config);
    const std::string name = options.variant.value_or(config.text("device.variant", kDefaultVariant));
    device::Variant nominal = device::find_variant(name);
    for (const std::string& weight : options.weights) {
        apply_weight(weight, nominal);
    }
    const std::filesystem::path out = output_file(options, name);
    const std::filesystem::path recording =
        options.fit ? *options.fit : guided_recording(options, settings, nominal, name, out);
    const GeometryFit fit = fit_geometry(nominal, load_wiggle(recording, nominal), options.fit_settings);
    const std::string report = describe(fit);
    std::fputs(report.c_str(), stdout);
    if (!fit.converged || fit.rms_after > kWorstShare * settings.tick.safety.residual) {
        std::printf(
            "This is no geometry that explains the counts: nothing is written. Was a string slack, or are\n"
            "its channels, directions or corners other than %s says?\n",
            name.c_str());
        return kExitError;
    }
    if (options.fit && !options.out) {
        std::printf("Nothing is written without --out.\n");
        return 0;
    }
    if (!options.yes && isatty(STDIN_FILENO) != 0 && !ask(("Write " + out.string() + "?").c_str())) {
        std::printf("Nothing was written.\n");
        return 0;
    }
    const std::string comment =
        comment_of(name) + std::string(kMark) + today() + " from " + recording.filename().string() + ":\n" + report;
    const auto backup = device::write_variant(out, fit.variant, comment);
    std::printf("written to %s%s; use it with --set device.variant=%s\n", out.c_str(),
                backup ? (", the old one is " + backup->string()).c_str() : "", out.c_str());
    return 0;
}

}  // namespace haptic::rt
