// Settings of posix_spawn() for an external program: nothing of the caller's signals and scheduling passes on.
#pragma once

#include <spawn.h>

#include <string>
#include <vector>

namespace haptic {

/// RAII owner of attributes and file actions: no blocked or ignored signal, ordinary scheduling.
class SpawnSettings {
  public:
    SpawnSettings();
    SpawnSettings(const SpawnSettings&) = delete;
    SpawnSettings& operator=(const SpawnSettings&) = delete;
    ~SpawnSettings();

    /// The program gets a process group of its own, which can be killed as a whole.
    void set_own_group();

    posix_spawnattr_t attributes{};
    posix_spawn_file_actions_t files{};
};

/// The argument list that posix_spawn() wants, which ends with null. It points into `command`.
[[nodiscard]] std::vector<char*> spawn_arguments(std::vector<std::string>& command);

}  // namespace haptic
