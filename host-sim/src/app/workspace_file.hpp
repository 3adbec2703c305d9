// A workspace that the user changes while the scene runs: a file with a table [workspace], looked at now and then.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <haptic/sim/workspace.hpp>

namespace haptic::sim {

class WorkspaceFile {
  public:
    /// Reads the file; keys that it does not name are as in `otherwise`, now and in each later reading. Throws
    /// ConfigError.
    WorkspaceFile(std::filesystem::path file, const WorkspaceSettings& otherwise);

    [[nodiscard]] const WorkspaceSettings& settings() const noexcept { return settings_; }

    /// The new settings if the file has changed since it was read, not since the last look (so that nobody is still at
    /// it), and says something else; looks at it once in kLookNs at most, by a time that only goes on. A file that is
    /// wrong changes nothing, and complaint() says why.
    [[nodiscard]] std::optional<WorkspaceSettings> look(std::int64_t now_ns);

    /// What is wrong with the file as it was found in the last look; empty if nothing is, or if it was said before.
    [[nodiscard]] const std::string& complaint() const noexcept { return complaint_; }

    static constexpr std::int64_t kLookNs = 200'000'000;

  private:
    /// What tells one state of a file from another without reading it.
    struct Stamp {
        std::int64_t modified_ns = 0;
        std::uint64_t inode = 0;
        std::int64_t size = -1;  // -1: there is no such file
        bool operator==(const Stamp&) const = default;
    };
    [[nodiscard]] Stamp stamp() const;
    [[nodiscard]] WorkspaceSettings read() const;

    std::filesystem::path file_;
    WorkspaceSettings otherwise_;
    Stamp stamp_;  // as it was read
    Stamp seen_;   // in the last look
    WorkspaceSettings settings_;
    std::string complaint_;
    std::int64_t next_look_ns_ = 0;
};

}  // namespace haptic::sim
