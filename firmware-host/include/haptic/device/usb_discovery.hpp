// Which USB devices there are, and which of them is meant.
//
// They are read from /sys/bus/usb/devices, afresh each time and without libusb: its list of devices is kept by udev's
// events, and shows no arrival where no udevd runs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/device/variant.hpp"

namespace haptic::device {

struct UsbId {
    std::uint16_t vendor = 0;
    std::uint16_t product = 0;

    friend bool operator==(const UsbId&, const UsbId&) = default;
};

/// "0cec:0205"
[[nodiscard]] std::string to_string(UsbId id);
/// Nothing for what is not two numbers of four hexadecimal digits with a colon between.
[[nodiscard]] std::optional<UsbId> parse_usb_id(std::string_view text);
/// Of the boards that are driven over USB; nothing for those that are not.
[[nodiscard]] std::optional<UsbId> usb_id_of(BoardKind kind);

struct UsbDevice {
    UsbId id;
    std::string port;            // bus and ports, "1-2.4": stays the same when the device is plugged in again
    std::filesystem::path node;  // "/dev/bus/usb/001/007": does not
};

/// "0cec:0205 at 1-2.4 (/dev/bus/usb/001/007)"
[[nodiscard]] std::string to_string(const UsbDevice& device);

/// What is asked for; everything that is set has to fit.
struct UsbSelection {
    UsbId id;
    std::string path{};                    // a port, or a node; empty for any
    std::optional<std::uint8_t> rotary{};  // 0..15, of the board's rotary switch
};

/// All devices of this machine, in the order of their ports. Empty where the kernel has no USB.
[[nodiscard]] std::vector<UsbDevice> list_usb_devices();

/// Those that id and path fit. The rotary switch shows only in a board's answer.
[[nodiscard]] std::vector<UsbDevice> candidates(const std::vector<UsbDevice>& devices, const UsbSelection& selection);

/// Why there is no candidate: what was looked for, what is there instead, and what to do.
[[nodiscard]] std::string describe_absence(const std::vector<UsbDevice>& devices, const UsbSelection& selection);

}  // namespace haptic::device
