#include "segment_checks.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <string_view>
#include <system_error>
#include <utility>

namespace haptic {
namespace {

constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
constexpr std::size_t kMaxSessionName = 64;

std::string_view kind_name(RingKind kind) {
    return kind == RingKind::Contact ? "contact" : kind == RingKind::State ? "state" : "overlay";
}

}  // namespace

std::string ring_segment_name(const std::string& session, RingKind kind) {
    const auto allowed = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
    };
    if (session.empty() || session.size() > kMaxSessionName || !std::all_of(session.begin(), session.end(), allowed)) {
        std::string shown = session.substr(0, kMaxSessionName);
        std::replace_if(shown.begin(), shown.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
        throw RingError(RingError::Kind::BadSessionName,
                        "session name \"" + shown + "\" must be 1 to 64 of the characters A-Z a-z 0-9 _ -");
    }
    return "/haptic-" + std::to_string(geteuid()) + "-" + session + "-" + std::string(kind_name(kind));
}

namespace detail {

bool is_held_by_another(int fd, RingLock byte, std::int64_t count) {
    struct flock request{};
    request.l_type = F_WRLCK;
    request.l_whence = SEEK_SET;
    request.l_start = static_cast<off_t>(byte);
    request.l_len = count;
    return fcntl(fd, F_OFD_GETLK, &request) == 0 && request.l_type != F_UNLCK;
}

Descriptor::Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
}

Descriptor::~Descriptor() {
    if (fd_ >= 0) {
        ::close(fd_);
    }
}

SegmentChecks::SegmentChecks(const std::string& session, RingKind kind, std::size_t slot_bytes)
    : session_(session), name_(ring_segment_name(session, kind)), kind_(kind), slot_bytes_(slot_bytes) {}

void SegmentChecks::fail(RingError::Kind kind, const std::string& problem) const {
    throw RingError(kind, "shared memory /dev/shm" + name_ + " " + problem);
}

void SegmentChecks::fail_system(const std::string& action, int error) const {
    fail(RingError::Kind::System, "cannot be " + action + ": " + std::generic_category().message(error));
}

std::string SegmentChecks::removal() const {
    return "; end the processes of session \"" + session_ + "\", then: rm /dev/shm" + name_;
}

void SegmentChecks::refuse_unopened(int error) const {
    // Symbolic link, file of another user, directory (EINVAL from glibc), device or socket.
    if (error == ELOOP || error == EACCES || error == EINVAL || error == EISDIR || error == ENXIO) {
        fail(RingError::Kind::Foreign, "cannot be used: " + std::generic_category().message(error) +
                                           "; inspect it with: ls -l /dev/shm" + name_ +
                                           ", then remove it: sudo rm -r /dev/shm" + name_);
    }
    fail_system("opened", error);
}

void SegmentChecks::refuse_foreign(int fd) const {
    struct stat status{};
    if (fstat(fd, &status) != 0) {
        fail_system("examined", errno);
    }
    if (!S_ISREG(status.st_mode)) {
        fail(RingError::Kind::Foreign, "is not a regular file; remove it: rm /dev/shm" + name_);
    }
    if (status.st_uid != geteuid()) {
        fail(RingError::Kind::Foreign, "belongs to user " + std::to_string(status.st_uid) + ", not to this user (" +
                                           std::to_string(geteuid()) + "); remove it: sudo rm /dev/shm" + name_);
    }
    if ((status.st_mode & kOthers) != 0) {
        std::array<char, 8> mode{};
        std::snprintf(mode.data(), mode.size(), "%04o", status.st_mode & 07777u);
        fail(RingError::Kind::Foreign,
             "is accessible to other users (mode " + std::string(mode.data()) + ", must be 0600)" + removal());
    }
}

void SegmentChecks::read_header(int fd, std::size_t size, void* header) const {
    if (size < sizeof(RingHeader)) {
        fail(RingError::Kind::BadSize, "is truncated: " + std::to_string(size) + " bytes" + removal());
    }
    if (pread(fd, header, sizeof(RingHeader), 0) != static_cast<ssize_t>(sizeof(RingHeader))) {
        fail_system("read", errno);
    }
}

void SegmentChecks::refuse_other_layout(const RingHeader& header, std::size_t size) const {
    if (header.identity.magic.load() != kRingMagic ||
        header.identity.kind.load() != static_cast<std::uint32_t>(kind_)) {
        fail(RingError::Kind::BadMagic, "is not a " + std::string(kind_name(kind_)) + " ring" + removal());
    }
    if (header.identity.abi.load() != HAPTIC_ABI_VERSION) {
        fail(RingError::Kind::BadAbi, "has ABI version " + std::to_string(header.identity.abi.load()) +
                                          ", this program has " + std::to_string(HAPTIC_ABI_VERSION) +
                                          ": use programs of the same release" + removal());
    }
    if (header.identity.slot_bytes.load() != slot_bytes_ || header.identity.slot_count.load() != kRingSlots) {
        fail(RingError::Kind::BadSize, "has " + std::to_string(header.identity.slot_count.load()) + " slots of " +
                                           std::to_string(header.identity.slot_bytes.load()) +
                                           " bytes, this program uses " + std::to_string(kRingSlots) + " of " +
                                           std::to_string(slot_bytes_) + removal());
    }
    if (size != RingMemory::bytes(slot_bytes_)) {
        fail(RingError::Kind::BadSize, "is truncated or overlong: " + std::to_string(size) + " bytes instead of " +
                                           std::to_string(RingMemory::bytes(slot_bytes_)) + removal());
    }
    if (header.progress.head.load() > kLastSequence) {
        fail(RingError::Kind::Damaged,
             "is damaged: its frame counter is " + std::to_string(header.progress.head.load()) + removal());
    }
}

}  // namespace detail
}  // namespace haptic
