#include "haptic/rt/recorder.hpp"

namespace haptic::rt {

void BlackBox::push(const TickRecord& record) HAPTIC_RT {
    records_[next_] = record;
    next_ = next_ + 1 == records_.size() ? 0 : next_ + 1;
    size_ = size_ < records_.size() ? size_ + 1 : size_;
}

const TickRecord& BlackBox::at(std::size_t index) const HAPTIC_RT {
    const std::size_t oldest = size_ < records_.size() ? 0 : next_;
    return records_[(oldest + index) % records_.size()];
}

void Recorder::push(const TickRecord& record) HAPTIC_RT {
    const std::uint64_t head = head_.load(std::memory_order_relaxed);  // only this thread writes it
    // acquire: the reader has finished copying out of the slots that it gives back.
    if (head - tail_.load(std::memory_order_acquire) == records_.size()) {
        dropped_.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    records_[head & (records_.size() - 1)] = record;
    head_.store(head + 1, std::memory_order_release);  // the record before the index that shows it
}

bool Recorder::pop(TickRecord& record) HAPTIC_RT {
    const std::uint64_t tail = tail_.load(std::memory_order_relaxed);  // only this thread writes it
    if (tail == head_.load(std::memory_order_acquire)) {
        return false;
    }
    record = records_[tail & (records_.size() - 1)];
    tail_.store(tail + 1, std::memory_order_release);
    return true;
}

}  // namespace haptic::rt
