// USB settings: which device is driven, and how long a transfer may take.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "haptic/device/usb_discovery.hpp"

namespace haptic::rt {

struct UsbSettings {
    std::optional<device::UsbId> id;     // none: that of the geometry's board
    std::string path;                    // port or device node; empty: any
    std::optional<std::uint8_t> rotary;  // position of the rotary switch; none: any
    std::int64_t timeout_ns = 2'000'000;
};

}  // namespace haptic::rt
