#include "process/usb_settings.hpp"

#include <haptic/types.hpp>

namespace haptic::rt {

UsbSettings read_usb_settings(const Config& config) {
    UsbSettings settings;
    const std::string id = config.text("device.usb_id", "");
    if (!id.empty()) {
        settings.id = device::parse_usb_id(id);
        if (!settings.id) {
            config.fail("device.usb_id", "must be vendor and product in hexadecimal, such as 0cec:0205");
        }
    }
    settings.path = config.text("device.usb_path", "");
    const std::int64_t rotary = config.integer("device.rotary", -1, {-1, 15});
    if (rotary >= 0) {
        settings.rotary = static_cast<std::uint8_t>(rotary);
    }
    settings.timeout_ns =
        nanoseconds(config.number("device.usb_timeout_s", seconds(settings.timeout_ns), {0.0002, 0.1}));
    return settings;
}

}  // namespace haptic::rt
