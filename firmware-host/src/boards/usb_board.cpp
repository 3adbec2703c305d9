#include "haptic/device/usb_board.hpp"

#include <optional>
#include <string>
#include <vector>

#include "boards/make_board.hpp"
#include "transport/usb_transport.hpp"

namespace haptic::device {
namespace {

constexpr int kAttempts = 3;  // of the first exchange

/// Result of asking one device for its rotary switch.
struct ProbedDevice {
    UsbDevice device;
    std::optional<std::uint8_t> rotary;
    std::string problem;  // empty if there is a rotary position
};

std::string list_of(const std::vector<ProbedDevice>& probed) {
    std::string text;
    for (const ProbedDevice& one : probed) {
        text += "\n  " + to_string(one.device) + ": " +
                (one.rotary ? "rotary switch " + std::to_string(*one.rotary) : one.problem);
    }
    return text;
}

}  // namespace

UsbBoard::UsbBoard(BoardKind kind, const UsbSelection& selection, std::int64_t timeout_ns, const BoardOptions& options)
    : selection_(selection),
      transport_(std::make_unique<UsbTransport>(UsbTransport::Settings{.timeout_ns = timeout_ns})),
      board_(make_board(kind, *transport_, options)) {
    reopen();
}

UsbBoard::~UsbBoard() = default;

void UsbBoard::reopen() {
    transport_->close();
    const std::vector<UsbDevice> present = list_usb_devices();
    const std::vector<UsbDevice> matching = candidates(present, selection_);
    if (matching.empty()) {
        throw UsbError(describe_absence(present, selection_));
    }
    if (matching.size() == 1 && !selection_.rotary) {
        open(matching.front());
        return;
    }

    // The rotary switch is visible only in a board's reply: open each candidate in turn.
    std::vector<ProbedDevice> probed;
    std::vector<UsbDevice> selected;
    for (const UsbDevice& device : matching) {
        try {
            const std::uint8_t rotary = open(device);
            probed.push_back({device, rotary, {}});
            if (!selection_.rotary || rotary == *selection_.rotary) {
                selected.push_back(device);
            }
        } catch (const BoardError& error) {
            probed.push_back({device, std::nullopt, error.what()});
        }
        transport_->close();
    }
    if (selected.size() != 1) {
        const std::string wanted =
            to_string(selection_.id) +
            (selection_.rotary ? " with its rotary switch at " + std::to_string(*selection_.rotary) : std::string());
        throw UsbError((selected.empty() ? "no usable USB device " : "more than one USB device ") + wanted + ":" +
                       list_of(probed) + "\nSelect one with device.rotary or device.usb_path");
    }
    open(selected.front());
}

std::uint8_t UsbBoard::open(const UsbDevice& device) {
    transport_->open(device.node);
    device_ = device;
    try {
        return first_exchange();
    } catch (const BoardError&) {
        // Another program may have crashed in the middle of a transfer. A reset has the effect of replugging.
        if (!transport_->reset()) {
            transport_->open(device.node);
        }
    }
    try {
        return first_exchange();
    } catch (const BoardError&) {
        transport_->close();
        throw;
    }
}

std::uint8_t UsbBoard::first_exchange() {
    BoardReading reading;
    ExchangeStatus status = ExchangeStatus::Timeout;
    for (int i = 0; i < kAttempts; ++i) {
        board_->start();
        status = board_->exchange(MotorCommand{}, reading, 0);
        if (status == ExchangeStatus::Ok) {
            return reading.rotary;
        }
    }
    throw UsbError(to_string(device_) + ": opened, but its first exchange failed: " + std::string(describe(status)) +
                   ". Power-cycle the device; if the error persists, raise device.usb_timeout_s");
}

bool UsbBoard::gone() const noexcept {
    return transport_->gone();
}

}  // namespace haptic::device
