#include "ring_segment.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <string_view>
#include <thread>

namespace haptic {
namespace {

using detail::RingLock;

constexpr mode_t kPrivate = S_IRUSR | S_IWUSR;
constexpr std::chrono::milliseconds kChangeLockTimeout{2000};
constexpr std::chrono::milliseconds kChangeLockPause{1};

std::string_view role_name(RingLock role) {
    return role == RingLock::Writer ? "writer" : "reader";
}

struct flock lock_request(RingLock byte, int type) {
    struct flock request{};
    request.l_type = static_cast<short>(type);
    request.l_whence = SEEK_SET;
    request.l_start = static_cast<off_t>(byte);
    request.l_len = 1;
    return request;
}

/// Takes an open-file-description lock on one byte. Returns false if it is held or on another failure; see errno.
bool try_lock(int fd, RingLock byte) {
    struct flock request = lock_request(byte, F_WRLCK);
    return fcntl(fd, F_OFD_SETLK, &request) == 0;
}

/// Takes the change lock by polling with a time limit: a stopped process that holds the lock must not block us forever.
bool lock_change(int fd) {
    const auto deadline = std::chrono::steady_clock::now() + kChangeLockTimeout;
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

namespace detail {

RingSegment::RingSegment(const std::string& session, RingKind kind, std::size_t slot_bytes, RingLock role)
    : checks_(session, kind, slot_bytes), role_(role) {
    // All under the change lock, which is released at the end.
    fd_ = open_and_lock();
    make_valid(fd_.get());
    take_role(fd_.get());
    memory_ = RingMemory(map(fd_.get()), checks_.slot_bytes());
    // Publish the pid, which names this process to another one that asks for the role.
    own_pid().store(static_cast<std::uint32_t>(getpid()), std::memory_order_release);
    struct flock request = lock_request(RingLock::Change, F_UNLCK);
    fcntl(fd_.get(), F_OFD_SETLK, &request);
}

RingSegment::~RingSegment() {
    own_pid().store(0, std::memory_order_release);
    // The mapping ends; the descriptor still holds the locks.
    munmap(&memory_.header(), RingMemory::bytes(checks_.slot_bytes()));
    const RingLock other = role_ == RingLock::Writer ? RingLock::Reader : RingLock::Writer;
    // Closing the descriptor releases the role and the change lock in one step: of two processes that leave at the same
    // time, the second finds the first gone. A segment without a name (removed by hand) must not be removed again,
    // because the name may belong to a new segment. If the lock is not available, the next session removes the segment.
    if (lock_change(fd_.get()) && !is_held_by_another(fd_.get(), other, 1) && status_of(fd_.get()).st_nlink != 0) {
        shm_unlink(checks_.name().c_str());
    }
}

std::atomic<std::uint32_t>& RingSegment::own_pid() const noexcept {
    RingPresence& presence = memory_.header().presence;
    return role_ == RingLock::Writer ? presence.writer_pid : presence.reader_pid;
}

/// Opens the segment, takes the change lock, and checks that the name still refers to it.
Descriptor RingSegment::open_and_lock() const {
    while (true) {
        // shm_open adds O_NOFOLLOW and O_CLOEXEC.
        Descriptor fd(shm_open(checks_.name().c_str(), O_RDWR | O_CREAT, kPrivate));
        if (fd.get() < 0) {
            checks_.refuse_unopened(errno);
        }
        // Refuse a segment that another user owns or can access: its contents could change at any time.
        checks_.refuse_foreign(fd.get());
        if (!lock_change(fd.get())) {
            checks_.fail(RingError::Kind::System,
                         "is locked by a process that is creating or removing it" + checks_.removal());
        }
        // The last process to leave may have removed the segment between open and lock: then retry.
        if (status_of(fd.get()).st_nlink != 0) {
            return fd;
        }
    }
}

/// Ensures a complete segment of our layout: creates it, repairs one whose creator crashed, refuses any other.
void RingSegment::make_valid(int fd) const {
    // Empty: just created by shm_open.
    const auto size = static_cast<std::size_t>(status_of(fd).st_size);
    if (size == 0) {
        create(fd);
        return;
    }
    // Read the header without mapping it: access beyond the end of a short file is a bus error.
    alignas(RingHeader) std::array<std::byte, sizeof(RingHeader)> copy{};
    checks_.read_header(fd, size, copy.data());
    const RingHeader& header = *reinterpret_cast<const RingHeader*>(copy.data());
    if (header.identity.magic.load() == 0 && !is_held_by_another(fd, RingLock::Writer, 2)) {
        // Its creator died before the header was complete: magic is stored last, so nobody has attached.
        create(fd);
        return;
    }
    checks_.refuse_other_layout(header, size);
}

void RingSegment::create(int fd) const {
    // Allocate all pages now: if memory ran out later, writing to a hole would be a bus error in the tick.
    const auto size = static_cast<off_t>(RingMemory::bytes(checks_.slot_bytes()));
    const int error = ftruncate(fd, 0) != 0 ? errno : posix_fallocate(fd, 0, size);
    if (error != 0) {
        shm_unlink(checks_.name().c_str());
        checks_.fail_system("given " + std::to_string(size) + " bytes", error);
    }
    // Readable and writable for this user only.
    if (fchmod(fd, kPrivate) != 0) {  // in case the umask removed our own permissions
        checks_.fail_system("made private", errno);
    }
    // Write the header; its magic comes last and makes the segment valid.
    void* const memory = map(fd);
    RingMemory(memory, checks_.slot_bytes()).initialise(checks_.kind());
    munmap(memory, static_cast<std::size_t>(size));
}

void RingSegment::take_role(int fd) const {
    if (try_lock(fd, role_)) {
        return;
    }
    // Any failure other than a held lock is an error of the system.
    if (errno != EAGAIN && errno != EACCES) {
        checks_.fail_system("locked", errno);
    }
    // Taken: name the process that has it.
    const std::size_t offset = role_ == RingLock::Writer ? offsetof(RingHeader, presence.writer_pid)
                                                         : offsetof(RingHeader, presence.reader_pid);
    // Read with pread: the segment is not mapped yet.
    std::uint32_t pid = 0;
    if (pread(fd, &pid, sizeof pid, static_cast<off_t>(offset)) != static_cast<ssize_t>(sizeof pid)) {
        pid = 0;
    }
    checks_.fail(RingError::Kind::RoleTaken, "already has its " + std::string(role_name(role_)) + ": process " +
                                                 std::to_string(pid) + " runs session \"" + checks_.session() +
                                                 "\"; end it (kill " + std::to_string(pid) +
                                                 ") or use another session name");
}

void* RingSegment::map(int fd) const {
    // MAP_POPULATE: no page faults in the tick.
    void* const memory = mmap(nullptr, RingMemory::bytes(checks_.slot_bytes()), PROT_READ | PROT_WRITE,
                              MAP_SHARED | MAP_POPULATE, fd, 0);
    if (memory == MAP_FAILED) {
        checks_.fail_system("mapped", errno);
    }
    return memory;
}

}  // namespace detail
}  // namespace haptic
