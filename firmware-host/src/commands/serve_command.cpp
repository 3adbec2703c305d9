#include "commands/serve_command.hpp"

#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <vector>

#include "emulated/hand_keeper.hpp"
#include "emulated/make_firmware.hpp"
#include "emulated/motor_recording.hpp"
#include "haptic/clock.hpp"
#include "haptic/config.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_settings.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/device/hand_file.hpp"
#include "haptic/device/wiring.hpp"
#include "program/option_checks.hpp"
#include "served/tty_server.hpp"
#include "usbip/usbip_server.hpp"
#include "usbredir/usbredir_server.hpp"

namespace haptic::device {
namespace {

constexpr double kMaxHandDelay = 3600.0;  // s

[[noreturn]] void fail(const char* what) {
    throw std::system_error(errno, std::generic_category(), what);
}

/// Signals that end the service, as a file descriptor.
class StopSignals {
  public:
    StopSignals() {
        sigset_t set{};
        sigemptyset(&set);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
            sigaddset(&set, signal);
        }
        pthread_sigmask(SIG_BLOCK, &set, nullptr);
        descriptor_ = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
        if (descriptor_ < 0) {
            fail("cannot create a descriptor for signals");
        }
    }
    StopSignals(const StopSignals&) = delete;
    StopSignals& operator=(const StopSignals&) = delete;
    ~StopSignals() { close(descriptor_); }

    [[nodiscard]] int descriptor() const noexcept { return descriptor_; }

