// A child process of a test: started with arguments, its output kept in a file, signalled, waited for with a bound.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic::test {

class Process {
  public:
    /// Starts `command` (program and arguments); standard output and error go to `log`. Throws std::system_error.
    Process(const std::vector<std::string>& command, std::filesystem::path log);
    Process(const Process&) = delete;
    Process& operator=(const Process&) = delete;
    /// Kills what still runs.
    ~Process();

    void signal(int number) const;
    /// Exit status, or 128 + signal number; nothing if it still runs after the time.
    std::optional<int> wait_for(std::chrono::milliseconds time);
    /// Waits until the log contains a text. False if the time or the process ends first.
    bool wait_for_text(const std::string& text, std::chrono::milliseconds time);
    [[nodiscard]] std::string output() const;
    [[nodiscard]] pid_t pid() const noexcept { return pid_; }

  private:
    std::filesystem::path log_;
    pid_t pid_ = -1;
    std::optional<int> status_;
};

/// Runs a command to its end; for commands that end by themselves.
struct Finished {
    int status;  // exit status, 128 + signal number, or -1 if it had to be killed after 60 s
    std::string output;
    pid_t pid;
};
[[nodiscard]] Finished run(const std::vector<std::string>& command);

/// A folder for one test's files, empty at its start and removed at its end.
class ScratchFolder {
  public:
    ScratchFolder();
    ~ScratchFolder();
    ScratchFolder(const ScratchFolder&) = delete;
    ScratchFolder& operator=(const ScratchFolder&) = delete;
    [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

  private:
    std::filesystem::path path_;
};

/// The shared-memory segments that a session has left in /dev/shm.
[[nodiscard]] std::vector<std::string> segments_of(const std::string& session);

}  // namespace haptic::test
