// Frame thread: reads and prepares contact frames ahead of the tick, in the middle of each period.
//
// A large elastic tool's frame takes several times as long to read, check and lay out as to render. Here that happens
// on another processor if there is one, and at one priority below the loop's, so that a tick only exchanges a pointer.
// The thread also evaluates the frame where the last tick ended, which the renderer needs for a start without a step.
// A frame waits half a period longer in the mean. If the thread is late, the tick keeps rendering the frame that it
// has; if it hangs, frames grow stale and their force fades.
//
// Three buffers go round: the thread fills one, the tick has one, and the newest lies between them. Neither side waits.
#pragma once

#include <pthread.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "rendering/tool_contact.hpp"
#include "tick/frame_intake.hpp"

namespace haptic::rt {

struct FrameThreadSettings {
    std::int64_t period_ns = 1'000'000;  // ns, of the loop
    int priority = 79;                   // SCHED_FIFO; a refusal is ignored
    int loop_cpu = -1;                   // processor to avoid, as LoopSettings::cpu
};

class FrameThread final : public FrameIntake {
  public:
    /// Starts reading at once. The source must outlive the thread, and nothing else may read it. Throws
    /// std::system_error if the thread cannot be created.
    FrameThread(const FrameThreadSettings& settings, FrameSource& source);
    FrameThread(const FrameThread&) = delete;
    FrameThread& operator=(const FrameThread&) = delete;
    /// Waits for the end of the current period at most. To be called after the last tick, and before the tick is
    /// destroyed: each may hold buffers that the other one frees.
    ~FrameThread() override;

    /// From one thread only, that of the tick.
    [[nodiscard]] bool take(PreparedFrame*& inbox, std::int64_t deadline_ns) HAPTIC_RT override;
    /// From the same thread.
    void expect(const FrameStart& start) HAPTIC_RT override;

  private:
    static constexpr std::size_t kBuffers = 3;
    // Index of the buffer in between, with this bit if the tick has not taken it.
    static constexpr unsigned kIsNew = 4;

    static constexpr std::size_t kStartWords = sizeof(FrameStart) / sizeof(std::uint64_t);
    static_assert(std::is_trivially_copyable_v<FrameStart> && sizeof(FrameStart) % sizeof(std::uint64_t) == 0);

    static void* thread_entry(void* self);
    void run();
    void prepare_newest();

    FrameThreadSettings settings_;
    FrameSource* source_;
    std::array<std::unique_ptr<PreparedFrame>, kBuffers> owned_;
    std::array<PreparedFrame*, kBuffers> buffers_;  // each is exchanged for the tick's inbox when it is taken
    std::atomic<unsigned> between_{1};
    unsigned filled_ = 0;                       // the thread's own
    unsigned taken_ = 2;                        // the tick's own
    ToolContact previewer_;                     // the thread's own
    std::atomic<std::int64_t> deadline_ns_{0};  // of a tick
    // FrameStart of a tick. A mixture of two ticks is no harm: the tick sees that the preview is not from its start.
    std::array<std::atomic<std::uint64_t>, kStartWords> start_{};
    std::atomic<bool> stopping_{false};
    pthread_t thread_{};
};

}  // namespace haptic::rt
