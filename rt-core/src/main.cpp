#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>
#include <utility>

#include "commands/arm_command.hpp"
#include "commands/black_box_command.hpp"
#include "commands/bringup_command.hpp"
#include "commands/calibrate_command.hpp"
#include "commands/doctor_command.hpp"
#include "commands/guard_command.hpp"
#include "commands/measure_command.hpp"
#include "commands/relay_command.hpp"
#include "commands/rt_core_documents.hpp"
#include "commands/run_command.hpp"
#include "commands/stability_command.hpp"
#include "commands/zero_command.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/device/wiring.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"
#include "program/log.hpp"
#include "program/option_checks.hpp"
#include "program/run_program.hpp"

namespace {

using haptic::rt::ArmOptions;
using haptic::rt::BringupOptions;
using haptic::rt::CalibrateOptions;
using haptic::rt::DoctorOptions;
using haptic::rt::MeasureOptions;
using haptic::rt::RunOptions;
using haptic::rt::StabilityOptions;

/// The problem with a --fault, for CLI11; empty if it is valid.
std::string problem_of_fault(const std::string& text) {
    try {
        static_cast<void>(haptic::device::parse_fault(text));
        return {};
    } catch (const haptic::device::FaultError& error) {
        return error.what();
    }
}

/// The problem with a --wiring, for CLI11; empty if it is valid.
std::string problem_of_wiring(const std::string& text) {
    try {
        haptic::device::Wiring wiring;
        haptic::device::add_wiring(wiring, text);
        return {};
    } catch (const haptic::device::WiringError& error) {
        return error.what();
    }
}

/// Options of every command that runs the loop.
void describe_loop(CLI::App& run, RunOptions& options) {
    run.add_option("--config", options.config, "configuration file (TOML); see --print-config")->type_name("F.toml");
    run.add_option("--set", options.assignments, "overrides one configuration key, e.g. limits.force=4 (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    run.add_option("--device", options.device, "device to drive: emulated, usb, tty:PATH or replay:F.csv")
        ->type_name("DEVICE")
        ->capture_default_str();
    run.add_option("--hand", options.hand, "recording that the emulated hand follows once the loop is running")
        ->type_name("F.csv");
    run.add_option("--fault", options.faults,
                   "fault of the emulated device, with its time since the loop is running (repeatable): " +
                       haptic::device::fault_help())
        ->type_name("KIND@T")
        ->allow_extra_args(false)
        ->check([](const std::string& text) { return problem_of_fault(text); });
    run.add_option("--wiring", options.wiring,
                   "how the emulated device is wired, where it differs from its geometry (repeatable): " +
                       haptic::device::wiring_help())
        ->type_name("KIND:VALUE")
        ->allow_extra_args(false)
        ->check([](const std::string& text) { return problem_of_wiring(text); });
    run.add_option("--session", options.session, "session name; connects to the host-sim of the same session")
        ->type_name("NAME")
        ->capture_default_str();
    run.add_option("--report", options.report, "writes the measurements to a JSON file")
        ->type_name("F.json")
        ->check(haptic::result_file());
    run.add_option("--profile", options.profile, "profile of forces: learning, normal, expert or an own one")
        ->type_name("NAME");
    run.add_flag("--reconnect", options.reconnect,
                 "after the device was lost, waits for it and for a person to arm it, like safety.reconnect");
    // The former name of --reconnect.
    run.add_flag("--rearm", options.reconnect)->group("");
}

void describe_run(CLI::App& run, RunOptions& options, double& duration_s) {
    describe_loop(run, options);
    run.add_option("--duration", duration_s, "seconds after which to stop; default: until Ctrl-C")
        ->type_name("S")
        ->check(haptic::positive_number(haptic::kLongestDuration));
    run.add_option("--record", options.record, "writes every tick to a CSV file")
        ->type_name("F.csv")
        ->check(haptic::result_file());
}

CLI::App* describe_measure(CLI::App& app, MeasureOptions& options) {
    CLI::App* const measure = app.add_subcommand(
        "measure", "Runs the loop as run does, and reports its latency, where its time goes and why");
    describe_loop(*measure, options.run);
    measure->add_option("--duration", options.duration_s, "seconds to run the loop; Ctrl-C ends it early")
        ->type_name("S")
        ->check(haptic::positive_number(haptic::kLongestDuration))
        ->capture_default_str();
    measure
        ->add_option("--load", options.load,
                     "load on the machine meanwhile: none, stress-ng, or \"stress-ng ARGUMENTS\"")
        ->type_name("LOAD")
        ->capture_default_str();
    CLI::Option* const peers =
        measure
            ->add_option(
                "--peers", options.peers,
                "tools that alternate with the loop, on the same processor and priority: cyclictest, timerlat, "
                "osnoise, or all that are installed; each turn prolongs the run")
            ->type_name("TOOLS")
            ->delimiter(',');
    CLI::Option* const cyclictest = measure->add_flag_callback(
        "--cyclictest", [&options] { options.peers.emplace_back("cyclictest"); }, "the same as --peers cyclictest");
    const CLI::Option* const alternate =
        measure->add_option("--alternate", options.alternate_s, "seconds of each turn of the loop and of a tool")
            ->type_name("S")
            ->check(haptic::number_in(1.0, 3600.0))
            ->capture_default_str();
    measure->parse_complete_callback([=] {
        if (alternate->count() > 0 && peers->count() == 0 && cyclictest->count() == 0) {
            throw CLI::RequiresError("--alternate", "--peers or --cyclictest");
        }
    });
    measure
        ->add_option("--loopback", options.loopback,
                     "GPIO line wired to the tick's probe, whose edges the kernel timestamps, like probes.loopback")
        ->type_name("LINE")
        ->excludes(cyclictest)
        ->excludes(peers);
    CLI::Option* const late =
        measure
            ->add_option(
                "--break-above", options.break_above_us,
                "ends the run at the first tick that ends later than this after its deadline, and says from the "
                "kernel's trace which thread or interrupt made it late; needs root and tracefs")
            ->type_name("US")
            ->check(haptic::positive_number(1e6 * haptic::kLongestDuration))
            ->excludes(cyclictest)
            ->excludes(peers);
    measure->add_option("--trace", options.trace, "writes the kernel's trace of that tick")
        ->type_name("F.txt")
        ->check(haptic::result_file())
        ->needs(late);
    measure->add_option("--html", options.html, "writes an HTML page with plots")
        ->type_name("F.html")
        ->check(haptic::result_file());
    CLI::Option* const from =
        measure->add_option("--from", options.from, "measures nothing: shows an existing report; also with --html")
            ->type_name("F.json");
    measure->add_option("--compare", options.compare, "measures nothing: compares two existing reports")
        ->type_name("A.json B.json")
        ->expected(2)
        ->excludes(from);
    return measure;
}

CLI::App* describe_stability(CLI::App& app, StabilityOptions& options) {
    CLI::App* const stability =
        app.add_subcommand("stability",
                           "Maps the stiffness and delay at which a virtual wall is stable, with and without "
                           "the passivity controller, or a scene of host-sim");
    stability->add_option("--out", options.out, "output folder for stability.csv and the map, stability.html")
        ->type_name("DIR")
        ->check(haptic::result_folder())
        ->required();
    stability->add_option("--config", options.config, "configuration file (TOML); see --print-config")
        ->type_name("F.toml");
    stability
        ->add_option("--set", options.assignments,
                     "overrides one configuration key, e.g. passivity.control=damp (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    stability->add_option("--rows", options.rows, "number of stiffnesses from 10 to 2000 N/m")
        ->check(CLI::Range(2, 100))
        ->capture_default_str();
    stability->add_option("--columns", options.columns, "number of delays from 0 to 20 ms")
        ->check(CLI::Range(2, 100))
        ->capture_default_str();
    const auto optional = [&](const char* name, std::optional<double>& value, const char* meaning) {
        return stability->add_option_function<double>(name, [&value](const double& given) { value = given; }, meaning);
    };
    optional("--duration", options.duration_s, "seconds of each trial; of a scene with a still hand [2.5; 16]")
        ->check(haptic::number_in(1.0, 60.0));
    optional("--hand-stiffness", options.hand_stiffness, "stiffness of the hand, N/m [100; of a scene 400]")
        ->check(haptic::number_of_0_or_more());
    optional("--hand-damping", options.hand_damping, "damping of the hand, N*s/m [0; of a scene 4]")
        ->check(haptic::number_of_0_or_more());
    CLI::Option* const scene =
        stability
            ->add_option("--scene", options.scene,
                         "maps a scene of host-sim, built-in or a file NAME.toml, instead of the wall; writes "
                         "stability-NAME.csv")
            ->type_name("SCENE");
    stability->add_option("--host-sim", options.host_sim, "program host-sim [searched in PATH]")
        ->type_name("FILE")
        ->needs(scene);
    stability->add_option("--scene-set", options.scene_assignments, "overrides one key of the scene (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false)
        ->needs(scene);
    optional("--hold", options.hold_s, "seconds of the scene's script after which the hand is held still [its end]")
        ->check(haptic::number_of_0_or_more())
        ->needs(scene);
    const auto axis = [&](const char* name, std::vector<double>& values, const char* meaning) {
        return stability->add_option(name, values, meaning)->delimiter(',')->needs(scene)->capture_default_str();
    };
    axis("--rates", options.rates_hz, "steps of the scene per second")->check(haptic::positive_number());
    axis("--stiffnesses", options.stiffnesses, "stiffnesses that the scene requests at the hand, N/m")
        ->check(haptic::positive_number());
    axis("--delays", options.delays_ms, "delays of the contact frames, ms")->check(haptic::number_of_0_or_more());
    return stability;
}

void describe_calibrate(CLI::App& calibrate, CalibrateOptions& options) {
    calibrate.add_option("--config", options.run.config, "configuration file (TOML); see --print-config")
        ->type_name("F.toml");
    calibrate
        .add_option("--set", options.run.assignments,
                    "overrides one configuration key, e.g. device.usb_path=1-2 (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    calibrate.add_option("--device", options.run.device, "device to calibrate: emulated or usb")
        ->type_name("DEVICE")
        ->capture_default_str();
    calibrate
        .add_option("--hand", options.run.hand, "recording that the emulated hand follows once the loop is running")
        ->type_name("F.csv");
    calibrate.add_option("--geometry", options.geometry, "nominal device geometry: name or file")
        ->type_name("NAME|F.toml");
    // The former name of --geometry.
    calibrate.add_option("--variant", options.geometry)->group("");
    calibrate.add_option("--fit", options.fit, "measures nothing: fits an existing recording")->type_name("F.csv");
    calibrate
        .add_option("--out", options.out,
                    "file for the calibrated device geometry; an old one is kept as F.toml.bak-1, -2, ...")
        ->type_name("F.toml")
        ->check(haptic::result_file());
    calibrate
        .add_option(
            "--record", options.run.record,
            "file for the recording of the wiggle [F.wiggle.csv beside --out, or the first free F.wiggle-2.csv, ...]")
        ->type_name("F.csv")
        ->check(haptic::result_file());
    calibrate.add_option("--hold", options.hold_s, "seconds to hold the grip at the centre")
        ->check(haptic::number_in(0.1, 60.0))
        ->capture_default_str();
    calibrate.add_option("--wiggle", options.wiggle_s, "seconds to move the grip about")
        ->check(haptic::number_in(1.0, 600.0))
        ->capture_default_str();
    calibrate
        .add_option("--weigh", options.weights,
                    "string that just lifts a mass at a DAC code, e.g. 3=0.200@31 (repeatable)")
        ->type_name("STRING=KG@CODE")
        ->allow_extra_args(false);
    const auto deviation = [&calibrate](const char* name, double& value, const char* of_what) {
        calibrate.add_option(name, value, std::string("standard deviation of the nominal value of ") + of_what)
            ->check(haptic::number_in(1e-6, 0.1))
            ->capture_default_str();
    };
    deviation("--motor-deviation", options.fit_settings.motor, "each coordinate of a motor (m)");
    deviation("--knot-deviation", options.fit_settings.knot, "each coordinate of a knot (m)");
    deviation("--scale-deviation", options.fit_settings.scale, "the metres per count (relative)");
    calibrate.add_flag("--yes", options.yes, "answers all questions with yes");
}

CLI::App* describe_bringup(CLI::App& app, BringupOptions& options) {
    CLI::App* const bringup = app.add_subcommand(
        "bringup",
        "Guides through the first day of a device: finds exchanged plugs, signs and newtons per code, writes a "
        "protocol to sign and a geometry file");
    bringup->add_option("--config", options.run.config, "configuration file (TOML); see --print-config")
        ->type_name("F.toml");
    bringup
        ->add_option("--set", options.run.assignments,
                     "overrides one configuration key, e.g. device.usb_path=1-2 (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    bringup->add_option("--device", options.run.device, "device to bring up: usb, tty:PATH, or emulated to rehearse")
        ->type_name("DEVICE")
        ->capture_default_str();
    bringup
        ->add_option("--wiring", options.run.wiring,
                     "how the emulated device is wired, where it differs from its geometry (repeatable): " +
                         haptic::device::wiring_help())
        ->type_name("KIND:VALUE")
        ->allow_extra_args(false)
        ->check([](const std::string& text) { return problem_of_wiring(text); });
    bringup->add_option("--geometry", options.geometry, "nominal device geometry: name or file")
        ->type_name("NAME|F.toml");
    bringup
        ->add_option("--out", options.out,
                     "file for the device's geometry; the protocol is F.protocol.json and F.protocol.txt beside it")
        ->type_name("F.toml")
        ->required()
        ->check(haptic::result_file())
        ->check([](const std::string& file) {
            return file.ends_with(".toml") ? std::string() : "the name must end in .toml";
        });
    bringup->add_flag(
        "--sign", options.sign,
        "measures nothing: asks for the signature again, after rt-core calibrate has refined the geometry");
    bringup->add_flag("--resume", options.resume, "continues the unfinished protocol of --out without asking");
    const auto number = [&bringup](const char* name, double& value, const char* meaning, double low, double high) {
        bringup->add_option(name, value, meaning)->check(haptic::number_in(low, high))->capture_default_str();
    };
    number("--cap", options.steps.cap, "largest tension that is ever asked for, N by the nominal geometry", 0.2, 2.0);
    number("--dead-man", options.dead_man_s, "seconds after the last repeat of the key until the motor stops", 0.1,
           0.5);
    number("--ramp", options.steps.ramp_s, "seconds in which a motor's code rises from zero", 0.05, 5.0);
    number("--steady", options.steps.steady_s, "seconds to hold the key for a reading", 0.1, 10.0);
    number("--silence", options.steps.silence_s, "seconds without a command in the power-cut test", 0.2, 5.0);
    number("--pull-out", options.steps.pull_out, "metres by which strings are pulled out by hand", 0.01, 0.5);
    bringup->add_option("--readings", options.steps.readings, "readings of the balance for each string")
        ->check(CLI::Range(1, 10))
        ->capture_default_str();
    bringup->add_option("--exchanges", options.steps.exchanges, "exchanges of the round-trip histogram")
        ->check(CLI::Range(100, 100'000))
        ->capture_default_str();
    bringup->add_option("--button", options.button, "switch of the board, 0 to 2, that replaces the dead-man key")
        ->check(CLI::Range(0, 2));
    return bringup;
}

CLI::App* describe_doctor(CLI::App& app, DoctorOptions& options) {
    CLI::App* const doctor = app.add_subcommand(
        "doctor",
        "Checks what on this machine disturbs the loop, and prints the command that fixes it; changes nothing");
    doctor->add_option("--config", options.config, "configuration file (TOML) of the loop; see --print-config")
        ->type_name("F.toml");
    doctor->add_option("--set", options.assignments, "overrides one configuration key, e.g. loop.cpu=3 (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    doctor->add_option("--json", options.json, "also writes the findings to a JSON file")
        ->type_name("F.json")
        ->check(haptic::result_file());
    doctor->add_option("--root", options.root, "checks a copy of /proc, /sys, /dev and /etc below this folder instead")
        ->type_name("DIR")
        ->check(CLI::ExistingDirectory);
    return doctor;
}

CLI::App* describe_arm(CLI::App& app, ArmOptions& options) {
    CLI::App* const arm =
        app.add_subcommand("arm", "Arms a running rt-core that waits for a person, as its user, and ends at once");
    arm->add_option("--session", options.session, "session name of the rt-core")
        ->type_name("NAME")
        ->capture_default_str();
    arm->add_flag("--state", options.state, "arms nothing: shows the state of the rt-core");
    return arm;
}

CLI::App* describe_zero(CLI::App& app, RunOptions& options, double& unused_duration_s) {
    CLI::App* const zero = app.add_subcommand(
        "zero",
        "Sets the motors of a real device to zero and ends; takes the options of run, so that a service can pass "
        "the same ones");
    describe_run(*zero, options, unused_duration_s);
    return zero;
}

CLI::App* describe_black_box(CLI::App& app, haptic::rt::BlackBoxOptions& options) {
    CLI::App* const box = app.add_subcommand(
        "black-box",
        "Saves the last ticks of a run that was killed; its guard and the next run of the session do so by "
        "themselves");
    box->add_option("--session", options.session, "session name of the run")->type_name("NAME")->capture_default_str();
    box->add_option("--out", options.out, "CSV file; default: beside the report or the recording of the run")
        ->type_name("F.csv")
        ->check(haptic::result_file());
    return box;
}

CLI::App* describe_relay(CLI::App& app, haptic::rt::RelayOptions& options) {
    CLI::App* const relay = app.add_subcommand(
        "relay", "Connects the session to a simulation on another machine (host-sim run --dds there), until Ctrl-C");
    relay->add_option("--session", options.link.session, "session name of the run")
        ->type_name("NAME")
        ->capture_default_str();
    relay
        ->add_option("--interface", options.link.interface,
                     "network interface, the only one that is used; the link has no password: one that is yours alone")
        ->type_name("NAME")
        ->capture_default_str();
    relay
        ->add_option("--peer", options.link.peers,
                     "address of the simulation's machine, on a network without multicast (repeatable)")
        ->type_name("ADDRESS")
        ->allow_extra_args(false);
    relay->add_option("--domain", options.link.domain, "DDS domain")
        ->type_name("N")
        ->check(CLI::Range(0, 232))
        ->capture_default_str();
    relay
        ->add_option(
            "--ros", options.ros.names,
            "publish for ROS 2 too: /NAMES/pose, twist, wrench, joy, and /diagnostics; --domain is its ROS_DOMAIN_ID")
        ->type_name("NAMES");
    relay
        ->add_option("--ros-rate", options.ros.rate_hz,
                     "messages of each of these topics in a second, at most one a tick")
        ->type_name("HZ")
        ->check(CLI::Range(0.1, 1e4))
        ->needs("--ros")
        ->capture_default_str();
    relay
        ->add_flag("--ros-overlay", options.ros.overlay,
                   "take a wrench from /NAMES/wrench_overlay, within overlay.max_force and max_torque of rt-core run")
        ->needs("--ros");
    relay->add_option("--duration", options.duration_s, "seconds, then it ends; 0: until Ctrl-C")
        ->type_name("S")
        ->check(CLI::Range(0.0, 1e9));
    return relay;
}

CLI::App* describe_guard(CLI::App& app, int& socket) {
    CLI::App* const guard = app.add_subcommand(
        "guard",
        "Started by run for a real device: outlives it, and sets the motors to zero if it was killed or froze");
    guard->add_option("--socket", socket, "descriptor of the socket to the run")->type_name("N")->required();
    return guard;
}

/// Adds --print-config, which prints the default configuration and ends the program.
void add_print_config(CLI::App& app) {
    app.add_flag_callback(
           "--print-config",
           [] {
               std::fputs(haptic::rt::default_config_text().c_str(), stdout);
               throw CLI::Success();
           },
           "Prints the commented default configuration")
        ->trigger_on_parse();
}

int program(int argc, char** argv) {
    CLI::App app("Real-time process of the haptic system: drives a Spidar-G6 at 1 kHz", "rt-core");
    app.set_help_all_flag("--help-all", "Prints the help of all commands");
    haptic::add_generate_option(app, haptic::rt::rt_core_documents);
    add_print_config(app);
    RunOptions options;
    double duration_s = 0.0;
    CLI::App* const run = app.add_subcommand("run", "Runs the loop until Ctrl-C");
    describe_run(*run, options, duration_s);
    add_print_config(*run);
    StabilityOptions stability_options;
    const CLI::App* const stability = describe_stability(app, stability_options);
    MeasureOptions measurement;
    const CLI::App* const measure = describe_measure(app, measurement);
    CalibrateOptions calibration;
    CLI::App* const calibrate =
        app.add_subcommand("calibrate", "Calibrates the geometry of the device and writes its file");
    describe_calibrate(*calibrate, calibration);
    ArmOptions arm_options;
    const CLI::App* const arm = describe_arm(app, arm_options);
    BringupOptions bringup_options;
    const CLI::App* const bringup = describe_bringup(app, bringup_options);
    DoctorOptions doctor_options;
    const CLI::App* const doctor = describe_doctor(app, doctor_options);
    RunOptions zero_options;
    double unused_duration_s = 0.0;
    const CLI::App* const zero = describe_zero(app, zero_options, unused_duration_s);
    haptic::rt::BlackBoxOptions black_box_options;
    const CLI::App* const black_box = describe_black_box(app, black_box_options);
    haptic::rt::RelayOptions relay_options;
    const CLI::App* const relay = describe_relay(app, relay_options);
    int socket = -1;
    const CLI::App* const guard = describe_guard(app, socket);
    const auto command = [&] {
        if (run->count("--duration") > 0) {
            options.duration_s = duration_s;
        }
        haptic::log_to_stderr("rt-core");
        if (arm->parsed()) {
            return haptic::rt::arm_command(arm_options);
        }
        if (relay->parsed()) {
            return haptic::rt::relay_command(relay_options);
        }
        if (guard->parsed()) {
            return haptic::rt::guard_command(socket);
        }
        if (zero->parsed()) {
            return haptic::rt::zero_command(zero_options);
        }
        if (black_box->parsed()) {
            return haptic::rt::black_box_command(black_box_options);
        }
        if (doctor->parsed()) {
            return haptic::rt::doctor_command(doctor_options);
        }
        if (bringup->parsed()) {
            return haptic::rt::bringup_command(bringup_options);
        }
        if (calibrate->parsed()) {
            return haptic::rt::calibrate_command(calibration);
        }
        if (measure->parsed()) {
            return haptic::rt::measure_command(measurement);
        }
        return stability->parsed() ? haptic::rt::stability_command(stability_options)
                                   : haptic::rt::run_command(options);
    };
    return haptic::run_program(app, argc, argv, [&command] {
        try {
            return command();
        } catch (const haptic::rt::Refusal& refusal) {
            (void)std::fprintf(stderr, "rt-core: %s\n", refusal.what());
            return haptic::kExitRefused;
        }
    });
}

}  // namespace

int main(int argc, char** argv) {
    return haptic::run_main(program, argc, argv);
}
