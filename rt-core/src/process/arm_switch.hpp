// Arm switch: the act of a person that arms a disarmed loop, by a key, a command or a button of the board.
//
// The loop awaits the act; any thread may report it. An act counts only while it is awaited, so that a key typed or a
// button held earlier arms nothing.
#pragma once

#include <atomic>
#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic::rt {

/// Where the act came from.
enum class ArmedBy : std::uint8_t { Key, Command, Button };

[[nodiscard]] constexpr const char* describe(ArmedBy by) noexcept {
    switch (by) {
        case ArmedBy::Key:
            return "key";
        case ArmedBy::Command:
            return "command";
        case ArmedBy::Button:
            break;
    }
    return "button";
}

class ArmSwitch {
  public:
    /// By the loop: awaits an act from now on.
    void await() HAPTIC_RT { phase_.store(kAwaited); }
    /// By the loop: awaits it no longer. An act that was reported before stays.
    void give_up() HAPTIC_RT {
        std::uint8_t awaited = kAwaited;
        phase_.compare_exchange_strong(awaited, kIdle);
    }
    /// From any thread: a person acts. False if no act is awaited, or another one came first.
    bool press(ArmedBy by) HAPTIC_RT {
        std::uint8_t awaited = kAwaited;
        return phase_.compare_exchange_strong(awaited, static_cast<std::uint8_t>(kPressed + static_cast<int>(by)));
    }

    [[nodiscard]] bool awaited() const HAPTIC_RT { return phase_.load() == kAwaited; }
    [[nodiscard]] bool pressed() const HAPTIC_RT { return phase_.load() >= kPressed; }
    /// Origin of the act; valid once pressed().
    [[nodiscard]] ArmedBy by() const HAPTIC_RT { return static_cast<ArmedBy>(phase_.load() - kPressed); }

  private:
    // One variable, so that awaiting and acting cannot overlap.
    static constexpr std::uint8_t kIdle = 0;
    static constexpr std::uint8_t kAwaited = 1;
    static constexpr std::uint8_t kPressed = 2;  // + ArmedBy
    static_assert(std::atomic<std::uint8_t>::is_always_lock_free);
    std::atomic<std::uint8_t> phase_{kIdle};
};

/// A button that must be held for a time, after it was seen released: one that is stuck, taped down or wired the other
/// way round arms nothing.
class HeldButton {
  public:
    static constexpr std::int64_t kHoldNs = 1'000'000'000;  // ns, for which the button must be held
    static constexpr std::int64_t kMaxGapNs =
        50'000'000;  // ns, without a reading; after a longer one the hold restarts

    /// Takes a reading of the button. True once it has been held long enough.
    bool update(bool held, std::int64_t now_ns) HAPTIC_RT {
        const bool gap = now_ns - last_ns_ > kMaxGapNs;
        last_ns_ = now_ns;
        seen_released_ = seen_released_ || !held;
        if (!held || !seen_released_ || gap) {
            held_since_ns_ = now_ns;
        }
        return held && seen_released_ && now_ns - held_since_ns_ >= kHoldNs;
    }

  private:
    bool seen_released_ = false;
    std::int64_t held_since_ns_ = 0;
    std::int64_t last_ns_ = 0;
};

}  // namespace haptic::rt
