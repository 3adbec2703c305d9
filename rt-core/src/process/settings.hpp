// Settings of rt-core: everything that its configuration file says. setting_tables.cpp describes each key.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "haptic/config.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/grip_mechanics.hpp"
#include "haptic/device/tremor.hpp"
#include "haptic/device/tty_board.hpp"
#include "haptic/setting_documents.hpp"
#include "process/device_protocol.hpp"
#include "process/guard_link.hpp"
#include "process/loop.hpp"
#include "process/stop_input.hpp"
#include "process/usb_settings.hpp"
#include "process/watchdog.hpp"
#include "tick/tick.hpp"
#include "tick/tick_probes.hpp"

namespace haptic::rt {

/// Which devices must prove themselves (device_proof.hpp).
enum class Prove : std::uint8_t { RealDevice, Always, Never };

struct Settings {
    TickSettings tick;
    LoopSettings loop;
    device::BoardOptions board;
    std::optional<device::GripMechanics> mechanics;  // of the emulated device; none: the grip follows its recording
    device::TremorSettings tremor;                   // of the hand that holds the emulated grip
    WatchdogSettings watchdog;
    GuardSettings guard;
    UsbSettings usb;
    std::string profile;       // of forces; empty: none
    bool walls = true;         // of the profile, if it has some
    DeviceProtocol protocol;   // of the geometry, as it is in its file
    bool reconnect = false;    // after the device was lost, wait for it and for a person, and continue
    bool person_arms = false;  // a person arms the device, else the start of the program does
    Prove prove = Prove::RealDevice;
    device::TtyBoard::Settings serial;
    GpioStopSettings stop_line;
    ProbeLines probes;
    std::size_t queue_ticks = 16384;  // capacity of the Recorder
    std::size_t queue_frames = 512;   // capacity of the Recorder; 89 kB each
};

/// Reads all keys. Throws ConfigError for a wrong value, for values that contradict each other, and for an unknown key.
[[nodiscard]] Settings read_settings(const Config& config);

/// The descriptions of all keys, with their defaults.
[[nodiscard]] SettingReference setting_reference();

/// The commented configuration file with all defaults, as installed.
[[nodiscard]] std::string default_config_text();

}  // namespace haptic::rt
