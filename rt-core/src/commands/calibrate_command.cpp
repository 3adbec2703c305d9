#include "commands/calibrate_command.hpp"

#include <unistd.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <iterator>
#include <stdexcept>

#include "commands/calibration_guide.hpp"
#include "commands/run_files.hpp"
#include "haptic/config.hpp"
#include "haptic/device/dac_codes.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/device_geometry_writer.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {
namespace {

constexpr const char* kDefaultGeometry = "SpidarG6X3R";
// Begins the part of the file's head comment that a calibration has written.
constexpr std::string_view kMark = "Calibrated ";
// A fit is rejected if its RMS residual exceeds this fraction of safety.residual, the limit of a run.
constexpr double kWorstShare = 0.25;

/// The configuration of --config; without it that of the recording to fit, if it was kept.
Config load_calibration_config(const CalibrateOptions& options) {
    std::optional<std::filesystem::path> file = options.run.config;
    if (!file && options.fit && std::filesystem::exists(config_file_of(*options.fit))) {
        file = config_file_of(*options.fit);
    }
    RunOptions run = options.run;
    run.config = file;
    return load_run_config(run);
}

bool names_file(const std::string& geometry) {
    return geometry.find('/') != std::string::npos || geometry.ends_with(".toml");
}

/// Head comment of the geometry's file, without the part that earlier calibrations added.
std::string head_comment_of(const std::string& geometry) {
    std::string text;
    // Text of the file, or of the built-in geometry.
    if (names_file(geometry)) {
        std::ifstream stream(geometry);
        text.assign(std::istreambuf_iterator<char>(stream), {});
    } else {
        text = device::built_in_geometry_text(geometry);
    }
    // Its leading comment lines, without "# ", up to the mark of an earlier calibration.
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

std::filesystem::path output_file(const CalibrateOptions& options, const std::string& geometry) {
    if (options.out) {
        return *options.out;
    }
    return names_file(geometry) ? geometry : geometry + ".calibrated.toml";
}

/// File of the recording that the command makes: that of --record, or the first of F.wiggle.csv, F.wiggle-2.csv, ...
/// that does not exist, because the recording of an earlier calibration can still be fitted.
std::filesystem::path record_file(const CalibrateOptions& options, const std::filesystem::path& out) {
    if (options.run.record) {
        return *options.run.record;
    }
    std::filesystem::path file = std::filesystem::path(out).replace_extension("wiggle.csv");
    for (int number = 2; std::filesystem::exists(file); ++number) {
        file = std::filesystem::path(out).replace_extension("wiggle-" + std::to_string(number) + ".csv");
    }
    return file;
}

/// `out`: the geometry's file. Without the nominal geometry, whose file may be written: its old contents are kept.
FileUses files_of_calibration(const CalibrateOptions& options, const std::filesystem::path& out,
                              const std::filesystem::path& recording) {
    if (options.fit) {
        FileUses files;
        files.reads("--config ", options.run.config);
        files.reads("--fit ", options.fit);
        files.also_reads("--fit " + options.fit->string(), config_file_of(*options.fit));
        files.writes("--out ", options.out);
        return files;
    }
    RunOptions run = options.run;
    run.record = recording;
    FileUses files = files_of_run(run);
    files.writes("--out ", out);
    return files;
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

/// Sets the force constant of a string from "3=0.200@31": string 3 just lifts 0.200 kg at DAC code 31.
void apply_weight(const std::string& weight, device::DeviceGeometry& geometry) {
    const auto number = [&weight](std::size_t begin, std::size_t end) {
        double value = 0.0;
        const char* const last = weight.data() + end;
        const auto [stop, error] = std::from_chars(weight.data() + begin, last, value);
        if (error != std::errc{} || stop != last || !std::isfinite(value)) {
            throw Refusal("--weigh " + weight + ": must be STRING=KILOGRAMS@CODE, as in 3=0.200@31");
        }
        return value;
    };
    // Split into string, mass (kg) and DAC code, and check their ranges.
    const std::size_t equals = weight.find('=');
    const std::size_t at = weight.find('@');
    if (equals == std::string::npos || at == std::string::npos || at < equals) {
        throw Refusal("--weigh " + weight + ": must be STRING=KILOGRAMS@CODE, as in 3=0.200@31");
    }
    const double string = number(0, equals);
    const double mass = number(equals + 1, at);
    const double dac_code = number(at + 1, weight.size());
    if (string != std::floor(string) || string < 0.0 || string >= static_cast<double>(kStrings) || !(mass > 0.0) ||
        dac_code == 0.0 || std::fabs(dac_code) > device::kMaxDacCode) {
        throw Refusal("--weigh " + weight +
                      ": the string must be 0 to 7, the mass positive, the DAC code non-zero and within +-4095");
    }
    // Weight in balance with the string: N per code = m g / code.
    geometry.strings[static_cast<std::size_t>(string)].newtons_per_code = mass * device::kGravity / dac_code;
}

/// Runs the loop while a person, or the emulated hand, moves the grip as instructed, and writes the recording.
void record_wiggle(const CalibrateOptions& options, const Settings& settings, const device::DeviceGeometry& geometry,
                   const std::string& name, const std::filesystem::path& recording) {
    const bool asks = !options.yes;
    if (asks && isatty(STDIN_FILENO) == 0) {
        throw Refusal("calibrate: standard input is not a terminal to answer questions on; --yes skips them");
    }
    std::printf(
        "Calibrating %s. The motors will pull each string with %.1f N.\n"
        "Hold the grip at the centre of the device, level, with all eight strings taut.\n",
        geometry.name.c_str(), settings.tick.geometry.minimum_tension);
    if (asks && !ask("Start?")) {
        throw Refusal("calibrate: cancelled; nothing was changed");
    }
    CalibrationGuide guide({.geometry = geometry,
                            .hold_s = options.hold_s,
                            .wiggle_s = options.wiggle_s,
                            .movement = settings.tick.safety.calibration_movement,
                            .residual = settings.tick.safety.residual,
                            .live = isatty(STDOUT_FILENO) != 0});
    RunOptions run = options.run;
    run.session = "calibrate-" + std::to_string(getpid());  // a private session, so that no simulation applies forces
    run.assignments.push_back("device.geometry=" + name);
    run.record = recording;
    run.observer = &guide;
    if (const int status = run_command(run); status != 0) {
        throw Refusal("calibrate: the run ended in a fault; only its recording was written: " + recording.string());
    }
    if (!guide.complete()) {
        throw Refusal("calibrate: " + (guide.problem().empty() ? "stopped before the end" : guide.problem()) +
                      "; nothing was changed");
    }
}

}  // namespace

int calibrate_command(const CalibrateOptions& given) {
    if (given.fit && given.run.record) {
        throw std::invalid_argument("--record " + given.run.record->string() +
                                    ": --fit fits an existing recording and makes no other; leave out --record");
    }
    // The wiggle must reach the edges of the workspace, and no force is rendered meanwhile.
    CalibrateOptions options = given;
    options.run.assignments.emplace_back("safety.walls=false");
    // Nominal geometry, with the force constants of --weigh.
    const Config config = load_calibration_config(options);
    const Settings settings = read_settings(config);
    const std::string name = options.geometry.value_or(config.text("device.geometry", kDefaultGeometry));
    device::DeviceGeometry nominal = device::find_device_geometry(name);
    for (const std::string& weight : options.weights) {
        apply_weight(weight, nominal);
    }
    // Recording: an existing one, or a new one made with the person's help.
    const std::filesystem::path out = output_file(options, name);
    const std::filesystem::path recording = options.fit ? *options.fit : record_file(options, out);
    files_of_calibration(options, out, recording).require_distinct();
    if (!options.fit) {
        record_wiggle(options, settings, nominal, name, recording);
    }
    // Fit, and reject a geometry that does not explain the recording.
    const GeometryFit fit = fit_geometry(nominal, load_wiggle(recording, nominal), options.fit_settings);
    const std::string report = describe(fit);
    std::fputs(report.c_str(), stdout);
    if (!fit.converged || fit.rms_after > kWorstShare * settings.tick.safety.residual) {
        std::printf(
            "The fitted geometry does not explain the encoder counts; nothing was written. Was a string slack, or do\n"
            "channels, directions or corners differ from %s?\n",
            name.c_str());
        return kExitFailed;
    }
    // Write the file, after a confirmation where a person can give it.
    if (options.fit && !options.out) {
        std::printf("Not written: --out is missing.\n");
        return 0;
    }
    if (!options.yes && isatty(STDIN_FILENO) != 0 && !ask(("Write " + out.string() + "?").c_str())) {
        std::printf("Nothing was written.\n");
        return 0;
    }
    const std::string comment = head_comment_of(name) + std::string(kMark) + today() + " from " +
                                recording.filename().string() + ":\n" + report;
    const auto backup = device::write_device_geometry(out, fit.geometry, comment);
    std::printf("written to %s%s; use it with --set device.geometry=%s\n", out.c_str(),
                backup ? (", the previous file is " + backup->string()).c_str() : "", out.c_str());
    return 0;
}

}  // namespace haptic::rt
