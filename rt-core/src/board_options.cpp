// Keys that decide what is not known of the boards.
#include "haptic/device/board_options.hpp"

#include "haptic/rt/settings.hpp"

namespace haptic::rt {

device::BoardOptions read_board_options(const Config& config) {
    device::BoardOptions options;
    options.check_echo = config.choice("device.echo", "check", {"check", "ignore"}) == "check";
    options.simple_phase =
        static_cast<std::uint8_t>(config.integer("device.simple_phase", options.simple_phase, {0, 255}));
    return options;
}

}  // namespace haptic::rt
