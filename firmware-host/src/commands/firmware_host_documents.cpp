#include "commands/firmware_host_documents.hpp"

#include "haptic/device/emulated_settings.hpp"
#include "program/exit_status.hpp"

namespace haptic::device {

ProgramDocuments firmware_host_documents() {
    ProgramDocuments documents;
    documents.text = {
        .summary = "board of a Spidar-G6, hosted on Linux",
        .description =
            "firmware-host emulates a Spidar-G6 and its board. It shows device geometries and the packets of "
            "an exchange, and serves the emulated board over USB/IP or as a serial line, so that rt-core(1) "
            "and other drivers can be tried without a device.",
        .exit_status = exit_statuses({kExitDone, kExitFailed, kExitUsage}),
        .files = {{"/usr/share/haptic/geometries", "The built-in device geometries, to be copied and changed."}},
        .examples = {},
        .see_also = {"rt-core(1)", "rt-core.toml(5)"},
    };
    documents.words.settings = completion_words({emulated_settings().describe()});
    return documents;
}

}  // namespace haptic::device
