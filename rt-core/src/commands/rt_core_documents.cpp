#include "commands/rt_core_documents.hpp"

#include "commands/run_command.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {
namespace {

constexpr const char* kReferenceHeading =
    "# Settings of rt-core\n\n"
    "Every key of the configuration file, [rt-core.toml(5)](../README.md). This page is generated from\n"
    "`rt-core/src/process/setting_tables.cpp`; `rt-core --generate DIR` writes it as `DIR/settings.md`.\n"
    "Every key is optional. Use a file with `rt-core run --config FILE`, and `--set SECTION.KEY=VALUE` for one key.\n"
    "Units are SI.\n";

}  // namespace

ProgramDocuments rt_core_documents() {
    const SettingReference reference = setting_reference();
    const std::vector<std::pair<std::string, std::string>> files{
        {"/etc/haptic/rt-core.toml", "Configuration of haptic-rt-core.service; see rt-core.toml(5)."},
        {"/usr/share/haptic/rt-core.toml.schema.json", "Schema of that file, for editors."},
        {"/etc/default/haptic-rt-core", "Options of haptic-rt-core.service."},
    };
    ProgramDocuments documents;
    documents.text = {
        .summary = "real-time process of a Spidar-G6 haptic device",
        .description =
            "rt-core drives the eight strings of a Spidar-G6 at 1 kHz. It computes the pose of the grip from the "
            "encoders, renders the contact planes that host-sim(1) publishes in shared memory as force and torque, and "
            "distributes them over the strings.\n\n"
            "It uses SCHED_FIFO and locks its memory. rt-core doctor shows what a machine lacks for that, and "
            "haptic-tune(8) sets a machine up.",
        .exit_status =
            exit_statuses({kExitDone, kExitFailed, kExitRefused, kExitFaulted, kExitDiffers, kExitUnfit, kExitUsage}),
        .files = files,
        .examples = {{"rt-core run --device emulated --duration 10", "Runs the loop on the emulated device."},
                     {"rt-core run --print-config >rt-core.toml", "Writes the default configuration."},
                     {"rt-core run --device usb --set limits.force=4", "Overrides one key."}},
        .see_also = {"rt-core.toml(5)", "host-sim(1)", "firmware-host(1)", "haptic-tune(8)"},
    };
    documents.words.settings = completion_words(reference);
    documents.settings = {
        .page = "rt-core.toml",
        .text = {.summary = "configuration of rt-core",
                 .description =
                     "A TOML file for rt-core run --config. Every key is optional; the values below are the "
                     "defaults. Units are SI. An unknown key, a wrong type or a value out of range is refused "
                     "with its line. rt-core run --print-config prints a file with all keys.",
                 .exit_status = {},
                 .files = {files.front()},
                 .examples = {},
                 .see_also = {"rt-core(1)"}},
        .default_name = "rt-core.toml",
        .default_file = default_config_text(),
        .markdown = markdown_reference(kReferenceHeading, reference),
        .reference = reference,
    };
    return documents;
}

}  // namespace haptic::rt
