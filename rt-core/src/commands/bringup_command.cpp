#include "commands/bringup_command.hpp"

#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "haptic/device/dac_codes.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/device_geometry_writer.hpp"
#include "haptic/text_file.hpp"
#include "process/device_protocol.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"
#include "program/file_uses.hpp"
#include "program/run_program.hpp"

namespace haptic::rt {
namespace {

constexpr double kMostTravel = 0.2;  // m, of a string before its motor is cut

/// The files of a bring-up.
struct Files {
    explicit Files(const std::filesystem::path& out)
        : geometry(out),
          json(protocol_beside(out.string())),
          text(std::filesystem::path(json).replace_extension("txt")) {}

    std::filesystem::path geometry;
    std::filesystem::path json;
    std::filesystem::path text;
};

/// Without the nominal geometry, whose file may be written: its old contents are kept.
FileUses files_of_bringup(const BringupOptions& options) {
    const Files results(options.out);
    FileUses files;
    files.reads("--config ", options.run.config);
    files.writes("--out ", results.geometry);
    files.also_writes("--out " + results.geometry.string(), results.json);
    files.also_writes("--out " + results.geometry.string(), results.text);
    return files;
}

std::string kernel_text() {
    utsname name{};
    return uname(&name) == 0 ? std::string(name.sysname) + " " + name.release + " " + name.machine : "unknown kernel";
}

/// Nominal geometry without its own corrections of channels: the board is driven channel by channel.
device::DeviceGeometry by_channel(device::DeviceGeometry geometry) {
    geometry.motor_channels = device::DeviceGeometry{}.motor_channels;
    return geometry;
}

BringupBoard::Limits limits_of(const BringupOptions& options, const device::DeviceGeometry& nominal) {
    BringupBoard::Limits limits;
    double finest = std::fabs(nominal.strings.front().metres_per_count);
    for (const device::StringFacts& string : nominal.strings) {
        const int code = device::dac_code_of_tension(options.steps.cap, string.newtons_per_code);
        limits.cap_code = std::max(limits.cap_code, std::abs(code));
        finest = std::min(finest, std::fabs(string.metres_per_count));
    }
    limits.most_counts = static_cast<std::int64_t>(kMostTravel / finest);
    limits.key_timeout_ns = nanoseconds(options.dead_man_s);
    limits.button = options.button;
    return limits;
}

/// One run of the command. Members are declared in the order in which they must be constructed.
class Bringup {
  public:
    Bringup(const BringupOptions& options, const StopSignals& signals)
        : options_(options),
          files_(options.out),
          config_(load_config(options.run.config, options.run.assignments)),
          settings_(read_settings(config_)),
          name_(options.geometry.value_or(config_.text("device.geometry", "SpidarG6X3R"))),
          nominal_(device::find_device_geometry(name_)),
          console_(signals) {
        options_.steps.period_ns = settings_.loop.period_ns;
        options_.steps.exchanges_per_tick = settings_.tick.exchanges;
        settings_.tick.geometry = by_channel(nominal_);
        if (options.sign) {
            protocol_ = load_bringup(files_.json);
        } else {
            choose_protocol();
        }
    }

    /// Signs again for a geometry that calibration has refined.
    int sign() {
        if (protocol_.nominal_fingerprint != fingerprint(nominal_)) {
            throw Refusal("bringup --sign: " + files_.json.string() + " was made with the nominal geometry " +
                          protocol_.nominal + "; name it with --geometry");
        }
        const BringupSummary found = summary();
        const std::optional<device::DeviceGeometry>& measured = found.device.geometry;
        if (!protocol_.finished || !found.can_be_signed() || !measured) {
            throw Refusal("bringup --sign: " + files_.json.string() + " is not complete; --resume completes it");
        }
        const device::DeviceGeometry refined = device::load_device_geometry(files_.geometry);
        if (const std::string changed = changed_beyond_calibration(*measured, refined); !changed.empty()) {
            throw Refusal("bringup --sign: " + files_.geometry.string() +
                          " is no refinement of what was measured: " + changed + "; bring the device up again");
        }
        protocol_.person.clear();
        protocol_.geometry_file = files_.geometry.string();
        protocol_.geometry_fingerprint = fingerprint(refined);
        console_.say(protocol_text(protocol_, nominal_, found));
        offer_to_sign([] {});
        save();
        write_text(files_.text, protocol_text(protocol_, nominal_, found));
        return kExitDone;
    }

    int run() {
        const std::unique_ptr<OpenedDevice> device = open_device(options_.run, settings_);
        greet(*device);
        try {
            BringupBoard board(*device, console_, device::counter_bits(nominal_.board), limits_of(options_, nominal_));
            BringupSteps(board, console_, device->emulated(), nominal_, options_.steps, protocol_, [this] {
                save();
            }).run();
            return conclude(board);
        } catch (const BringupStopped& stopped) {
            console_.say(std::string("\n") + stopped.what() + "; the motors are at zero.");
            tell_resume();
            return kExitDone;
        } catch (const BoardLost& lost) {
            console_.say(std::string("\nThe bring-up was interrupted: ") + lost.what());
            tell_resume();
            return kExitFaulted;
        }
    }

