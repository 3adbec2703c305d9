// Keys that decide what is not known of the boards.
#include <haptic/device/board_options.hpp>

#include "process/settings.hpp"
#include <haptic/types.hpp>

namespace haptic::rt {

device::BoardOptions read_board_options(const Config& config) {
    device::BoardOptions options;
    options.check_echo = config.choice("device.echo", "check", {"check", "ignore"}) == "check";
    options.simple_phase =
        static_cast<std::uint8_t>(config.integer("device.simple_phase", options.simple_phase, {0, 255}));
    options.uart.padding = static_cast<int>(config.integer("device.uart_padding", options.uart.padding, {0, 200}));
    options.uart.set_lengths = config.choice("device.uart_set_lengths", "yes", {"yes", "no"}) == "yes";
    return options;
}

device::SerialTransport::Settings read_serial_settings(const Config& config) {
    device::SerialTransport::Settings settings;
    settings.baud = static_cast<int>(config.integer("device.uart_baud", settings.baud, {115'200, 3'000'000}));
    settings.timeout_ns =
        nanoseconds(config.number("device.uart_timeout_s", seconds(settings.timeout_ns), {0.0002, 0.1}));
    return settings;
}

}  // namespace haptic::rt
