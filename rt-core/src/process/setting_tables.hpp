// Setting tables of rt-core: every key of its configuration file, in the order of the default file.
#pragma once

#include <string>

#include "haptic/device/emulated_settings.hpp"
#include "haptic/probe.hpp"
#include "haptic/setting.hpp"
#include "process/settings.hpp"

namespace haptic::rt {

/// Values of keys that need more than a conversion to become Settings: read_settings() derives those from them.
struct FileKeys {
    std::string geometry = "SpidarG6X3R";
    std::string protocol;            // empty: beside the geometry file
    double minimum_tension = 0.0;    // N
    double maximum_tension = 200.0;  // N
    std::string usb_id;
    int rotary = -1;
    double friction = 0.0;                          // N
    NumberOrWord stiffness{{}, "auto"};             // N/m
    NumberOrWord rotational_stiffness{{}, "auto"};  // N*m/rad
    double stiffness_delay_s = 0.0;                 // s
    std::string relay_chip;
    int relay_line = 0;
    ProbeSettings probes;
    device::EmulatedSettings emulated;
};

const SettingTable<LoopSettings>& loop_table();
const SettingTable<FileKeys>& geometry_table();
const SettingTable<TickSettings>& exchange_table();
const SettingTable<FileKeys>& usb_choice_table();
const SettingTable<UsbSettings>& usb_table();
const SettingTable<device::BoardOptions>& board_table();
const SettingTable<device::TtyBoard::Settings>& serial_table();
const SettingTable<PassivitySettings>& mechanics_table();
const SettingTable<FileKeys>& friction_table();
const SettingTable<TickSettings>& velocity_table();
const SettingTable<FrameSettings>& frames_table();
const SettingTable<OverlaySettings>& overlay_table();
const SettingTable<WrenchLimits>& limits_table();
const SettingTable<FileKeys>& stiffness_table();
const SettingTable<PassivitySettings>& passivity_table();
const SettingTable<TickSettings>& tension_table();
const SettingTable<MotorSettings>& motors_table();
const SettingTable<SafetySettings>& safety_table();
const SettingTable<Settings>& recovery_table();
const SettingTable<TickSettings>& stop_button_table();
const SettingTable<GpioStopSettings>& stop_line_table();
const SettingTable<FileKeys>& relay_table();
const SettingTable<ProbeLines>& probe_lines_table();
const SettingTable<Settings>& recording_table();

/// Calls visit(table, struct) for each table and the struct that it fills. Reading, documents and completion all go
/// through this one list.
template <typename Visitor>
void visit_tables(Settings& settings, FileKeys& keys, const Visitor& visit) {
    visit(loop_table(), settings.loop);
    // [device]
    visit(geometry_table(), keys);
    visit(exchange_table(), settings.tick);
    visit(usb_choice_table(), keys);
    visit(usb_table(), settings.usb);
    visit(board_table(), settings.board);
    visit(serial_table(), settings.serial);
    visit(mechanics_table(), settings.tick.passivity);
    visit(friction_table(), keys);
    visit(velocity_table(), settings.tick);
    visit(frames_table(), settings.tick.frames);
    visit(overlay_table(), settings.tick.overlay);
    // [limits]
    visit(limits_table(), settings.tick.limits);
    visit(stiffness_table(), keys);
    visit(passivity_table(), settings.tick.passivity);
    visit(tension_table(), settings.tick);
    visit(motors_table(), settings.tick.motors);
    // [safety]
    visit(safety_table(), settings.tick.safety);
    visit(recovery_table(), settings);
    visit(stop_button_table(), settings.tick);
    visit(stop_line_table(), settings.stop_line);
    visit(relay_table(), keys);
    // [probes]
    visit(probe_settings(), keys.probes);
    visit(probe_lines_table(), settings.probes);
    visit(device::emulated_settings(), keys.emulated);
    visit(recording_table(), settings);
}

}  // namespace haptic::rt
