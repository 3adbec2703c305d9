// Bring-up console: questions to the person at the terminal, and keys while a motor pulls.
#pragma once

#include <termios.h>

#include <functional>
#include <stdexcept>
#include <string>

#include "commands/run.hpp"

namespace haptic::rt {

/// The person stopped: Ctrl-C, a closed terminal, or `q` as an answer.
class BringupStopped : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

class BringupConsole {
  public:
    /// Called about every 5 ms while the console waits.
    using Idle = std::function<void()>;

    /// Standard input must be a terminal. Throws Refusal otherwise.
    explicit BringupConsole(const StopSignals& signals);

    /// Prints a line.
    void say(const std::string& line = {}) const;
    /// Asks, and returns the line that was typed, without spaces at both ends. Throws BringupStopped.
    [[nodiscard]] std::string ask(const std::string& question, const Idle& idle) const;
    /// Asks until the answer is y or n.
    [[nodiscard]] bool confirm(const std::string& question, const Idle& idle) const;
    /// Overwrites the last line that show() printed.
    void show(const std::string& line) const;
    /// Ends the line of show().
    void end_show() const;
    /// Throws BringupStopped after a signal.
    void check_signals() const;

  private:
    const StopSignals* signals_;
};

/// While it exists, keys arrive at once, without Enter and without an echo. Ctrl-C still sends its signal.
class RawKeys {
  public:
    struct Pressed {
        bool space = false;
        char other = '\0';  // the last other key
    };

    RawKeys();
    RawKeys(const RawKeys&) = delete;
    RawKeys& operator=(const RawKeys&) = delete;
    ~RawKeys();

    /// The keys since the last call. Waits for one at most this long. Throws BringupStopped if the terminal is closed.
    [[nodiscard]] Pressed read(int wait_ms) const;

  private:
    termios before_{};
};

}  // namespace haptic::rt
