#include "tick/recorder.hpp"

#include <algorithm>
#include <cstring>

#include "haptic/ring.hpp"

namespace haptic::rt {

BlackBox::BlackBox(std::size_t capacity) : records_(std::max<std::size_t>(capacity, 1)) {}

void BlackBox::push(const TickRecord& record) HAPTIC_RT {
    records_[next_] = record;
    next_ = next_ + 1 == records_.size() ? 0 : next_ + 1;
    size_ = size_ < records_.size() ? size_ + 1 : size_;
}

const TickRecord& BlackBox::at(std::size_t index) const HAPTIC_RT {
    const std::size_t oldest = size_ < records_.size() ? 0 : next_;
    return records_[(oldest + index) % records_.size()];
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
