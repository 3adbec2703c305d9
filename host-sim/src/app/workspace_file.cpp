#include "app/workspace_file.hpp"

#include <sys/stat.h>

#include <utility>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

WorkspaceFile::WorkspaceFile(std::filesystem::path file, const WorkspaceSettings& defaults)
    : file_(std::move(file)), defaults_(defaults), stamp_(stamp()), seen_(stamp_), settings_(read()) {}

WorkspaceFile::Stamp WorkspaceFile::stamp() const {
    struct stat found{};
    if (stat(file_.c_str(), &found) != 0) {
        return {};
    }
    return {std::int64_t{found.st_mtim.tv_sec} * kNanosecondsPerSecond + std::int64_t{found.st_mtim.tv_nsec},
            std::uint64_t{found.st_ino}, std::int64_t{found.st_size}};
}

WorkspaceSettings WorkspaceFile::read() const {
    const Config config = Config::load(file_);
    const WorkspaceSettings settings = read_workspace(config, defaults_);
    config.reject_unknown();
    return settings;
}

std::optional<WorkspaceSettings> WorkspaceFile::poll(std::int64_t now_ns) {
    error_.clear();
    if (now_ns < next_poll_ns_) {
        return std::nullopt;
    }
    next_poll_ns_ = now_ns + kPollNs;
    // Take the stamp before reading: a file that is written during the read is read again in the next poll.
    const Stamp now = stamp();
    const bool settled = now == seen_;
    seen_ = now;
    if (now == stamp_ || !settled) {
        return std::nullopt;
    }
    stamp_ = now;
    if (now.size <= 0) {
        return std::nullopt;  // an editor is replacing the file
    }
    try {
        const WorkspaceSettings next = read();
        if (next == settings_) {
            return std::nullopt;
        }
        settings_ = next;
        return next;
    } catch (const ConfigError& error) {
        error_ = error.what();
        return std::nullopt;
    }
}

}  // namespace haptic::sim
