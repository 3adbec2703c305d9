// Workspace file: a file with a table [workspace] that the user may edit while the scene runs; polled.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "haptic/sim/workspace.hpp"

namespace haptic::sim {

class WorkspaceFile {
  public:
    /// Reads the file; keys that it lacks are taken from `defaults`, now and whenever it is read again. Throws
    /// ConfigError.
    WorkspaceFile(std::filesystem::path file, const WorkspaceSettings& defaults);

    [[nodiscard]] const WorkspaceSettings& settings() const noexcept { return settings_; }

    /// Returns new settings if the file has changed since it was read, is unchanged since the last poll (its writer has
    /// finished), and differs in content. Accesses the file at most once per kPollNs; now_ns must not decrease. An
    /// invalid file changes nothing and sets error().
    [[nodiscard]] std::optional<WorkspaceSettings> poll(std::int64_t now_ns);

    /// Error found by the last poll(); empty if there is none, or if it was reported before.
    [[nodiscard]] const std::string& error() const noexcept { return error_; }

    static constexpr std::int64_t kPollNs = 200'000'000;

  private:
    /// Identifies a version of the file without reading it.
    struct Stamp {
        std::int64_t modified_ns = 0;
        std::uint64_t inode = 0;
        std::int64_t size = -1;  // -1: no such file
        bool operator==(const Stamp&) const = default;
    };
    [[nodiscard]] Stamp stamp() const;
    [[nodiscard]] WorkspaceSettings read() const;

    std::filesystem::path file_;
    WorkspaceSettings defaults_;
    Stamp stamp_;  // when last read
    Stamp seen_;   // in the last poll
    WorkspaceSettings settings_;
    std::string error_;
    std::int64_t next_poll_ns_ = 0;
};

}  // namespace haptic::sim
