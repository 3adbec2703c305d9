#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <utility>

#include "commands/calibrate_command.hpp"
#include "commands/doctor_command.hpp"
#include "haptic/device/fault.hpp"
#include "process/settings.hpp"
#include "commands/measure_command.hpp"
#include "commands/run_command.hpp"
#include "commands/stability_command.hpp"

namespace {

using haptic::rt::CalibrateOptions;
using haptic::rt::DoctorOptions;
using haptic::rt::MeasureOptions;
using haptic::rt::RunOptions;
using haptic::rt::StabilityOptions;

/// Empty for a fault that can be.
std::string problem_of_fault(const std::string& text) {
    try {
        static_cast<void>(haptic::device::parse_fault(text));
        return {};
    } catch (const haptic::device::FaultError& error) {
        return error.what();
    }
}

/// What every command that runs the loop takes.
void describe_loop(CLI::App& run, RunOptions& options) {
    run.add_option("--config", options.config, "TOML file; see --print-config")->type_name("F.toml");
    run.add_option("--set", options.assignments, "one key for this run, e.g. limits.force=4 (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    run.add_option("--device", options.device, "emulated, usb, tty:PATH or replay:F.csv")
        ->type_name("DEVICE")
        ->capture_default_str();
    run.add_option("--hand", options.hand, "recording that the emulated hand follows once the loop runs")
        ->type_name("F.csv");
    run.add_option("--fault", options.faults,
                   "what is to go wrong with the emulated device, with times from running on (repeatable): " +
                       haptic::device::fault_help())
        ->type_name("KIND@T")
        ->allow_extra_args(false)
        ->check([](const std::string& text) { return problem_of_fault(text); });
    run.add_option("--session", options.session, "joins this process to the host-sim of the same session")
        ->type_name("NAME")
        ->capture_default_str();
    run.add_option("--report", options.report, "writes measurements as JSON")->type_name("F.json");
    run.add_flag("--rearm", options.rearm, "after the device was lost, waits for it and goes on, as safety.rearm");
}

void describe_run(CLI::App& run, RunOptions& options, double& duration_s) {
    describe_loop(run, options);
    run.add_option("--duration", duration_s, "seconds after which to stop; until Ctrl-C without it")
        ->type_name("S")
        ->check(CLI::PositiveNumber);
    run.add_option("--record", options.record, "writes every tick as CSV")->type_name("F.csv");
}

CLI::App* describe_measure(CLI::App& app, MeasureOptions& options) {
    CLI::App* const measure = app.add_subcommand(
        "measure", "Runs the loop as run does, and says how late it is, where its time goes and why");
    describe_loop(*measure, options.run);
    measure->add_option("--duration", options.duration_s, "seconds of the loop; Ctrl-C ends it before")
        ->type_name("S")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    measure
        ->add_option("--load", options.load,
                     "what loads the machine meanwhile: none, stress-ng, or \"stress-ng ARGUMENTS\"")
        ->type_name("LOAD")
        ->capture_default_str();
    CLI::Option* const cyclictest = measure->add_flag(
        "--cyclictest", options.cyclictest,
        "takes turns with cyclictest on the same processor and priority, which makes the run twice as long");
    measure->add_option("--alternate", options.alternate_s, "seconds of each turn")
        ->type_name("S")
        ->check(CLI::Range(1.0, 3600.0))
        ->needs(cyclictest)
        ->capture_default_str();
    measure
        ->add_option("--loopback", options.loopback,
                     "line that is wired to the tick's probe, whose edges the kernel stamps, as probes.loopback")
        ->type_name("LINE")
        ->excludes(cyclictest);
    measure->add_option("--html", options.html, "writes a page with plots")->type_name("F.html");
    CLI::Option* const from =
        measure
            ->add_option("--from", options.from,
                         "measures nothing: shows a report that was written before, as --html too")
            ->type_name("F.json");
    measure->add_option("--compare", options.compare, "measures nothing: compares two reports that were written before")
        ->type_name("A.json B.json")
        ->expected(2)
        ->excludes(from);
    return measure;
}

CLI::App* describe_stability(CLI::App& app, StabilityOptions& options) {
    CLI::App* const stability =
        app.add_subcommand("stability",
                           "Maps for which stiffness and delay a virtual wall is stable, with and without "
                           "the passivity controller");
    stability->add_option("--out", options.out, "folder for stability.csv and the gnuplot script that draws it")
        ->type_name("DIR")
        ->required();
    stability->add_option("--config", options.config, "TOML file; see --print-config")->type_name("F.toml");
    stability->add_option("--set", options.assignments, "one key, e.g. passivity.control=damp (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    stability->add_option("--rows", options.rows, "stiffnesses from 10 to 2000 N/m")
        ->check(CLI::Range(2, 100))
        ->capture_default_str();
    stability->add_option("--columns", options.columns, "delays from 0 to 20 ms")
        ->check(CLI::Range(2, 100))
        ->capture_default_str();
    stability->add_option("--duration", options.duration_s, "seconds of each trial")
        ->check(CLI::Range(1.0, 60.0))
        ->capture_default_str();
    stability->add_option("--hand-stiffness", options.hand_stiffness, "N/m, of the hand that presses")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    stability->add_option("--hand-damping", options.hand_damping, "N*s/m, of the hand that presses")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    return stability;
}

void describe_calibrate(CLI::App& calibrate, CalibrateOptions& options) {
    calibrate.add_option("--config", options.run.config, "TOML file; see --print-config")->type_name("F.toml");
    calibrate.add_option("--set", options.run.assignments, "one key, e.g. usb.port=1-2 (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    calibrate.add_option("--device", options.run.device, "emulated or usb")->type_name("DEVICE")->capture_default_str();
    calibrate.add_option("--hand", options.run.hand, "recording that the emulated hand follows once the loop runs")
        ->type_name("F.csv");
    calibrate.add_option("--variant", options.variant, "the frame as it is known so far: name or file")
        ->type_name("NAME|F.toml");
    calibrate.add_option("--fit", options.fit, "only fits a recording that there is already")->type_name("F.csv");
    calibrate.add_option("--out", options.out, "the calibrated frame; the old file is kept as F.toml.bak-1, -2, ...")
        ->type_name("F.toml");
    calibrate.add_option("--record", options.run.record, "where the recording of the wiggle goes")->type_name("F.csv");
    calibrate.add_option("--hold", options.hold_s, "seconds for which the grip is held at the centre")
        ->check(CLI::Range(0.1, 60.0))
        ->capture_default_str();
    calibrate.add_option("--wiggle", options.wiggle_s, "seconds in which the grip is moved about")
        ->check(CLI::Range(1.0, 600.0))
        ->capture_default_str();
    calibrate
        .add_option("--weigh", options.weights,
                    "string that just lifts a mass at a digit, e.g. 3=0.200@31 (repeatable)")
        ->type_name("STRING=KG@DIGIT")
        ->allow_extra_args(false);
    const auto deviation = [&calibrate](const char* name, double& value, const char* of_what) {
        calibrate.add_option(name, value, std::string("how well ") + of_what + " is known so far, standard deviation")
            ->check(CLI::Range(1e-6, 0.1))
            ->capture_default_str();
    };
    deviation("--motor-deviation", options.fit_settings.motor, "each coordinate of a motor (m)");
    deviation("--knot-deviation", options.fit_settings.knot, "each coordinate of a knot (m)");
    deviation("--scale-deviation", options.fit_settings.scale, "the length of a count (relative)");
    calibrate.add_flag("--yes", options.yes, "asks nothing");
}

CLI::App* describe_doctor(CLI::App& app, DoctorOptions& options) {
    CLI::App* const doctor = app.add_subcommand(
        "doctor",
        "Says what of this machine keeps the loop from its period, and the command that mends it; changes nothing");
    doctor->add_option("--config", options.config, "TOML file of the loop that is to run; see --print-config")
        ->type_name("F.toml");
    doctor->add_option("--set", options.assignments, "one key, e.g. loop.cpu=3 (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    doctor->add_option("--json", options.json, "writes the findings as JSON, too")->type_name("F.json");
    doctor->add_option("--root", options.root, "looks at a copy of /proc, /sys, /dev and /etc below this folder")
        ->type_name("DIR")
        ->check(CLI::ExistingDirectory);
    return doctor;
}

int run_application(int argc, char** argv) {
    CLI::App app("The real-time process of the haptic system: drives a Spidar-G6 at 1 kHz");
    app.set_help_all_flag("--help-all", "Help of all commands");
    bool print_config = false;
    app.add_flag("--print-config", print_config, "Prints the commented default configuration");
    RunOptions options;
    double duration_s = 0.0;
    CLI::App* const run = app.add_subcommand("run", "Runs the loop until Ctrl-C");
    describe_run(*run, options, duration_s);
    run->add_flag("--print-config", print_config, "Prints the commented default configuration");
    StabilityOptions stability_options;
    const CLI::App* const stability = describe_stability(app, stability_options);
    MeasureOptions measurement;
    const CLI::App* const measure = describe_measure(app, measurement);
    CalibrateOptions calibration;
    CLI::App* const calibrate = app.add_subcommand("calibrate", "Finds the geometry of the frame, and writes its file");
    describe_calibrate(*calibrate, calibration);
    DoctorOptions doctor_options;
    const CLI::App* const doctor = describe_doctor(app, doctor_options);
    try {
        app.parse(argc, argv);
        if (print_config) {
            std::fwrite(haptic::rt::default_config_text().data(), 1, haptic::rt::default_config_text().size(), stdout);
            return 0;
        }
        if (app.get_subcommands().empty()) {
            throw CLI::CallForHelp();
        }
    } catch (const CLI::ParseError& error) {
        return app.exit(error);
    }
    if (run->count("--duration") > 0) {
        options.duration_s = duration_s;
    }
    spdlog::set_default_logger(spdlog::stderr_color_mt("rt-core"));
    spdlog::set_pattern("rt-core %^%l%$: %v");
    if (doctor->parsed()) {
        return haptic::rt::doctor_command(doctor_options);
    }
    if (calibrate->parsed()) {
        return haptic::rt::calibrate_command(calibration);
    }
    if (measure->parsed()) {
        return haptic::rt::measure_command(measurement);
    }
    return stability->parsed() ? haptic::rt::stability_command(stability_options) : haptic::rt::run_command(options);
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return run_application(argc, argv);
    } catch (const haptic::rt::Refusal& refusal) {
        std::fprintf(stderr, "rt-core: %s\n", refusal.what());
        return haptic::rt::kExitRefused;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "rt-core: %s\n", error.what());
        return haptic::rt::kExitError;
    }
}
