// Arm inputs: the key and the command by which a person arms a disarmed loop. The button of the board is read by the
// loop itself.
#pragma once

#include <string>

#include "process/arm_socket.hpp"
#include "process/arm_switch.hpp"

namespace haptic::rt {

class ArmInputs {
  public:
    /// Opens the session's socket. `button`: of the board, -1 for none. Throws std::runtime_error.
    ArmInputs(const std::string& session, ArmSwitch& person, int button);

    /// What a person can do, as a sentence.
    [[nodiscard]] std::string instructions() const;
    /// To be called when an act begins to be awaited: discards what was typed before.
    void begin();
    /// Reports an act, and answers `rt-core arm` with this state. Never waits.
    void poll(const std::string& state);

  private:
    /// Whether a key at this process's terminal would reach it: not in the background.
    [[nodiscard]] static bool has_terminal();
    [[nodiscard]] bool enter_typed();

    std::string session_;
    ArmSwitch* person_;
    int button_;
    bool key_ended_ = false;  // end of file at the terminal
    ArmServer server_;
};

}  // namespace haptic::rt
