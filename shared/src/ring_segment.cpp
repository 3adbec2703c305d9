#include "ring_segment.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

namespace haptic {
namespace {

using detail::RingLock;

constexpr mode_t kPrivate = S_IRUSR | S_IWUSR;
constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
constexpr std::size_t kMaxSessionName = 64;
constexpr std::chrono::milliseconds kChangeLockPatience{2000};
constexpr std::chrono::milliseconds kChangeLockPause{1};

std::string_view kind_name(RingKind kind) {
    return kind == RingKind::Contact ? "contact" : "state";
}

std::string_view role_name(RingLock role) {
    return role == RingLock::Writer ? "writer" : "reader";
}

struct flock lock_request(RingLock byte, std::int64_t count, int type) {
    struct flock request{};
    request.l_type = static_cast<short>(type);
    request.l_whence = SEEK_SET;
    request.l_start = static_cast<off_t>(byte);
    request.l_len = count;
    return request;
}

/// Takes an open-file-description lock on one byte; false if another holds it. errno tells other failures.
bool try_lock(int fd, RingLock byte) {
    struct flock request = lock_request(byte, 1, F_WRLCK);
    return fcntl(fd, F_OFD_SETLK, &request) == 0;
}

/// Whether another holds any of `count` bytes from this one on.
bool is_held_by_another(int fd, RingLock byte, std::int64_t count) {
    struct flock request = lock_request(byte, count, F_WRLCK);
    return fcntl(fd, F_OFD_GETLK, &request) == 0 && request.l_type != F_UNLCK;
}

/// Polls rather than waits: a process that was stopped while it held the lock must not stop us too.
bool lock_change(int fd) {
    const auto deadline = std::chrono::steady_clock::now() + kChangeLockPatience;
    while (!try_lock(fd, RingLock::Change)) {
        if ((errno != EAGAIN && errno != EACCES) || std::chrono::steady_clock::now() > deadline) {
            return false;
        }
        std::this_thread::sleep_for(kChangeLockPause);
    }
    return true;
}

struct stat status_of(int fd) {
    struct stat status{};
    if (fstat(fd, &status) != 0) {
        status.st_nlink = 0;
    }
    return status;
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

RingSegment::Descriptor::Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

RingSegment::Descriptor& RingSegment::Descriptor::operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
}

RingSegment::Descriptor::~Descriptor() {
    if (fd_ >= 0) {
        ::close(fd_);
    }
}

RingSegment::RingSegment(const std::string& session, RingKind kind, std::size_t slot_bytes, RingLock role)
    : session_(session), name_(ring_segment_name(session, kind)), kind_(kind), slot_bytes_(slot_bytes), role_(role) {
    fd_ = open_and_lock();
    make_sound(fd_.get());
    take_role(fd_.get());
    memory_ = RingMemory(map(fd_.get()), slot_bytes_);
    own_pid().store(static_cast<std::uint32_t>(getpid()), std::memory_order_release);
    struct flock request = lock_request(RingLock::Change, 1, F_UNLCK);
    fcntl(fd_.get(), F_OFD_SETLK, &request);
}

RingSegment::~RingSegment() {
    own_pid().store(0, std::memory_order_release);
    munmap(&memory_.header(), RingMemory::bytes(slot_bytes_));
    const RingLock other = role_ == RingLock::Writer ? RingLock::Reader : RingLock::Writer;
    // Closing the descriptor gives back the role and the change lock in one step, so that of two who leave at once the
    // second finds the first gone. A segment without a name left (removed by hand) is not ours to remove again: the
    // name may be another's by now. If the lock cannot be had, the next session to use the segment removes it.
    if (lock_change(fd_.get()) && !is_held_by_another(fd_.get(), other, 1) && status_of(fd_.get()).st_nlink != 0) {
        shm_unlink(name_.c_str());
    }
}

std::atomic<std::uint32_t>& RingSegment::own_pid() const noexcept {
    RingPresence& presence = memory_.header().presence;
    return role_ == RingLock::Writer ? presence.writer_pid : presence.reader_pid;
}

void RingSegment::fail(RingError::Kind kind, const std::string& problem) const {
    throw RingError(kind, "shared memory /dev/shm" + name_ + " " + problem);
}

void RingSegment::fail_system(const std::string& action, int error) const {
    fail(RingError::Kind::System, "cannot be " + action + ": " + std::generic_category().message(error));
}

std::string RingSegment::removal() const {
    return "; end what uses session \"" + session_ + "\", then: rm /dev/shm" + name_;
}

/// The segment, with the change lock held and its name still in place.
RingSegment::Descriptor RingSegment::open_and_lock() const {
    while (true) {
        // shm_open adds O_NOFOLLOW and O_CLOEXEC.
        Descriptor fd(shm_open(name_.c_str(), O_RDWR | O_CREAT, kPrivate));
        if (fd.get() < 0) {
            const int error = errno;
            // A link, a foreign file, a directory (EINVAL from glibc), a device or socket.
            if (error == ELOOP || error == EACCES || error == EINVAL || error == EISDIR || error == ENXIO) {
                fail(RingError::Kind::Foreign, "is not ours to use: " + std::generic_category().message(error) +
                                                   "; see what it is: ls -l /dev/shm" + name_ +
                                                   ", then remove it: sudo rm -r /dev/shm" + name_);
            }
            fail_system("opened", error);
        }
        refuse_foreign(fd.get());
        if (!lock_change(fd.get())) {
            fail(RingError::Kind::System, "stays locked by a process that is creating or removing it" + removal());
        }
        // Whoever left last may have removed the segment between our opening and our locking it.
        if (status_of(fd.get()).st_nlink != 0) {
            return fd;
        }
    }
}

void RingSegment::refuse_foreign(int fd) const {
    struct stat status{};
    if (fstat(fd, &status) != 0) {
        fail_system("examined", errno);
    }
    if (!S_ISREG(status.st_mode)) {
        fail(RingError::Kind::Foreign, "is not a plain segment; remove it: rm /dev/shm" + name_);
    }
    if (status.st_uid != geteuid()) {
        fail(RingError::Kind::Foreign, "belongs to user " + std::to_string(status.st_uid) + ", not to us (" +
                                           std::to_string(geteuid()) + "); remove it: sudo rm /dev/shm" + name_);
    }
    if ((status.st_mode & kOthers) != 0) {
        std::array<char, 8> mode{};
        std::snprintf(mode.data(), mode.size(), "%04o", status.st_mode & 07777u);
        fail(RingError::Kind::Foreign,
             "is open to other users (mode " + std::string(mode.data()) + ", must be 0600)" + removal());
    }
}

/// Leaves a segment that is whole and of our layout: creates it, heals what a crashed creator left, refuses the rest.
void RingSegment::make_sound(int fd) const {
    const auto size = static_cast<std::size_t>(status_of(fd).st_size);
    if (size == 0) {
        create(fd);
        return;
    }
    if (size < sizeof(RingHeader)) {
        fail(RingError::Kind::BadSize, "is truncated: " + std::to_string(size) + " bytes" + removal());
    }
    alignas(RingHeader) std::array<std::byte, sizeof(RingHeader)> copy{};
    if (pread(fd, copy.data(), copy.size(), 0) != static_cast<ssize_t>(copy.size())) {
        fail_system("read", errno);
    }
    const RingHeader& header = *reinterpret_cast<const RingHeader*>(copy.data());
    const std::uint64_t magic = header.identity.magic.load();
    if (magic == 0 && !is_held_by_another(fd, RingLock::Writer, 2)) {
        // Its creator died before the header was complete: magic comes last, and no one can have attached.
        create(fd);
        return;
    }
    if (magic != kRingMagic || header.identity.kind.load() != static_cast<std::uint32_t>(kind_)) {
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
             "is damaged: its count of frames is " + std::to_string(header.progress.head.load()) + removal());
    }
}

void RingSegment::create(int fd) const {
    // The size is reserved now: writing to a hole for which there is no memory left would be a bus error in the tick.
    const auto size = static_cast<off_t>(RingMemory::bytes(slot_bytes_));
    const int error = ftruncate(fd, 0) != 0 ? errno : posix_fallocate(fd, 0, size);
    if (error != 0) {
        shm_unlink(name_.c_str());
        fail_system("given " + std::to_string(size) + " bytes", error);
    }
    if (fchmod(fd, kPrivate) != 0) {  // against an umask that took our own rights
        fail_system("made private", errno);
    }
    void* const memory = map(fd);
    RingMemory(memory, slot_bytes_).initialise(kind_);
    munmap(memory, static_cast<std::size_t>(size));
}

void RingSegment::take_role(int fd) const {
    if (try_lock(fd, role_)) {
        return;
    }
    if (errno != EAGAIN && errno != EACCES) {
        fail_system("locked", errno);
    }
    const std::size_t offset = role_ == RingLock::Writer ? offsetof(RingHeader, presence.writer_pid)
                                                         : offsetof(RingHeader, presence.reader_pid);
    std::uint32_t pid = 0;
    if (pread(fd, &pid, sizeof pid, static_cast<off_t>(offset)) != static_cast<ssize_t>(sizeof pid)) {
        pid = 0;
    }
    fail(RingError::Kind::RoleTaken, "already has its " + std::string(role_name(role_)) + ": process " +
                                         std::to_string(pid) + " runs session \"" + session_ + "\"; end it (kill " +
                                         std::to_string(pid) + ") or use another session name");
}

void* RingSegment::map(int fd) const {
    // Populated: every page is there before the first frame.
    void* const memory =
        mmap(nullptr, RingMemory::bytes(slot_bytes_), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd, 0);
    if (memory == MAP_FAILED) {
        fail_system("mapped", errno);
    }
    return memory;
}

}  // namespace detail
}  // namespace haptic
