// Heartbeat of the loop for other threads, and the hand-over of a hanging tick's records.
#pragma once

#include <atomic>
#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic::rt {

/// Counter that increases once a tick while a loop runs.
class Heartbeat {
  public:
    /// To be called by the loop's thread.
    void begin() HAPTIC_RT { beats_.store(1, std::memory_order_release); }
    void beat() HAPTIC_RT { beats_.fetch_add(beats() > 0 ? 1 : 0, std::memory_order_release); }
    void end() HAPTIC_RT { beats_.store(0, std::memory_order_release); }

    /// From any thread. 0: no loop is running.
    [[nodiscard]] std::uint64_t beats() const HAPTIC_RT { return beats_.load(std::memory_order_acquire); }

  private:
    std::atomic<std::uint64_t> beats_{0};
};

/// Detects that a heartbeat has stopped, from periodic checks.
class StallDetector {
  public:
    /// Punctual checks in a row without a new beat after which the loop counts as stalled.
    static constexpr int kChecks = 4;

    /// Takes one check and returns true if the loop has stalled. late: the check itself came an interval late or more.
    /// The checking thread was then not running either (process stopped, machine overloaded), so the check proves
    /// nothing.
    bool stalled(std::uint64_t beats, bool late) noexcept {
        if (beats == 0 || beats != last_) {
            silent_ = 0;
        } else if (!late) {
            ++silent_;
        }
        last_ = beats;
        return silent_ >= kChecks;
    }

  private:
    std::uint64_t last_ = 0;
    int silent_ = 0;
};

/// Ownership of a tick's records. The tick's thread owns them, except during an exchange with the board, where it can
/// hang; another thread may then take them, permanently.
class RecordOwner {
  public:
    /// By the tick's thread, before and after an exchange. reclaim() returns false if they were taken meanwhile.
    void lend() HAPTIC_RT { holder_.store(Holder::Nobody, std::memory_order_release); }
    [[nodiscard]] bool reclaim() HAPTIC_RT {
        Holder nobody = Holder::Nobody;
        return holder_.compare_exchange_strong(nobody, Holder::Tick, std::memory_order_acquire);
    }
    /// By another thread. Returns false while the tick's thread owns them.
    [[nodiscard]] bool take() HAPTIC_RT {
        Holder nobody = Holder::Nobody;
        return holder_.compare_exchange_strong(nobody, Holder::Taken, std::memory_order_acquire);
    }

  private:
    enum class Holder : std::uint8_t { Tick, Nobody, Taken };
    std::atomic<Holder> holder_{Holder::Tick};
};

}  // namespace haptic::rt
