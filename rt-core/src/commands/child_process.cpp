#include "commands/child_process.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <sstream>
#include <system_error>

#include "commands/run_command.hpp"
#include "haptic/spawn_settings.hpp"

namespace haptic::rt {
namespace {

int shell_status(int status) {
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

std::string find_program(const std::string& name, const std::string& package) {
    const char* const path = std::getenv("PATH");
    std::istringstream folders(path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin");
    for (std::string folder; std::getline(folders, folder, ':');) {
        const std::string file = (folder.empty() ? "." : folder) + "/" + name;
        if (access(file.c_str(), X_OK) == 0) {
            return file;
        }
    }
    throw Refusal(name + " is not installed; it is in Debian's package " + package + ": sudo apt install " + package);
}

ChildProcess::ChildProcess(std::vector<std::string> command, const std::filesystem::path& output) {
    const std::vector<char*> arguments = spawn_arguments(command);
    SpawnSettings settings;
    settings.set_own_group();
    posix_spawn_file_actions_addopen(&settings.files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&settings.files, STDOUT_FILENO, output.c_str(), O_WRONLY | O_APPEND, 0);
    posix_spawn_file_actions_addopen(&settings.files, STDERR_FILENO, output.c_str(), O_WRONLY | O_APPEND, 0);
    const int error =
        posix_spawn(&pid_, arguments.front(), &settings.files, &settings.attributes, arguments.data(), environ);
    if (error != 0) {
        throw Refusal(command.front() + " cannot be started: " + std::system_category().message(error));
    }
}

ChildProcess::~ChildProcess() {
    if (!status_) {
        kill(-pid_, SIGKILL);
        while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
        }
    } else {
        kill(-pid_, SIGKILL);  // processes that it has left behind
    }
}

std::optional<int> ChildProcess::exit_status() {
    int status = 0;
    if (!status_ && waitpid(pid_, &status, WNOHANG) == pid_) {
        status_ = shell_status(status);
    }
    return status_;
}

void ChildProcess::interrupt() const {
    kill(-pid_, SIGINT);
}

std::string command_text(const std::vector<std::string>& command) {
    std::string words;
    for (const std::string& word : command) {
        words += (words.empty() ? "" : " ") + word;
    }
    return words;
}

}  // namespace haptic::rt
