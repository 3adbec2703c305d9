#include "commands/open_device.hpp"

#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <haptic/clock.hpp>
#include <haptic/device/emulated_board.hpp>
#include <haptic/device/fault.hpp>
#include <haptic/device/hand_file.hpp>
#include <haptic/device/usb_board.hpp>
#include <haptic/pose_track.hpp>
#include "process/held_hand.hpp"
#include "commands/tty_device.hpp"

namespace haptic::rt {
namespace {

class EmulatedDevice final : public OpenedDevice {
  public:
    EmulatedDevice(const Settings& settings, PoseTrack hand, std::vector<device::Fault> faults)
        : emulated_({.variant = settings.tick.variant,
                     .hand = std::move(hand),
                     .hand_waits = true,
                     .mechanics = settings.mechanics,
                     .faults = std::move(faults),
                     .faults_wait = true},
                    settings.board),
          board_(emulated_) {}

    [[nodiscard]] device::Board& board() override { return board_; }
    [[nodiscard]] bool real() const override { return false; }
    [[nodiscard]] std::string description() const override {
        return "an emulated " + emulated_.device().variant().name;
    }
    void follow(const Tick& tick) override { board_.follow(tick); }

  private:
    device::EmulatedBoard emulated_;
    HeldHandBoard board_;
};

class UsbDevice final : public OpenedDevice {
  public:
    explicit UsbDevice(const Settings& settings)
        : board_(settings.tick.variant.board, selection(settings), {.timeout_ns = settings.usb.timeout_ns},
                 settings.board),
          variant_(settings.tick.variant.name),
          timeout_ns_(settings.usb.timeout_ns) {}

    [[nodiscard]] device::Board& board() override { return board_; }
    [[nodiscard]] bool real() const override { return true; }
    [[nodiscard]] std::string description() const override {
        return "a " + variant_ + ", " + to_string(board_.device());
    }
    [[nodiscard]] std::int64_t exchange_bound_ns() const override { return kMostTransfers * timeout_ns_; }
    void reopen() override { board_.reopen(); }

  private:
    static constexpr std::int64_t kMostTransfers = 2;  // a board that finds an old answer fetches one more

    static device::UsbSelection selection(const Settings& settings) {
        const device::Variant& variant = settings.tick.variant;
        const std::optional<device::UsbId> known = device::usb_id_of(variant.board);
        if (!known) {
            throw Refusal("--device usb: the board of " + variant.name + " has a serial line; use --device tty:PATH");
        }
        if (settings.tick.exchanges * kMostTransfers * settings.usb.timeout_ns >= settings.watchdog.limit_ns) {
            throw Refusal("--device usb: device.usb_timeout_s lets a tick wait for longer than safety.watchdog_s does");
        }
        return {settings.usb.id.value_or(*known), settings.usb.path, settings.usb.rotary};
    }

    device::UsbBoard board_;
    std::string variant_;
    std::int64_t timeout_ns_;
};

std::vector<device::Fault> faults_of(const RunOptions& options) {
    std::vector<device::Fault> faults;
    faults.reserve(options.faults.size());
    for (const std::string& text : options.faults) {
        faults.push_back(device::parse_fault(text));
    }
    return faults;
}

}  // namespace

void OpenedDevice::reopen() {
    board().start();
    device::BoardReading unused;
    const device::ExchangeStatus status = board().exchange({}, unused, monotonic_now_ns());
    if (status != device::ExchangeStatus::Ok) {
        throw device::BoardError(description() + ": " + std::string(describe(status)));
    }
}

std::unique_ptr<OpenedDevice> open_device(const RunOptions& options, const Settings& settings) {
    const std::string& name = options.device;
    if (name == "emulated") {
        return std::make_unique<EmulatedDevice>(
            settings, options.hand ? device::hand_from_centre(*options.hand) : PoseTrack(), faults_of(options));
    }
    if (!options.faults.empty()) {
        throw Refusal("--fault: only an emulated device fails on command, not --device " + name);
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

}  // namespace haptic::rt
