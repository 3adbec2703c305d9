#include "open_device.hpp"

#include <utility>

#include "haptic/device/emulated_board.hpp"
#include "haptic/device/hand_file.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/rt/held_hand.hpp"

namespace haptic::rt {
namespace {

class EmulatedDevice final : public OpenedDevice {
  public:
    EmulatedDevice(const Settings& settings, PoseTrack hand)
        : emulated_({.variant = settings.tick.variant, .hand = std::move(hand), .hand_waits = true}, settings.board),
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

}  // namespace

std::unique_ptr<OpenedDevice> open_device(const RunOptions& options, const Settings& settings) {
    const std::string& name = options.device;
    if (name == "emulated") {
        return std::make_unique<EmulatedDevice>(settings, options.hand ? device::hand_from_centre(*options.hand) : PoseTrack());
    }
    if (name == "usb" || name.starts_with("replay:")) {
        throw Refusal("--device " + name + ": not available in this version; only --device emulated is");
    }
    throw Refusal("--device " + name + ": unknown device; the choices are emulated, usb and replay:FILE");
}

}  // namespace haptic::rt
