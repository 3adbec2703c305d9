// Child process: an external program that runs next to the loop, with default scheduling and signal handling, in its
// own process group, which is killed as a whole.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic::rt {

/// Path of a program, searched in PATH. Throws Refusal, which names the Debian package to install.
[[nodiscard]] std::string find_program(const std::string& name, const std::string& package);

class ChildProcess {
  public:
    /// Starts a command (path and arguments). Its output and errors go to a file, by default to none. Throws Refusal.
    explicit ChildProcess(std::vector<std::string> command, const std::filesystem::path& output = "/dev/null");
    ChildProcess(const ChildProcess&) = delete;
    ChildProcess& operator=(const ChildProcess&) = delete;
    /// Kills the process group and waits for its leader.
    ~ChildProcess();

    /// Exit status as in a shell (128 + signal number for a signal); empty while it runs.
    [[nodiscard]] std::optional<int> exit_status();
    /// Sends SIGINT to the group.
    void interrupt() const;

  private:
    pid_t pid_ = -1;
    std::optional<int> status_;
};

/// The words of a command, joined by spaces.
[[nodiscard]] std::string command_text(const std::vector<std::string>& command);

}  // namespace haptic::rt
