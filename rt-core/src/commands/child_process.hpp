// A program of somebody else's that runs beside the loop: started with ordinary scheduling and signals, whatever this
// process has, in a group of its own, and ended with everything that it has started.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace haptic::rt {

/// The program's path, found in PATH. Throws Refusal that names the Debian package that has it if it is not there.
[[nodiscard]] std::string find_program(const std::string& name, const std::string& package);

class ChildProcess {
  public:
    /// Starts a command (path and arguments) whose output goes nowhere. Throws Refusal.
    explicit ChildProcess(std::vector<std::string> command);
    ChildProcess(const ChildProcess&) = delete;
    ChildProcess& operator=(const ChildProcess&) = delete;
    /// Kills the group and waits.
    ~ChildProcess();

    /// How it ended, as a shell says it (128 + signal number for a signal); nothing while it runs.
    [[nodiscard]] std::optional<int> ended();
    /// Asks the group to end.
    void terminate() const;

  private:
    pid_t pid_ = -1;
    std::optional<int> status_;
};

/// The command as one would type it.
[[nodiscard]] std::string in_words(const std::vector<std::string>& command);

}  // namespace haptic::rt
