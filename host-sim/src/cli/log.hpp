// Where the commands that run for long say what happens.
#pragma once

namespace haptic::sim {

/// From here on what is logged goes to stderr, each line after "host-sim: ".
void log_to_stderr();

}  // namespace haptic::sim
