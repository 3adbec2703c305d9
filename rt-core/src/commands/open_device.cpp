#include "commands/open_device.hpp"

#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "commands/rewired_device.hpp"
#include "commands/tty_device.hpp"
#include "haptic/clock.hpp"
#include "haptic/device/emulated_board.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/device/hand_file.hpp"
#include "haptic/device/usb_board.hpp"
#include "haptic/device/wiring.hpp"
#include "haptic/pose_track.hpp"
#include "process/held_hand.hpp"

namespace haptic::rt {
namespace {

std::vector<device::Fault> faults_of(const RunOptions& options) {
    std::vector<device::Fault> faults;
    faults.reserve(options.faults.size());
    for (const std::string& text : options.faults) {
        faults.push_back(device::parse_fault(text));
    }
    return faults;
}

device::Wiring wiring_of(const RunOptions& options) {
    device::Wiring wiring;
    for (const std::string& text : options.wiring) {
        device::add_wiring(wiring, text);
    }
    return wiring;
}

class EmulatedDevice final : public OpenedDevice {
  public:
    EmulatedDevice(const RunOptions& options, const Settings& settings)
        : emulated_({.geometry = settings.tick.geometry,
                     .hand = options.hand ? device::hand_from_centre(*options.hand) : PoseTrack(),
                     .hand_buttons = options.hand ? device::buttons_of_hand(*options.hand) : device::ButtonTrack(),
                     .hand_waits = true,
                     .mechanics = settings.mechanics,
                     .faults = faults_of(options),
                     .faults_wait = true,
                     .wiring = wiring_of(options),
                     .tremor = settings.tremor},
                    settings.board),
          board_(emulated_) {}

    [[nodiscard]] device::Board& board() override { return board_; }
    [[nodiscard]] bool is_real() const override { return false; }
    [[nodiscard]] std::string description() const override {
        return "an emulated " + emulated_.device().geometry().name;
    }
    void attach(const Tick& tick) override { board_.attach(tick); }
    [[nodiscard]] device::EmulatedDevice* emulated() override { return &emulated_.device(); }

  private:
    device::EmulatedBoard emulated_;
    HeldHandBoard board_;
};

class UsbDevice final : public OpenedDevice {
  public:
    explicit UsbDevice(const Settings& settings)
        : board_(settings.tick.geometry.board, selection(settings), settings.usb.timeout_ns, settings.board),
          geometry_(settings.tick.geometry.name),
          timeout_ns_(settings.usb.timeout_ns),
          packets_(device::exchange_packets(settings.tick.geometry.board, settings.board)) {}

    [[nodiscard]] device::Board& board() override { return board_; }
    [[nodiscard]] bool is_real() const override { return true; }
    [[nodiscard]] std::string description() const override {
        return "a " + geometry_ + ", " + to_string(board_.device());
    }
    [[nodiscard]] PeriodDemand demand() const override {
        return {.route = board_.device().over_network ? Route::Usbip : Route::Usb,
                .speed = bus_speed(board_.device().speed_mbit),
                .awaits_second = false,
                .packets = packets_};
    }
    [[nodiscard]] std::int64_t exchange_bound_ns() const override { return kMaxTransfers * timeout_ns_; }
    void reopen() override { board_.reopen(); }

  private:
    static constexpr std::int64_t kMaxTransfers = 2;  // after a stale answer the board reads once more

    static device::UsbSelection selection(const Settings& settings) {
        const device::DeviceGeometry& geometry = settings.tick.geometry;
        const std::optional<device::UsbId> known = device::usb_id_of(geometry.board);
        if (!known) {
            throw Refusal("--device usb: the board of " + geometry.name +
                          " is on a serial line; use --device tty:PATH");
        }
        if (settings.tick.exchanges * kMaxTransfers * settings.usb.timeout_ns >= settings.watchdog.limit_ns) {
            throw Refusal("--device usb: device.usb_timeout_s lets a tick wait longer than safety.watchdog_s allows");
        }
        return {settings.usb.id.value_or(*known), settings.usb.path, settings.usb.rotary};
    }

    device::UsbBoard board_;
    std::string geometry_;
    std::int64_t timeout_ns_;
    device::ExchangePackets packets_;
};

}  // namespace

void OpenedDevice::reopen() {
    board().start();
    device::BoardReading unused;
    const device::ExchangeStatus status = board().exchange({}, unused, monotonic_now_ns());
    if (status != device::ExchangeStatus::Ok) {
        throw device::BoardError(description() + ": " + std::string(describe(status)));
    }
}

namespace {

std::unique_ptr<OpenedDevice> open_as_wired(const RunOptions& options, const Settings& settings) {
    const std::string& name = options.device;
    if (name == "emulated") {
        if (options.hand && std::filesystem::is_fifo(*options.hand)) {
            throw Refusal("--hand " + options.hand->string() +
                          ": is a pipe, but is read more than once; write it to a file first");
        }
        return std::make_unique<EmulatedDevice>(options, settings);
    }
    if (options.hand) {
        throw Refusal("--hand: only the emulated device follows a recorded hand, not --device " + name);
    }
    if (!options.faults.empty()) {
        throw Refusal("--fault: only the emulated device can simulate faults, not --device " + name);
    }
    if (!options.wiring.empty()) {
        throw Refusal("--wiring: only the emulated device can be wired differently, not --device " + name);
    }
    try {
        if (name == "usb") {
            return std::make_unique<UsbDevice>(settings);
        }
        if (constexpr std::string_view tty = "tty:"; name.starts_with(tty)) {
            return open_tty_device(name.substr(tty.size()), settings);
        }
    } catch (const device::BoardError& error) {
        throw Refusal("--device " + name + ": " + error.what());
    }
    throw Refusal("--device " + name + ": unknown device; the choices are emulated, usb, tty:PATH and replay:FILE");
}

}  // namespace

std::unique_ptr<OpenedDevice> open_device(const RunOptions& options, const Settings& settings) {
    return with_motor_channels(open_as_wired(options, settings), settings.tick.geometry);
}

}  // namespace haptic::rt
