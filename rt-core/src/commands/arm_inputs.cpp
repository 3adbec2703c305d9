#include "commands/arm_inputs.hpp"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <string_view>

namespace haptic::rt {

ArmInputs::ArmInputs(const std::string& session, ArmSwitch& person, int button)
    : session_(session), person_(&person), button_(button), server_(session) {}

bool ArmInputs::has_terminal() {
    return isatty(STDIN_FILENO) == 1 && tcgetpgrp(STDIN_FILENO) == getpgrp();
}

std::string ArmInputs::instructions() const {
    std::string text = has_terminal() ? "press Enter here, " : "";
    if (button_ >= 0) {
        text += "hold button " + std::to_string(button_) + " of the board for 1 s, ";
    }
    return text + (text.empty() ? "run: " : "or run: ") + "rt-core arm --session " + session_;
}

void ArmInputs::begin() {
    key_ended_ = false;
    if (has_terminal()) {
        tcflush(STDIN_FILENO, TCIFLUSH);
    }
}

bool ArmInputs::enter_typed() {
    pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    if (key_ended_ || !has_terminal() || ::poll(&input, 1, 0) <= 0) {
        return false;
    }
    std::array<char, 256> typed{};
    const ssize_t size = read(STDIN_FILENO, typed.data(), typed.size());
    key_ended_ = size <= 0;
    return size > 0 && std::string_view(typed.data(), static_cast<std::size_t>(size)).find('\n') != std::string::npos;
}

void ArmInputs::poll(const std::string& state) {
    if (person_->awaited() && enter_typed()) {
        person_->press(ArmedBy::Key);
    }
    server_.poll([&](ArmQuestion question) -> ArmAnswer {
        if (question == ArmQuestion::State) {
            return {.done = true, .text = state};
        }
        return person_->press(ArmedBy::Command) ? ArmAnswer{.done = true, .text = "armed"}
                                                : ArmAnswer{.done = false, .text = state};
    });
}

}  // namespace haptic::rt