  private:
    int descriptor_ = -1;
};

/// Prints a log line and flushes it.
void log_line(std::string_view line) {
    std::printf("%.*s\n", static_cast<int>(line.size()), line.data());
    std::fflush(stdout);
}

DeviceGeometry geometry_of(const std::string& name_or_path) {
    try {
        return find_device_geometry(name_or_path);
    } catch (const std::invalid_argument& error) {
        throw CLI::ValidationError("--geometry", error.what());
    }
}

/// "SpidarG6X3R as 0cec:0205, high speed".
std::string device_text(const DeviceGeometry& geometry, UsbSpeed speed) {
    const UsbIdentity identity = usb_identity(geometry.board);
    std::array<char, 32> ids{};
    std::snprintf(ids.data(), ids.size(), " as %04x:%04x, ", identity.vendor, identity.product);
    return geometry.name + ids.data() + (speed == UsbSpeed::High ? "high speed" : "full speed");
}

std::unique_ptr<Server> serve_usbip(const NetworkAddress& address, const DeviceGeometry& geometry, Firmware& firmware,
                                    UsbSpeed speed) {
    auto server = std::make_unique<UsbipServer>(address, geometry.board, firmware, speed,
                                                [](std::string_view line) { log_line("usbip: " + std::string(line)); });
    const NetworkAddress& real = server->address();
    log_line("usbip: " + device_text(geometry, speed) + ", bus id 1-1, listening on " + real.host + ":" +
             std::to_string(real.port));
    return server;
}

std::unique_ptr<Server> serve_usbredir(const std::string& path, const DeviceGeometry& geometry, Firmware& firmware,
                                       UsbSpeed speed) {
    auto server = std::make_unique<UsbredirServer>(path, geometry.board, firmware, speed, [](std::string_view line) {
        log_line("usbredir: " + std::string(line));
    });
    log_line("usbredir: " + device_text(geometry, speed) + ", listening at " + path);
    return server;
}

/// Settings of the device behind the board: geometry, hand, mechanics, faults.
EmulatedDevice::Settings device_settings(const ServeArguments& arguments, const DeviceGeometry& geometry) {
    Config config = arguments.config ? Config::load(*arguments.config) : Config();
    for (const std::string& assignment : arguments.assignments) {
        config.set(assignment);
    }
    const EmulatedSettings emulated = read_emulated(config);
    EmulatedDevice::Settings settings{.geometry = geometry,
                                      .hand = arguments.hand ? hand_from_centre(*arguments.hand) : PoseTrack(),
                                      .hand_buttons = arguments.hand ? buttons_of_hand(*arguments.hand) : ButtonTrack(),
                                      .hand_waits = true,
                                      .mechanics = grip_mechanics(emulated),
                                      .tremor = emulated.tremor};
    config.reject_unknown();
    for (const std::string& wiring : arguments.wiring) {
        try {
            add_wiring(settings.wiring, wiring);
        } catch (const WiringError& error) {
            throw CLI::ValidationError("--wiring", error.what());
        }
    }
    for (const std::string& fault : arguments.faults) {
        try {
            settings.faults.push_back(parse_fault(fault));
        } catch (const FaultError& error) {
            throw CLI::ValidationError("--fault", error.what());
        }
    }
    return settings;
}

/// Refuses a device geometry whose board the chosen server cannot serve, and an address that is none. Returns the
/// address of a USB/IP server.
NetworkAddress check_server(const ServeArguments& arguments, const DeviceGeometry& geometry) {
    if (arguments.tty_option->count() > 0) {
        if (geometry.board != BoardKind::Uart) {
            throw CLI::ValidationError("--tty", "the board of " + geometry.name + " has no serial line; use --usbip");
        }
        return {};
    }
    const bool usbredir = arguments.usbredir_option->count() > 0;
    try {
        static_cast<void>(usb_identity(geometry.board));
        if (usbredir) {
            check_socket_path(arguments.usbredir);
            return {};
        }
        return parse_network_address(arguments.usbip);
    } catch (const std::invalid_argument& error) {
        throw CLI::ValidationError(usbredir ? "--usbredir" : "--usbip", error.what());
    }
}

std::unique_ptr<Server> serve_tty(const std::string& link, const DeviceGeometry& geometry, Firmware& firmware) {
    auto server =
        std::make_unique<TtyServer>(firmware, link.empty() ? std::nullopt : std::optional<std::filesystem::path>(link));
    log_line("tty: " + geometry.name + " at " + server->path().string() +
             (link.empty() ? "" : ", linked from " + link));
    return server;
}

std::unique_ptr<Server> make_server(const ServeArguments& arguments, const NetworkAddress& usbip_address,
                                    const DeviceGeometry& geometry, Firmware& firmware) {
    const UsbSpeed speed = arguments.speed == "full" ? UsbSpeed::Full : UsbSpeed::High;
    if (arguments.tty_option->count() > 0) {
        return serve_tty(arguments.tty, geometry, firmware);
    }
    if (arguments.usbredir_option->count() > 0) {
        return serve_usbredir(arguments.usbredir, geometry, firmware, speed);
    }
    return serve_usbip(usbip_address, geometry, firmware, speed);
}

/// Time until the server is due; nullptr for never.
const timespec* time_left(const Server& server, timespec& storage) {
    const std::optional<std::int64_t> due_ns = server.due_ns();
    if (!due_ns) {
        return nullptr;
    }
    const std::int64_t left_ns = std::max<std::int64_t>(0, *due_ns - monotonic_now_ns());
    storage.tv_sec = left_ns / kNanosecondsPerSecond;
    storage.tv_nsec = left_ns % kNanosecondsPerSecond;
    return &storage;
}

void serve_until_stopped(Server& server, const StopSignals& signals) {
    std::array<pollfd, 2> watched{{{signals.descriptor(), POLLIN, 0}, {server.descriptor(), POLLIN, 0}}};
    while (watched.front().revents == 0) {
        timespec storage{};
        if (ppoll(watched.data(), watched.size(), time_left(server, storage), nullptr) < 0 && errno != EINTR) {
            fail("cannot wait for clients");
        }
        server.step(monotonic_now_ns());
    }
}

}  // namespace

