// The configuration of the process: rt-core/config/rt-core.toml says what each key means and what it may be.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include <haptic/config.hpp>
#include <haptic/device/board_options.hpp>
#include <haptic/device/grip_mechanics.hpp>
#include "transport/serial_transport.hpp"
#include "process/loop.hpp"
#include "process/stop_input.hpp"
#include "tick/tick.hpp"
#include "tick/tick_probes.hpp"
#include "process/usb_settings.hpp"
#include "process/watchdog.hpp"

namespace haptic::rt {

struct Settings {
    TickSettings tick;
    LoopSettings loop;
    device::BoardOptions board;
    std::optional<device::GripMechanics> mechanics;  // of the emulated device; nothing for an ideal hand
    WatchdogSettings watchdog;
    UsbSettings usb;
    bool rearm = false;  // after the device was lost, wait for it and go on
    device::SerialTransport::Settings serial;
    GpioStopSettings stop_line;
    ProbeLines probes;
    std::size_t queue_ticks = 16384;  // capacity of the Recorder
    std::size_t queue_frames = 512;   // likewise; 11 kB each
};

/// Reads every key that there is. Throws ConfigError for a value that is wrong in itself or beside another one, and for
/// a key that nobody knows.
[[nodiscard]] Settings read_settings(const Config& config);

/// Keys device.* that say how a board is spoken to. Throws ConfigError.
[[nodiscard]] device::BoardOptions read_board_options(const Config& config);
/// Keys device.uart_* that say how a serial line is run. Throws ConfigError.
[[nodiscard]] device::SerialTransport::Settings read_serial_settings(const Config& config);

/// The commented file with all defaults, as it is installed.
[[nodiscard]] std::string_view default_config_text() noexcept;

}  // namespace haptic::rt
