#include "commands/run_files.hpp"

#include <array>
#include <string_view>

#include "measure/frame_recording.hpp"
#include "process/device_protocol.hpp"

namespace haptic::rt {
namespace {

constexpr std::string_view kReplayPrefix = "replay:";

/// Files beside a recording.
std::array<std::filesystem::path, 3> files_beside(const std::filesystem::path& recording) {
    const std::filesystem::path frames = frames_file(recording);
    return {frames, compliance_file(frames), config_file_of(recording)};
}

void add_recording(FileUses& files, const std::filesystem::path& record) {
    files.writes("--record ", record);
    // A recording to a pipe or a device keeps no frames and no settings.
    if (!std::filesystem::exists(record) || std::filesystem::is_regular_file(record)) {
        for (const std::filesystem::path& file : files_beside(record)) {
            files.also_writes("--record " + record.string(), file);
        }
    }
}

/// The last ticks before the first fault or a stop, and those of a run that is killed.
void add_black_boxes(FileUses& files, const RunOptions& options) {
    const std::string given = options.report   ? "--report " + options.report->string()
                              : options.record ? "--record " + options.record->string()
                                               : "--session " + options.session;
    for (const char* extension : {"fault.csv", "killed.csv"}) {
        files.also_writes(given, black_box_path(options, extension));
    }
}

}  // namespace

FileUses files_of_run(const RunOptions& options) {
    FileUses files;
    files.reads("--config ", options.config);
    files.reads("--hand ", options.hand);
    files.writes("--report ", options.report);
    if (options.record) {
        add_recording(files, *options.record);
    }
    const std::filesystem::path recording = replayed_recording(options);
    if (recording.empty()) {
        add_black_boxes(files, options);
        return files;
    }
    // A replay reads the whole recording, and keeps no black box.
    files.reads("--device replay:", recording);
    for (const std::filesystem::path& file : files_beside(recording)) {
        files.also_reads("--device " + options.device, file);
    }
    return files;
}

void add_device_files(FileUses& files, const Config& config) {
    const std::string geometry = config.text("device.geometry", "");
    // A built-in geometry has no file and no protocol.
    if (const std::filesystem::path protocol = protocol_beside(geometry); !protocol.empty()) {
        files.reads("device.geometry=", geometry);
        files.also_reads("device.geometry=" + geometry, protocol);
    }
    files.reads("device.protocol=", config.text("device.protocol", ""));
}

std::filesystem::path black_box_path(const RunOptions& options, const std::string& extension) {
    if (options.report) {
        return std::filesystem::path(*options.report).replace_extension(extension);
    }
    if (options.record) {
        return std::filesystem::path(*options.record).replace_extension(extension);
    }
    return "rt-core-" + options.session + "." + extension;
}

std::filesystem::path replayed_recording(const RunOptions& options) {
    return options.device.starts_with(kReplayPrefix) ? options.device.substr(kReplayPrefix.size()) : std::string();
}

std::filesystem::path config_file_of(const std::filesystem::path& recording) {
    return std::filesystem::path(recording).replace_extension("config.toml");
}

}  // namespace haptic::rt
