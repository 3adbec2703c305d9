// Rings are private to a user, so two processes of different users never meet. This is how either finds that out.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace haptic {

/// The other users who have rings of a session of this name, ascending. It is not known whether their processes live.
[[nodiscard]] std::vector<uid_t> other_users_of(const std::string& session,
                                                const std::filesystem::path& folder = "/dev/shm");

/// Says who they are, that the rings do not meet, and what to do; empty where there is none.
[[nodiscard]] std::string describe_other_users(const std::string& session,
                                               const std::filesystem::path& folder = "/dev/shm");

}  // namespace haptic
