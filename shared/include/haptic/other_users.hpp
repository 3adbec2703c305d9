// Other users: detects that a session's rings also exist for another user. Rings are private to a user, so processes of
// different users never connect.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace haptic {

/// Other users that have rings of a session with this name, in ascending order. Their processes may have ended.
[[nodiscard]] std::vector<uid_t> other_users_of(const std::string& session,
                                                const std::filesystem::path& folder = "/dev/shm");

/// Message that names these users, explains the problem and what to do; empty if there are none.
[[nodiscard]] std::string describe_other_users(const std::string& session,
                                               const std::filesystem::path& folder = "/dev/shm");

}  // namespace haptic
