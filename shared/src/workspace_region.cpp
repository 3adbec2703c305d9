#include "haptic/workspace_region.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <system_error>

#include "haptic/ring.hpp"

namespace haptic {
namespace {

constexpr mode_t kPrivate = 0600;
// Larger values belong to no device.
constexpr double kLargestAxis = 10.0;   // m
constexpr double kLargestAngle = 3.15;  // rad

bool is_sensible(double value, double largest) {
    return std::isfinite(value) && value > 0.0 && value < largest;
}

}  // namespace

std::filesystem::path region_path(const std::string& session) {
    (void)ring_segment_name(session, RingKind::State);  // refuses a bad name
    return "/dev/shm/haptic-" + std::to_string(geteuid()) + "-" + session + "-region";
}

PublishedRegion::PublishedRegion(const std::string& session, const WorkspaceRegion& region)
    : path_(region_path(session)) {
    std::array<char, 160> text{};
    const int size = std::snprintf(text.data(), text.size(), "%.9g %.9g %.9g %.9g\n", region.semi_axes.x,
                                   region.semi_axes.y, region.semi_axes.z, region.angle);
    // A new file, so that nothing is written through a link that another user has put there.
    (void)unlink(path_.c_str());
    const int fd = open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, kPrivate);
    const bool written = fd >= 0 && write(fd, text.data(), static_cast<std::size_t>(size)) == size;
    const int error = errno;
    if (fd >= 0) {
        close(fd);
    }
    if (!written) {
        throw std::system_error(error, std::generic_category(), path_.native() + " cannot be written");
    }
}

PublishedRegion::~PublishedRegion() {
    (void)unlink(path_.c_str());
}

std::optional<WorkspaceRegion> read_region(const std::string& session) {
    const int fd = open(region_path(session).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0) {
        return std::nullopt;
    }
    struct stat status{};
    std::array<char, 160> text{};
    const bool own = fstat(fd, &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == geteuid();
    const ssize_t size = own ? read(fd, text.data(), text.size() - 1) : -1;
    close(fd);
    WorkspaceRegion region;
    Vec3& axes = region.semi_axes;
    std::istringstream numbers(size > 0 ? std::string(text.data(), static_cast<std::size_t>(size)) : std::string());
    if (!(numbers >> axes.x >> axes.y >> axes.z >> region.angle) || !is_sensible(axes.x, kLargestAxis) ||
        !is_sensible(axes.y, kLargestAxis) || !is_sensible(axes.z, kLargestAxis) ||
        !is_sensible(region.angle, kLargestAngle)) {
        return std::nullopt;
    }
    return region;
}

}  // namespace haptic
