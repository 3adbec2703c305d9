#include "commands/arm_command.hpp"

#include <cstdio>
#include <stdexcept>

#include "process/arm_socket.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {

int arm_command(const ArmOptions& options) {
    if (options.state) {
        std::printf("%s\n", ask_session(options.session, ArmQuestion::State).text.c_str());
        return kExitDone;
    }
    const ArmAnswer answer = ask_session(options.session, ArmQuestion::Arm);
    if (!answer.done) {
        throw std::runtime_error("session \"" + options.session + "\" cannot be armed now: " + answer.text);
    }
    std::printf("%s; hold the grip still at the centre\n", answer.text.c_str());
    return kExitDone;
}

}  // namespace haptic::rt
