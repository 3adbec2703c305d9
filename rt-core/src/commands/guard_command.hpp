// `rt-core guard`: the process that outlives the loop (process/guard.hpp), and saves its black box. `rt-core run`
// starts it; nobody else does.
#pragma once

namespace haptic::rt {

/// Guards the run at the other end of the socket. Returns the exit status. Throws Refusal if there is none.
[[nodiscard]] int guard_command(int socket);

}  // namespace haptic::rt
