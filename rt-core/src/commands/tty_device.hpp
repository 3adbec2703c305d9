// UART motor boards on a serial line: --device tty:PATH.
#pragma once

#include <filesystem>
#include <memory>

#include "process/settings.hpp"
#include "commands/open_device.hpp"

namespace haptic::rt {

/// Throws Refusal where the variant has another board, and device::BoardError where the line cannot be had or has not
/// eight motors.
[[nodiscard]] std::unique_ptr<OpenedDevice> open_tty_device(const std::filesystem::path& path,
                                                            const Settings& settings);

}  // namespace haptic::rt
