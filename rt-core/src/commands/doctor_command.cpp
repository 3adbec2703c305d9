#include "commands/doctor_command.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "commands/run_command.hpp"
#include "commands/run_files.hpp"
#include "doctor/doctor.hpp"
#include "haptic/report.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {
namespace {

FileUses files_of_doctor(const DoctorOptions& options, const Config& config) {
    FileUses files;
    files.reads("--config ", options.config);
    add_device_files(files, config);
    files.writes("--json ", options.json);
    return files;
}

DoctorSettings doctor_settings(const Config& config) {
    const Settings settings = read_settings(config);
    DoctorSettings result{.priority = settings.loop.priority,
                          .cpu = settings.loop.cpu,
                          .idle_exit_us = settings.loop.idle_exit_us,
                          .period_ns = settings.loop.period_ns,
                          .exchanges = settings.tick.exchanges,
                          .baud = settings.serial.baud,
                          .packets = device::exchange_packets(settings.tick.geometry.board, settings.board)};
    // A board without a known USB id is on a serial line, whatever usb.id says.
    const std::optional<device::UsbId> known = device::usb_id_of(settings.tick.geometry.board);
    if (const std::optional<device::UsbId> id = settings.usb.id ? settings.usb.id : known; known && id) {
        result.usb = device::UsbSelection{.id = *id, .path = settings.usb.path};
    }
    return result;
}

}  // namespace

int doctor_command(const DoctorOptions& options) {
    const Config config = load_config(options.config, options.assignments);
    files_of_doctor(options, config).require_distinct();
    const Diagnosis diagnosis = examine(Machine(options.root), doctor_settings(config));
    std::fputs(text_of(diagnosis).c_str(), stdout);
    if (options.json) {
        write_report(*options.json, json_of(diagnosis));
    }
    return diagnosis.good() ? 0 : kExitUnfit;
}

}  // namespace haptic::rt
