// `rt-core zero`: sets the motors of a real device to zero and ends. The second net of the service, whatever became of
// the loop and its guard.
#pragma once

#include "commands/run_command.hpp"

namespace haptic::rt {

/// Opens the device, waiting for a guard that may still have it, and sends zeros until the board has confirmed them.
/// Takes the options of a run, so that a service can pass the same ones; those that do not concern the device have no
/// effect. Returns the exit status. Throws Refusal, ConfigError.
[[nodiscard]] int zero_command(const RunOptions& options);

}  // namespace haptic::rt
