// Which USB device is driven, and how long an exchange with it may take: keys device.usb_* and device.rotary.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <haptic/config.hpp>
#include <haptic/device/usb_discovery.hpp>

namespace haptic::rt {

struct UsbSettings {
    std::optional<device::UsbId> id;     // that of the variant's board without it
    std::string path;                    // port or node; empty for any
    std::optional<std::uint8_t> rotary;  // any without it
    std::int64_t timeout_ns = 2'000'000;
};

/// Throws ConfigError.
[[nodiscard]] UsbSettings read_usb_settings(const Config& config);

}  // namespace haptic::rt
