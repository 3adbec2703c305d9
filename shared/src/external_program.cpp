#include "haptic/external_program.hpp"

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "haptic/spawn_settings.hpp"

namespace haptic {
namespace {

/// A file in memory, gone when closed. Unlike a pipe it holds any amount of text without a reader.
class MemoryFile {
  public:
    explicit MemoryFile(const char* name) : descriptor_(memfd_create(name, MFD_CLOEXEC)) {
        if (descriptor_ < 0) {
            throw std::system_error(errno, std::generic_category(), "memfd_create");
        }
    }
    MemoryFile(const MemoryFile&) = delete;
    MemoryFile& operator=(const MemoryFile&) = delete;
    ~MemoryFile() { close(descriptor_); }

    [[nodiscard]] int descriptor() const { return descriptor_; }

    /// Writes all of the text and returns to the beginning, for a reader.
    void fill(const std::string& text) const {
        for (std::size_t done = 0; done < text.size();) {
            const ssize_t count = write(descriptor_, text.data() + done, text.size() - done);
            if (count < 0 && errno != EINTR) {
                throw std::system_error(errno, std::generic_category(), "text for an external program");
            }
            done += count > 0 ? static_cast<std::size_t>(count) : 0;
        }
        lseek(descriptor_, 0, SEEK_SET);
    }

    [[nodiscard]] std::string text() const {
        lseek(descriptor_, 0, SEEK_SET);
        std::string result;
        std::array<char, 65536> part{};
        for (ssize_t count = 0; (count = read(descriptor_, part.data(), part.size())) != 0;) {
            if (count < 0 && errno != EINTR) {
                throw std::system_error(errno, std::generic_category(), "text of an external program");
            }
            result.append(part.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
        }
        return result;
    }

  private:
    int descriptor_;
};

}  // namespace

ExternalResult run_external(std::vector<std::string> command, const std::string& input,
                            const std::filesystem::path& folder) {
    const std::vector<char*> arguments = spawn_arguments(command);
    // Standard streams in memory, and the working directory.
    const MemoryFile in("input");
    const MemoryFile out("output");
    const MemoryFile errors("errors");
    in.fill(input);
    SpawnSettings settings;
    posix_spawn_file_actions_adddup2(&settings.files, in.descriptor(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&settings.files, out.descriptor(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&settings.files, errors.descriptor(), STDERR_FILENO);
    posix_spawn_file_actions_addchdir_np(&settings.files, folder.c_str());
    pid_t child = 0;
    const int refused =
        posix_spawnp(&child, arguments.front(), &settings.files, &settings.attributes, arguments.data(), environ);
    if (refused != 0) {
        return {.found = refused != ENOENT, .errors = std::generic_category().message(refused)};
    }
    // Wait for the program, also across signals.
    int status = 0;
    while (waitpid(child, &status, 0) < 0) {
        if (errno != EINTR) {
            return {.found = true, .errors = std::generic_category().message(errno)};
        }
    }
    return {.found = true,
            .succeeded = WIFEXITED(status) && WEXITSTATUS(status) == 0,
            .output = out.text(),
            .errors = errors.text()};
}

}  // namespace haptic
