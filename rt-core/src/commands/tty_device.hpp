// Serial device: UART motor boards on a serial line, --device tty:PATH.
#pragma once

#include <filesystem>
#include <memory>

#include "commands/open_device.hpp"
#include "process/settings.hpp"

namespace haptic::rt {

/// Opens the line and finds the motors. Throws Refusal if the configured device has another kind of board, and
/// device::BoardError if the line cannot be opened or does not have eight motors.
[[nodiscard]] std::unique_ptr<OpenedDevice> open_tty_device(const std::filesystem::path& path,
                                                            const Settings& settings);

}  // namespace haptic::rt
