// USB discovery: lists the USB devices of this machine and selects one.
//
// Reads /sys/bus/usb/devices each time, without libusb: libusb's list is updated by udev events and misses new devices
// where no udevd runs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/device/device_geometry.hpp"

namespace haptic::device {

struct UsbId {
    std::uint16_t vendor = 0;
    std::uint16_t product = 0;

    friend bool operator==(const UsbId&, const UsbId&) = default;
};

/// "0cec:0205"
[[nodiscard]] std::string to_string(UsbId id);
/// Parses two numbers of four hexadecimal digits separated by a colon; otherwise empty.
[[nodiscard]] std::optional<UsbId> parse_usb_id(std::string_view text);
/// USB id of a kind of board; empty if it is not a USB board.
[[nodiscard]] std::optional<UsbId> usb_id_of(BoardKind kind);

/// `product` of the root hub of a bus of usbip's (drivers/usb/usbip/vhci_hcd.c).
inline constexpr const char* kUsbipController = "USB/IP Virtual Host Controller";

struct UsbDevice {
    UsbId id;
    std::string port;            // bus and ports, "1-2.4": unchanged when the device is reconnected
    std::filesystem::path node;  // "/dev/bus/usb/001/007": changes when it is reconnected
    int speed_mbit = 0;          // Mbit/s of its link: 12, 480; 0: unknown
    bool over_network = false;   // on a bus of usbip's, whose device is on another machine or in another program
};

/// "0cec:0205 at 1-2.4 (/dev/bus/usb/001/007)"
[[nodiscard]] std::string to_string(const UsbDevice& device);

/// Selection criteria; all that are set must match.
struct UsbSelection {
    UsbId id;
    std::string path{};                    // a port or a node; empty: any
    std::optional<std::uint8_t> rotary{};  // 0..15, of the board's rotary switch
};

/// All devices of this machine, sorted by port. Empty if the kernel has no USB.
[[nodiscard]] std::vector<UsbDevice> list_usb_devices();

/// Devices that match id and path. The rotary switch is visible only in a board's reply and not checked.
[[nodiscard]] std::vector<UsbDevice> candidates(const std::vector<UsbDevice>& devices, const UsbSelection& selection);

/// Message for a search without candidates: the selection, the connected devices, and what to do.
[[nodiscard]] std::string describe_absence(const std::vector<UsbDevice>& devices, const UsbSelection& selection);

}  // namespace haptic::device
