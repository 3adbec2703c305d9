#include "process.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <system_error>
#include <thread>

extern char** environ;

namespace haptic::test {
namespace {

constexpr std::chrono::milliseconds kPoll{5};

int status_of(int wait_status) {
    return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
}

}  // namespace

Process::Process(const std::vector<std::string>& command, std::filesystem::path log) : log_(std::move(log)) {
    std::vector<char*> arguments;
    for (const std::string& argument : command) {
        arguments.push_back(const_cast<char*>(argument.c_str()));
    }
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    const int error = posix_spawn(&pid_, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
        throw std::system_error(error, std::generic_category(), "cannot start " + command[0]);
    }
}

Process::~Process() {
    if (!status_) {
        kill(pid_, SIGKILL);
        wait_for(std::chrono::seconds(10));
    }
}

void Process::signal(int number) const {
    if (!status_) {
        kill(pid_, number);
    }
}

std::optional<int> Process::wait_for(std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (!status_) {
        int wait_status = 0;
        if (waitpid(pid_, &wait_status, WNOHANG) == pid_) {
            status_ = status_of(wait_status);
        } else if (std::chrono::steady_clock::now() >= end) {
            break;
        } else {
            std::this_thread::sleep_for(kPoll);
        }
    }
    return status_;
}

bool Process::wait_for_text(const std::string& text, std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (true) {
        const bool ended = wait_for(std::chrono::milliseconds(0)).has_value();
        if (output().find(text) != std::string::npos) {
            return true;
        }
        if (ended || std::chrono::steady_clock::now() >= end) {
            return false;
        }
        std::this_thread::sleep_for(kPoll);
    }
}

std::string Process::output() const {
    std::ostringstream text;
    text << std::ifstream(log_).rdbuf();
    return text.str();
}

Finished run(const std::vector<std::string>& command) {
    const ScratchFolder folder;
    Process process(command, folder / "log");
    const int status = process.wait_for(std::chrono::seconds(60)).value_or(-1);
    return {status, process.output(), process.pid()};
}

ScratchFolder::ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "haptic-test-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
        throw std::system_error(errno, std::generic_category(), "cannot make a folder " + name);
    }
    path_ = name;
}

ScratchFolder::~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

std::vector<std::string> segments_of(const std::string& session) {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator("/dev/shm")) {
        const std::string name = entry.path().filename().string();
        if (name.starts_with("haptic-") && name.find("-" + session + "-") != std::string::npos) {
            found.push_back(name);
        }
    }
    return found;
}

}  // namespace haptic::test
