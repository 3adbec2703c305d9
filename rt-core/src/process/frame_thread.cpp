#include "process/frame_thread.hpp"

#include <bit>
#include <utility>

#include "haptic/clock.hpp"
#include "haptic/denormals.hpp"
#include "process/crash_guard.hpp"
#include "process/loop.hpp"
#include "process/realtime_setup.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {

FrameThread::FrameThread(const FrameThreadSettings& settings, FrameSource& source)
    : settings_(settings), source_(&source), buffers_{} {
    for (std::size_t i = 0; i < kBuffers; ++i) {
        owned_[i] = std::make_unique<PreparedFrame>();
        buffers_[i] = owned_[i].get();
    }
    thread_ = create_thread(&FrameThread::thread_entry, this, kSideStackBytes, "creating the frame thread");
}

FrameThread::~FrameThread() {
    stopping_.store(true);
    pthread_join(thread_, nullptr);
}

bool FrameThread::take(PreparedFrame*& inbox, std::int64_t deadline_ns) HAPTIC_RT {
    deadline_ns_.store(deadline_ns, std::memory_order_relaxed);
    if ((between_.load(std::memory_order_relaxed) & kIsNew) == 0) {
        return false;
    }
    // Only this side clears the bit, so that what lies there now is new too, if another one.
    taken_ = between_.exchange(taken_, std::memory_order_acq_rel) & ~kIsNew;
    std::swap(inbox, buffers_[taken_]);
    return true;
}

void FrameThread::expect(const FrameStart& start) HAPTIC_RT {
    const auto words = std::bit_cast<std::array<std::uint64_t, kStartWords>>(start);
    for (std::size_t i = 0; i < words.size(); ++i) {
        start_[i].store(words[i], std::memory_order_relaxed);
    }
}

void* FrameThread::thread_entry(void* self) {
    const AlternateSignalStack signal_stack;
    const FlushDenormals flush;  // as the loop: a replay prepares the same bits in its tick
    auto* const frames = static_cast<FrameThread*>(self);
    [[maybe_unused]] const int granted = prepare_side_thread(frames->settings_.priority, frames->settings_.loop_cpu);
    frames->run();
    return nullptr;
}

void FrameThread::run() {
    while (!stopping_.load()) {
        // The next middle between two deadlines.
        const std::int64_t last_ns = deadline_ns_.load(std::memory_order_relaxed) - settings_.period_ns / 2;
        sleep_until(next_deadline(last_ns, settings_.period_ns, monotonic_now_ns()).deadline_ns);
        prepare_newest();
    }
}

void FrameThread::prepare_newest() {
    PreparedFrame& next = *buffers_[filled_];
    if (!source_->read_newest(next.frame)) {
        return;
    }
    next.prepare();
    std::array<std::uint64_t, kStartWords> words{};
    for (std::size_t i = 0; i < words.size(); ++i) {
        words[i] = start_[i].load(std::memory_order_relaxed);
    }
    previewer_.preview_ahead(next, std::bit_cast<FrameStart>(words));
    filled_ = between_.exchange(filled_ | kIsNew, std::memory_order_acq_rel) & ~kIsNew;
}

}  // namespace haptic::rt
