// The board in sysfs, for the doctor's checks of it and of its controller.
#pragma once

#include <string>
#include <vector>

#include "doctor/doctor_checks.hpp"

namespace haptic::rt {

inline constexpr const char* kUsbDevices = "/sys/bus/usb/devices/";

struct UsbBoardEntry {
    std::string port;  // "1-2.4"
    std::string node;  // "/dev/bus/usb/001/007"
};

/// Plugged-in boards that match the settings; empty for a board without USB.
[[nodiscard]] std::vector<UsbBoardEntry> boards(const CheckContext& context);

/// Why boards() is empty.
[[nodiscard]] std::string no_board(const CheckContext& context);

}  // namespace haptic::rt
