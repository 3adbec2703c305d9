// `rt-core arm`: arms the rt-core of a session that waits for a person, or shows its state.
#pragma once

#include <string>

namespace haptic::rt {

struct ArmOptions {
    std::string session = "default";
    bool state = false;  // only show the state
};

/// Returns 0 if the session is armed now, or its state was asked for. Throws std::runtime_error if it cannot be armed
/// now, or there is no such session.
int arm_command(const ArmOptions& options);

}  // namespace haptic::rt
