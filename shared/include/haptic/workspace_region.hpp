// Workspace region: where the device of a session lets the grip move freely, told by the real-time process to the live
// view.
//
// A text file beside the session's rings, /dev/shm/haptic-<uid>-<session>-region, with mode 0600. It is no part of the
// rings, because it does not change while the process runs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "haptic/types.hpp"

namespace haptic {

/// An ellipsoid of positions about the device's centre, and an angle of any rotation.
struct WorkspaceRegion {
    Vec3 semi_axes{0.0};  // m, device frame
    double angle = 0.0;   // rad
};

/// Path of a session's file. Throws RingError::Kind::BadSessionName.
[[nodiscard]] std::filesystem::path region_path(const std::string& session);

/// The file, while this exists.
class PublishedRegion {
  public:
    /// Replaces a file that a killed process left. Throws std::system_error.
    PublishedRegion(const std::string& session, const WorkspaceRegion& region);
    PublishedRegion(const PublishedRegion&) = delete;
    PublishedRegion& operator=(const PublishedRegion&) = delete;
    ~PublishedRegion();

  private:
    std::filesystem::path path_;
};

/// The region of a session; empty if there is none, or if the file is not this user's or makes no sense.
[[nodiscard]] std::optional<WorkspaceRegion> read_region(const std::string& session);

}  // namespace haptic
