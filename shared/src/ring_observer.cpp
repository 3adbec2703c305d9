#include "haptic/ring_observer.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "ring_memory.hpp"
#include "segment_checks.hpp"

namespace haptic::detail {

class ObservedSegment {
  public:
    /// Maps a checked segment read-only. Throws RingError.
    ObservedSegment(const SegmentChecks& checks, Descriptor fd, const struct stat& status)
        : fd_(std::move(fd)),
          device_(status.st_dev),
          inode_(status.st_ino),
          bytes_(RingMemory::bytes(checks.slot_bytes())) {
        void* const memory = mmap(nullptr, bytes_, PROT_READ, MAP_SHARED | MAP_POPULATE, fd_.get(), 0);
        if (memory == MAP_FAILED) {
            checks.fail_system("mapped", errno);
        }
        memory_ = RingMemory(memory, checks.slot_bytes());
    }
    ObservedSegment(const ObservedSegment&) = delete;
    ObservedSegment& operator=(const ObservedSegment&) = delete;
    ~ObservedSegment() { munmap(&memory_.header(), bytes_); }

    [[nodiscard]] const RingMemory& memory() const noexcept { return memory_; }
    /// Whether this is the same file. Its inode number is not reused while we keep it open.
    [[nodiscard]] bool is(const struct stat& status) const noexcept {
        return status.st_dev == device_ && status.st_ino == inode_;
    }
    [[nodiscard]] bool has_writer() const noexcept { return is_held_by_another(fd_.get(), RingLock::Writer, 1); }

  private:
    Descriptor fd_;
    dev_t device_;
    ino_t inode_;
    std::size_t bytes_;
    RingMemory memory_{nullptr, 0};
};

RingObserverBase::RingObserverBase(const std::string& session, RingKind kind, std::size_t slot_bytes)
    : session_(session), kind_(kind), slot_bytes_(slot_bytes) {
    static_cast<void>(ring_segment_name(session, kind));  // throws for a bad name
}

RingObserverBase::RingObserverBase(RingObserverBase&&) noexcept = default;
RingObserverBase& RingObserverBase::operator=(RingObserverBase&&) noexcept = default;
RingObserverBase::~RingObserverBase() = default;

void RingObserverBase::attend(std::int64_t now_ns) {
    if (now_ns < attend_at_ns_) {
        return;
    }
    attend_at_ns_ = now_ns + kRingAttendNs;
    problem_.clear();
    try {
        find_segment();
    } catch (const RingError& error) {
        leave();
        problem_ = error.what();
    }
}

void RingObserverBase::find_segment() {
    const SegmentChecks checks(session_, kind_, slot_bytes_);
    Descriptor fd(shm_open(checks.name().c_str(), O_RDONLY, 0));
    if (fd.get() < 0) {
        if (errno != ENOENT) {
            checks.refuse_unopened(errno);
        }
        // Removed by hand while its writer continues: keep observing the old segment.
        if (!has_writer()) {
            leave();
        }
        return;
    }
    checks.refuse_foreign(fd.get());
    struct stat status{};
    if (fstat(fd.get(), &status) != 0) {
        checks.fail_system("examined", errno);
    }
    if (segment_ != nullptr && segment_->is(status)) {
        return;
    }
    leave();
    if (status.st_size == 0) {
        return;  // it is being created
    }
    // Read the header with pread until it is known to be complete: before that, its creator may truncate the file, and
    // access to a mapping would be a bus error.
    alignas(RingHeader) std::array<std::byte, sizeof(RingHeader)> copy{};
    const auto size = static_cast<std::size_t>(status.st_size);
    checks.read_header(fd.get(), size, copy.data());
    const RingHeader& header = *reinterpret_cast<const RingHeader*>(copy.data());
    if (header.identity.magic.load() == 0) {
        return;  // it is being created
    }
    checks.refuse_other_layout(header, size);
    segment_ = std::make_unique<ObservedSegment>(checks, std::move(fd), status);
    // Start with the oldest slot that the ring still holds.
    const std::uint64_t head = segment_->memory().header().progress.head.load(std::memory_order_acquire);
    last_ = head > kRingSlots ? head - kRingSlots : 0;
    counts_.segments += 1;
}

void RingObserverBase::leave() noexcept {
    segment_.reset();
    last_ = 0;
}

RingPeer RingObserverBase::peer() const noexcept {
    return segment_ != nullptr ? segment_->memory().peer() : RingPeer{};
}

bool RingObserverBase::has_writer() const noexcept {
    return segment_ != nullptr && segment_->has_writer();
}

bool RingObserverBase::next_bytes(void* slot) noexcept {
    if (segment_ == nullptr) {
        return false;
    }
    const RingMemory& memory = segment_->memory();
    const std::uint64_t head = memory.header().progress.head.load(std::memory_order_acquire);
    if (head < last_ || head > kLastSequence) {
        // Writers never count backwards: the segment is damaged or was replaced. Detach; attend() checks it again.
        leave();
        return false;
    }
    // Skip the slots that the writer has overwritten.
    const std::uint64_t oldest = head >= kRingSlots ? head - kRingSlots + 1 : 1;
    std::uint64_t sequence = std::max(last_ + 1, oldest);
    counts_.missed += sequence - last_ - 1;
    for (; sequence <= head; ++sequence) {
        last_ = sequence;
        if (memory.read(sequence, slot)) {
            counts_.slots += 1;
            return true;
        }
        counts_.missed += 1;  // overwritten during the copy
    }
    return false;
}

}  // namespace haptic::detail