  private:
    void choose_protocol() {
        protocol_.started = now_text();
        protocol_.nominal = name_;
        protocol_.nominal_fingerprint = fingerprint(nominal_);
        protocol_.haptic_version = program_version();
        protocol_.kernel = kernel_text();
        if (!std::filesystem::exists(files_.json)) {
            if (options_.resume) {
                throw Refusal("bringup --resume: there is no " + files_.json.string() + " to resume");
            }
            return;
        }
        BringupProtocol old = load_bringup(files_.json);
        const bool open = old.person.empty();
        if (open &&
            (options_.resume || console_.confirm("There is a protocol of " + old.started + " in " +
                                                     files_.json.string() + " that nobody has signed. Resume it?",
                                                 [] {}))) {
            resume(std::move(old));
            return;
        }
        if (options_.resume) {
            throw Refusal("bringup --resume: " + files_.json.string() +
                          " is signed; without --resume a new one begins");
        }
        back_up();
    }

    void resume(BringupProtocol old) {
        if (old.nominal_fingerprint != fingerprint(nominal_)) {
            throw Refusal("bringup: " + files_.json.string() + " was begun with another nominal geometry, " +
                          old.nominal);
        }
        protocol_ = std::move(old);
        protocol_.finished = false;
        // What must be fixed is measured again: it was fixed in between, or it will be found again.
        drop_what_must_be_fixed(protocol_, nominal_, settings_.loop.period_ns, settings_.tick.exchanges);
    }

    /// Keeps an old protocol under the first free name.
    void back_up() const {
        const std::filesystem::path kept = free_backup_name(files_.json);
        std::filesystem::rename(files_.json, kept);
        console_.say("The earlier protocol is kept as " + kept.string() + ".");
    }

    void greet(const OpenedDevice& device) {
        protocol_.device = device.description();
        console_.say("Bring-up of " + protocol_.device + ", with the nominal geometry " + name_ + ".");
        console_.say("The protocol is " + files_.json.string() + "; it is saved after each measurement.");
        console_.say(
            "Have the switch of the motors' power within reach. q stops at any question, Ctrl-C at any time;\n"
            "rt-core bringup --resume continues.");
        save();
    }

    void save() const { rt::save(protocol_, files_.json, summary().deviations); }

    void tell_resume() const {
        save();
        console_.say("Everything measured is in " + files_.json.string() + "; rt-core bringup --resume continues.");
    }

    [[nodiscard]] BringupSummary summary() const {
        return summary_of(protocol_, nominal_, settings_.loop.period_ns, settings_.tick.exchanges);
    }

    int conclude(BringupBoard& board) {
        const BringupSummary found = summary();
        console_.say("\nResult\n" + strings_text(nominal_, findings_of(protocol_, nominal_)) +
                     deviations_text(found.deviations));
        if (found.device.geometry) {
            write_geometry(*found.device.geometry, found);
        }
        protocol_.finished = true;
        const bool fit = found.can_be_signed();
        if (fit) {
            offer_to_sign([&board] { board.idle(); });
        } else {
            console_.say("The protocol cannot be signed before this is fixed: the device renders at most 1 N.");
        }
        save();
        write_text(files_.text, protocol_text(protocol_, nominal_, found));
        console_.say("The protocol is in " + files_.text.string() + " and " + files_.json.string() + ".");
        if (!protocol_.geometry_file.empty()) {
            console_.say("Use the device with --set device.geometry=" + protocol_.geometry_file);
        }
        return fit ? kExitDone : kExitFailed;
    }

    void write_geometry(const device::DeviceGeometry& geometry, const BringupSummary& found) {
        const std::string comment = "Measured by rt-core bringup on " + now_text() + " with " + protocol_.device +
                                    ",\nfrom the nominal geometry " + name_ + ".\n" + deviations_text(found.deviations);
        const auto backup = device::write_device_geometry(files_.geometry, geometry, comment);
        protocol_.geometry_file = files_.geometry.string();
        protocol_.geometry_fingerprint = fingerprint(geometry);
        console_.say("The geometry is in " + files_.geometry.string() +
                     (backup ? ", the previous file is " + backup->string() : "") + ".");
    }

    void offer_to_sign(const BringupConsole::Idle& idle) {
        console_.say(
            "\nWith your signature rt-core drives this device with its full force. It ends when the geometry "
            "file changes.");
        const std::string person = console_.ask("Your name, or Enter to leave the protocol unsigned:", idle);
        if (person.empty()) {
            console_.say("Not signed: the device renders at most 1 N.");
            return;
        }
        const std::string consent =
            console_.ask("I have seen these results, and this device may pull a person's hand. Type agree:", idle);
        if (consent != "agree") {
            console_.say("Not signed: the device renders at most 1 N.");
            return;
        }
        protocol_.person = person;
        protocol_.signed_on = now_text();
        console_.say("Signed by " + person + " for the geometry " + protocol_.geometry_fingerprint + ".");
    }

    BringupOptions options_;
    Files files_;
    Config config_;
    Settings settings_;
    std::string name_;
    device::DeviceGeometry nominal_;
    BringupConsole console_;
    BringupProtocol protocol_;
};

}  // namespace

int bringup_command(const BringupOptions& options) {
    files_of_bringup(options).require_distinct();
    const StopSignals signals;
    Bringup bringup(options, signals);
    return options.sign ? bringup.sign() : bringup.run();
}

}  // namespace haptic::rt
