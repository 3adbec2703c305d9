#include "haptic/ring.hpp"

#include <sys/random.h>

#include <cerrno>
#include <system_error>

#include "ring_segment.hpp"

namespace haptic::detail {
namespace {

/// Random number that identifies an attachment; never 0.
std::uint64_t new_session_id() {
    std::uint64_t id = 0;
    while (id == 0) {
        if (getrandom(&id, sizeof id, 0) != static_cast<ssize_t>(sizeof id) && errno != EINTR) {
            throw RingError(RingError::Kind::System,
                            "no random session id available: " + std::generic_category().message(errno));
        }
    }
    return id;
}

}  // namespace

RingWriterBase::RingWriterBase(const std::string& session, RingKind kind, std::size_t slot_bytes)
    : segment_(std::make_unique<RingSegment>(session, kind, slot_bytes, RingLock::Writer)), session_(new_session_id()) {
    RingHeader& ring = segment_->memory().header();
    // Continue after the last complete frame. A frame that a killed writer had started is rewritten under the same
    // number: `head` had not reached it, so no reader has read it. Acquire pairs with the release in publish().
    next_ = ring.progress.head.load(std::memory_order_acquire) + 1;
    // `session` last, with release: a reader that sees the new session also sees the reset heartbeat and `closed`.
    ring.progress.heartbeat_ns.store(0, std::memory_order_release);
    ring.presence.closed.store(0, std::memory_order_release);
    ring.presence.session.store(session_, std::memory_order_release);
}

RingWriterBase::RingWriterBase(RingWriterBase&&) noexcept = default;
RingWriterBase& RingWriterBase::operator=(RingWriterBase&&) noexcept = default;

RingWriterBase::~RingWriterBase() {
    if (segment_ != nullptr) {
        // Release: a reader that sees `closed` also sees the last frame.
        segment_->memory().header().presence.closed.store(1, std::memory_order_release);
    }
}

void RingWriterBase::beat(std::int64_t now_ns) HAPTIC_RT {
    segment_->memory().header().progress.heartbeat_ns.store(now_ns, std::memory_order_release);
}

std::uint64_t RingWriterBase::publish_bytes(const void* frame, std::size_t bytes, std::int64_t now_ns) HAPTIC_RT {
    segment_->memory().publish(next_, frame, bytes, now_ns);
    return next_++;
}

RingReaderBase::RingReaderBase(const std::string& session, RingKind kind, std::size_t slot_bytes)
    : segment_(std::make_unique<RingSegment>(session, kind, slot_bytes, RingLock::Reader)) {}

RingReaderBase::RingReaderBase(RingReaderBase&&) noexcept = default;
RingReaderBase& RingReaderBase::operator=(RingReaderBase&&) noexcept = default;
RingReaderBase::~RingReaderBase() = default;

RingPeer RingReaderBase::peer() const HAPTIC_RT {
    return segment_->memory().peer();
}

bool RingReaderBase::read_newest_bytes(void* frame) HAPTIC_RT {
    const RingMemory::Read read = segment_->memory().read_newest(last_, frame);
    counts_.overtaken += read.overtaken;
    if (read.sequence == 0) {
        return false;
    }
    // Frames before the first one that is read do not count as skipped.
    counts_.skipped += last_ == 0 ? 0 : read.sequence - last_ - 1;
    counts_.frames += 1;
    last_ = read.sequence;
    return true;
}

}  // namespace haptic::detail
