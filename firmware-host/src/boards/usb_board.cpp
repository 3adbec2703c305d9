#include <haptic/device/usb_board.hpp>

#include <optional>
#include <vector>

#include <haptic/device/emulated_board.hpp>

namespace haptic::device {
namespace {

constexpr int kAttempts = 3;  // of the first exchange

struct Asked {
    UsbDevice device;
    std::optional<std::uint8_t> rotary;
    std::string problem;  // if it has none
};

std::string list(const std::vector<Asked>& asked) {
    std::string text;
    for (const Asked& one : asked) {
        text += "\n  " + to_string(one.device) + ": " +
                (one.rotary ? "rotary switch " + std::to_string(*one.rotary) : one.problem);
    }
    return text;
}

}  // namespace

UsbBoard::UsbBoard(BoardKind kind, const UsbSelection& selection, const UsbTransport::Settings& settings,
                   const BoardOptions& options)
    : selection_(selection), transport_(settings), board_(make_board(kind, transport_, options)) {
    reopen();
}

void UsbBoard::reopen() {
    transport_.close();
    const std::vector<UsbDevice> present = list_usb_devices();
    const std::vector<UsbDevice> fitting = candidates(present, selection_);
    if (fitting.empty()) {
        throw UsbError(describe_absence(present, selection_));
    }
    if (fitting.size() == 1 && !selection_.rotary) {
        open(fitting.front());
        return;
    }
    std::vector<Asked> asked;
    std::vector<UsbDevice> meant;
    for (const UsbDevice& device : fitting) {
        try {
            const std::uint8_t rotary = open(device);
            asked.push_back({device, rotary, {}});
            if (!selection_.rotary || rotary == *selection_.rotary) {
                meant.push_back(device);
            }
        } catch (const BoardError& error) {
            asked.push_back({device, std::nullopt, error.what()});
        }
        transport_.close();
    }
    if (meant.size() != 1) {
        const std::string wanted =
            to_string(selection_.id) +
            (selection_.rotary ? " with its rotary switch at " + std::to_string(*selection_.rotary) : std::string());
        throw UsbError((meant.empty() ? "no usable USB device " : "more than one USB device ") + wanted + ":" +
                       list(asked) + "\nChoose one by device.rotary or by device.usb_path");
    }
    open(meant.front());
}

std::uint8_t UsbBoard::open(const UsbDevice& device) {
    transport_.open(device.node);
    device_ = device;
    try {
        return first_exchange();
    } catch (const BoardError&) {
        // As after a crash of another program, in the middle of a transfer: what a person would do by the plug.
        if (!transport_.reset()) {
            transport_.open(device.node);
        }
    }
    try {
        return first_exchange();
    } catch (const BoardError&) {
        transport_.close();
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
                   ". Switch the device off and on again; if it stays so, raise device.usb_timeout_s");
}

}  // namespace haptic::device
