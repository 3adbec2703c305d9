// Signs of life of the loop, and what else other threads may say to a tick or take from it.
#pragma once

#include <atomic>
#include <cstdint>

#include <haptic/realtime.hpp>

namespace haptic::rt {

/// Beats once a tick while a loop runs.
class Heartbeat {
  public:
    /// The loop's thread.
    void begin() HAPTIC_RT { beats_.store(1, std::memory_order_release); }
    void beat() HAPTIC_RT { beats_.fetch_add(beats() > 0 ? 1 : 0, std::memory_order_release); }
    void end() HAPTIC_RT { beats_.store(0, std::memory_order_release); }

    /// Any thread. 0: no loop runs.
    [[nodiscard]] std::uint64_t beats() const HAPTIC_RT { return beats_.load(std::memory_order_acquire); }

  private:
    std::atomic<std::uint64_t> beats_{0};
};

/// Judges from one look at a heartbeat to the next whether it has stopped.
class SilenceJudge {
  public:
    /// Looks that come in time and see nothing new until silence counts as death.
    static constexpr int kLooks = 4;

    /// late: the look itself came an interval late or more. Then the one who looks did not run either (the process was
    /// stopped, the machine is overloaded), and that nothing has happened since proves nothing.
    bool dead(std::uint64_t beats, bool late) noexcept {
        if (beats == 0 || beats != last_) {
            silent_ = 0;
        } else if (!late) {
            ++silent_;
        }
        last_ = beats;
        return silent_ >= kLooks;
    }

  private:
    std::uint64_t last_ = 0;
    int silent_ = 0;
};

/// Whose the records of a tick are. The tick's thread owns them, but not while it is within an exchange with the board,
/// which is where it can hang; then another thread may take them, for good.
class RecordOwner {
  public:
    /// The tick's thread, before and after an exchange. reclaim() is false if they were taken meanwhile.
    void lend() HAPTIC_RT { holder_.store(Holder::Nobody, std::memory_order_release); }
    [[nodiscard]] bool reclaim() HAPTIC_RT {
        Holder nobody = Holder::Nobody;
        return holder_.compare_exchange_strong(nobody, Holder::Tick, std::memory_order_acquire);
    }
    /// Another thread. False if the tick's thread has them.
    [[nodiscard]] bool take() HAPTIC_RT {
        Holder nobody = Holder::Nobody;
        return holder_.compare_exchange_strong(nobody, Holder::Taken, std::memory_order_acquire);
    }

  private:
    enum class Holder : std::uint8_t { Tick, Nobody, Taken };
    std::atomic<Holder> holder_{Holder::Tick};
};

}  // namespace haptic::rt
