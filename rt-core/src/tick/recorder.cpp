#include "tick/recorder.hpp"

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>
#include <type_traits>

#include "haptic/ring.hpp"

namespace haptic::rt {
namespace {

constexpr std::uint64_t kMagic = 0x786f426b63616c42;  // "BlackBox"
constexpr std::uint32_t kLayout = 3;                  // increment with each change of TickRecord or Head
static_assert(std::is_trivially_copyable_v<TickRecord>, "records are read back from a file");
static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "another process reads it");

}  // namespace

BlackBox::BlackBox(std::size_t capacity)
    : own_(bytes(std::max<std::size_t>(capacity, 1))), capacity_(std::max<std::size_t>(capacity, 1)) {
    store_in(own_);
}

BlackBox::BlackBox(std::span<std::byte> left) {
    auto* const head = reinterpret_cast<Head*>(left.data());
    if (left.size() < sizeof(Head) || head->magic != kMagic || head->layout != kLayout ||
        head->record_bytes != sizeof(TickRecord)) {
        throw std::runtime_error("is not a black box of this version of rt-core");
    }
    if (head->capacity == 0 || head->capacity > (left.size() - sizeof(Head)) / sizeof(TickRecord)) {
        throw std::runtime_error("is a black box that was cut short");
    }
    head_ = head;
    records_ = reinterpret_cast<TickRecord*>(left.data() + sizeof(Head));
    capacity_ = head->capacity;
    // The process may have ended while it overwrote the oldest record.
    torn_ = head_->pushed.load(std::memory_order_acquire) >= capacity_ ? 1 : 0;
}

std::size_t BlackBox::bytes(std::size_t capacity) noexcept {
    return sizeof(Head) + capacity * sizeof(TickRecord);
}

void BlackBox::store_in(std::span<std::byte> memory) {
    if (memory.size() < bytes(capacity_)) {
        throw std::invalid_argument("BlackBox: too little memory");
    }
    head_ = new (memory.data()) Head{kMagic, kLayout, sizeof(TickRecord), capacity_, {0}, 0};
    records_ = new (memory.data() + sizeof(Head)) TickRecord[capacity_];
}

void BlackBox::push(const TickRecord& record) HAPTIC_RT {
    const std::uint64_t pushed = head_->pushed.load(std::memory_order_relaxed);  // only this thread writes it
    records_[pushed % capacity_] = record;
    if (head_->armed_ns == 0 && (record.requests & kRequestArm) != 0) {
        head_->armed_ns = record.now_ns;
    }
    // Release: whoever reads the memory after this process has ended finds the record complete.
    head_->pushed.store(pushed + 1, std::memory_order_release);
}

std::size_t BlackBox::size() const HAPTIC_RT {
    return std::min<std::uint64_t>(head_->pushed.load(std::memory_order_relaxed), capacity_) - torn_;
}

const TickRecord& BlackBox::at(std::size_t index) const HAPTIC_RT {
    const std::uint64_t pushed = head_->pushed.load(std::memory_order_relaxed);
    const std::uint64_t oldest = pushed < capacity_ ? 0 : pushed % capacity_;
    return records_[(oldest + torn_ + index) % capacity_];
}

std::int64_t BlackBox::start_ns() const HAPTIC_RT {
    return head_->armed_ns != 0 || size() == 0 ? head_->armed_ns : at(0).now_ns;
}

Recorder::Recorder(std::size_t tick_capacity, std::size_t frame_capacity)
    : ticks_(tick_capacity), frames_(frame_capacity) {}

void Recorder::push(const TickRecord& record) HAPTIC_RT {
    if (TickRecord* const slot = ticks_.claim()) {
        *slot = record;
        ticks_.commit();
    }
}

bool Recorder::pop(TickRecord& record) HAPTIC_RT {
    const TickRecord* const oldest = ticks_.front();
    if (oldest == nullptr) {
        return false;
    }
    record = *oldest;
    ticks_.release();
    return true;
}

void Recorder::push(std::int64_t now_ns, FrameDefect defect, const ContactFrame& frame) HAPTIC_RT {
    if (RecordedFrame* const slot = frames_.claim()) {
        slot->now_ns = now_ns;
        slot->defect = defect;
        std::memcpy(&slot->frame, &frame, detail::used_bytes(frame));
        frames_.commit();
    }
}

}  // namespace haptic::rt