CLI::App* add_serve(CLI::App& app, ServeArguments& arguments) {
    CLI::App* serve = app.add_subcommand("serve", "Serve an emulated board until a signal arrives");
    arguments.usbip = "127.0.0.1:3240";
    arguments.usbip_option = serve
                                 ->add_option("--usbip", arguments.usbip,
                                              "USB/IP server: ADDR:PORT to listen on; port 0 selects a free one. "
                                              "Default unless --usbredir or --tty is given")
                                 ->expected(0, 1)
                                 ->capture_default_str();
    arguments.usbredir_option =
        serve
            ->add_option("--usbredir", arguments.usbredir,
                         "usbredir server: Unix socket to listen at, for QEMU's device usb-redir: the board is behind "
                         "the USB controller of a virtual machine")
            ->type_name("SOCKET")
            ->excludes(arguments.usbip_option);
    arguments.tty_option =
        serve
            ->add_option(
                "--tty", arguments.tty,
                "Serial line: a pseudo terminal for a device geometry with UART boards; LINK becomes a symbolic "
                "link to it")
            ->type_name("[LINK]")
            ->expected(0, 1)
            ->excludes(arguments.usbip_option)
            ->excludes(arguments.usbredir_option);
    serve
        ->add_option("--speed", arguments.speed,
                     "USB speed: full (12 Mbit/s, packets of 64 bytes) or high (480 Mbit/s, packets of 512 bytes)")
        ->check(CLI::IsMember({"full", "high"}))
        ->capture_default_str()
        ->excludes(arguments.tty_option);
    const auto geometry = [&](const char* name) {
        return serve->add_option(name, arguments.geometry,
                                 "Device geometry, which also selects the board: a built-in name or a TOML file");
    };
    const CLI::Option* const current = geometry("--geometry")->capture_default_str();
    // The former name; CLI11 hides options without a group from the help.
    const CLI::Option* const former = geometry("--variant")->group("");
    serve->callback([current, former] {
        if (current->count() > 0 && former->count() > 0) {
            throw CLI::ValidationError("--variant", "is the former name of --geometry; give only one of them");
        }
    });
    serve->add_option(
        "--hand", arguments.hand,
        "Recording (CSV: time_s,x_m,y_m,z_m[,qw,qx,qy,qz]) that the hand follows; without it the hand is still");
    serve
        ->add_option(
            "--hand-delay", arguments.hand_delay_s,
            "Time in s from the packet that makes all strings taut until the hand moves; the driver calibrates in "
            "between")
        ->capture_default_str();
    serve
        ->add_option("--record", arguments.record,
                     "Write what reaches the motors to a CSV file (time_s of CLOCK_MONOTONIC, code_0 .. code_7): a row "
                     "each time that a DAC code changes")
        ->type_name("F.csv")
        ->check(result_file());
    serve
        ->add_option("--fault", arguments.faults,
                     "Fault to inject, with its time since the first exchange (repeatable): " + fault_help())
        ->type_name("KIND@T")
        ->allow_extra_args(false);
    serve
        ->add_option("--wiring", arguments.wiring,
                     "How the board is wired, where it differs from the device geometry (repeatable): " + wiring_help())
        ->type_name("KIND:VALUE")
        ->allow_extra_args(false);
    serve->add_option("--config", arguments.config, "TOML file with a table [emulated]: mechanics of the grip")
        ->type_name("F.toml");
    serve->add_option("--set", arguments.assignments, "Set one key, e.g. emulated.mechanics=impedance (repeatable)")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    return serve;
}

void run_serve(const ServeArguments& arguments) {
    if (!std::isfinite(arguments.hand_delay_s) || arguments.hand_delay_s < 0.0 ||
        arguments.hand_delay_s > kMaxHandDelay) {
        throw CLI::ValidationError("--hand-delay", "must be 0 to 3600 s");
    }
    const DeviceGeometry geometry = geometry_of(arguments.geometry);
    const NetworkAddress address = check_server(arguments, geometry);
    const StopSignals signals;
    EmulatedDevice device(device_settings(arguments, geometry));
    const std::unique_ptr<Firmware> board = make_firmware(geometry.board, device);
    HandKeeper firmware(*board, device, nanoseconds(arguments.hand_delay_s));

    std::optional<MotorRecording> recording;
    if (arguments.record) {
        recording.emplace(firmware, device, *arguments.record);
    }
    Firmware& served = recording ? static_cast<Firmware&>(*recording) : firmware;

    const std::unique_ptr<Server> server = make_server(arguments, address, geometry, served);
    serve_until_stopped(*server, signals);
    log_line("stopped");
    if (recording) {
        recording->require_complete();
    }
}

}  // namespace haptic::device
