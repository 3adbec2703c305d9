#include "commands/bringup_console.hpp"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>

namespace haptic::rt {
namespace {

constexpr int kInputWaitMs = 5;

/// Reads what has arrived; at most until `wait_ms`. Throws BringupStopped at the end of the input.
std::string read_input(int wait_ms) {
    pollfd watched{STDIN_FILENO, POLLIN, 0};
    if (poll(&watched, 1, wait_ms) <= 0) {
        return {};
    }
    std::array<char, 512> buffer{};
    const ssize_t count = ::read(STDIN_FILENO, buffer.data(), buffer.size());
    if (count > 0) {
        return {buffer.data(), static_cast<std::size_t>(count)};
    }
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) {
        return {};
    }
    throw BringupStopped("the terminal was closed");
}

std::string trimmed(const std::string& line) {
    const std::size_t begin = line.find_first_not_of(" \t\r\n");
    return begin == std::string::npos ? "" : line.substr(begin, line.find_last_not_of(" \t\r\n") + 1 - begin);
}

}  // namespace

BringupConsole::BringupConsole(const StopSignals& signals) : signals_(&signals) {
    if (isatty(STDIN_FILENO) == 0) {
        throw Refusal("bringup: standard input is not a terminal; a person at the device has to answer");
    }
}

void BringupConsole::say(const std::string& line) const {
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
}

void BringupConsole::check_signals() const {
    if (signals_->wait(0) != 0) {
        throw BringupStopped("stopped by a signal");
    }
}

std::string BringupConsole::ask(const std::string& question, const Idle& idle) const {
    // Drop keys that were typed before the question: a dead-man key goes on for a moment.
    tcflush(STDIN_FILENO, TCIFLUSH);
    std::printf("%s ", question.c_str());
    std::fflush(stdout);
    std::string line;
    while (line.find('\n') == std::string::npos) {
        check_signals();
        idle();
        line += read_input(kInputWaitMs);
    }
    line = trimmed(line);
    if (line == "q") {
        throw BringupStopped("stopped by q");
    }
    return line;
}

bool BringupConsole::confirm(const std::string& question, const Idle& idle) const {
    while (true) {
        const std::string answer = ask(question + " [y/n]", idle);
        if (answer == "y" || answer == "yes") {
            return true;
        }
        if (answer == "n" || answer == "no") {
            return false;
        }
        say("  Please type y or n; q stops and keeps what was measured.");
    }
}

void BringupConsole::show(const std::string& line) const {
    // A terminal that takes no output must not keep a motor pulling.
    pollfd watched{STDOUT_FILENO, POLLOUT, 0};
    if (isatty(STDOUT_FILENO) != 0 && poll(&watched, 1, 0) == 1 && (watched.revents & POLLOUT) != 0) {
        std::printf("\r\033[K  %s", line.c_str());
        std::fflush(stdout);
    }
}

void BringupConsole::end_show() const {
    if (isatty(STDOUT_FILENO) != 0) {
        std::printf("\n");
        std::fflush(stdout);
    }
}

RawKeys::RawKeys() {
    tcgetattr(STDIN_FILENO, &before_);
    termios raw = before_;
    raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    raw.c_iflag &= ~static_cast<tcflag_t>(IXON);  // Ctrl-S is a key that releases, and does not stop the output
    raw.c_cc[VMIN] = 0;
    raw.c_cc[VTIME] = 0;
    // At once: TCSAFLUSH would wait for a terminal that does not take its output.
    tcsetattr(STDIN_FILENO, TCSANOW, &raw);
    tcflush(STDIN_FILENO, TCIFLUSH);
}

RawKeys::~RawKeys() {
    tcsetattr(STDIN_FILENO, TCSANOW, &before_);
    tcflush(STDIN_FILENO, TCIFLUSH);
}

RawKeys::Pressed RawKeys::read(int wait_ms) const {
    Pressed pressed;
    for (const char key : read_input(wait_ms)) {
        if (key == ' ') {
            pressed.space = true;
        } else {
            pressed.other = key;
        }
    }
    return pressed;
}

}  // namespace haptic::rt
