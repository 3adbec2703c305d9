#include "haptic/other_users.hpp"

#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace haptic {
namespace {

/// User id in the file name "haptic-<uid>-<session>-contact", "-state" or "-overlay"; empty for other names.
std::optional<uid_t> user_in(std::string_view file, std::string_view session) {
    constexpr std::string_view prefix = "haptic-";
    if (!file.starts_with(prefix)) {
        return std::nullopt;
    }
    file.remove_prefix(prefix.size());
    uid_t user = 0;
    const auto [end, error] = std::from_chars(file.data(), file.data() + file.size(), user);
    const std::string_view rest = file.substr(static_cast<std::size_t>(end - file.data()));
    const std::string named = "-" + std::string(session);
    const bool is_ring = rest == named + "-contact" || rest == named + "-state" || rest == named + "-overlay";
    return error == std::errc{} && is_ring ? std::optional(user) : std::nullopt;
}

/// "haptic (999)"
std::string name_of(uid_t user) {
    std::array<char, 4096> buffer{};
    passwd entry{};
    passwd* found = nullptr;
    const bool known = getpwuid_r(user, &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr;
    return known ? std::string(entry.pw_name) + " (" + std::to_string(user) + ")" : std::to_string(user);
}

}  // namespace

std::vector<uid_t> other_users_of(const std::string& session, const std::filesystem::path& folder) {
    std::vector<uid_t> users;
    std::error_code error;
    for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
        const std::optional<uid_t> user = user_in(entry->path().filename().string(), session);
        if (user && *user != geteuid()) {
            users.push_back(*user);
        }
    }
    std::sort(users.begin(), users.end());
    users.erase(std::unique(users.begin(), users.end()), users.end());
    return users;
}

std::string describe_other_users(const std::string& session, const std::filesystem::path& folder) {
    std::string names;
    for (const uid_t user : other_users_of(session, folder)) {
        names += (names.empty() ? "" : ", ") + name_of(user);
    }
    if (names.empty()) {
        return {};
    }
    return "session \"" + session + "\" also exists for user " + names + ", but this process runs as user " +
           name_of(geteuid()) +
           ": rings are private to a user, so the two processes cannot connect. Run both as the same user (sudo -u "
           "USER, or both as services), or use another --session if they should not connect";
}

}  // namespace haptic
