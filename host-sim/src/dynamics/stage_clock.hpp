// Stage clock: the time that a part of the step takes of the thread that makes the step, on the caller's clock. What
// other threads do meanwhile is none of it. The simulation does not depend on it.
#pragma once

#include <cstdint>
#include <thread>
#include <utility>

namespace haptic::sim {

class StageClock {
  public:
    /// Monotonic clock, ns.
    using Function = std::int64_t (*)();
    /// Without a clock no time passes.
    explicit StageClock(Function clock) : clock_(clock) {}

    /// Adds its lifetime to the time spent, on the thread that has called take() last, or before that has made the
    /// clock.
    class Span {
      public:
        explicit Span(StageClock& clock) : clock_(clock), since_(clock.now()) {}
        Span(const Span&) = delete;
        Span& operator=(const Span&) = delete;
        ~Span() {
            if (std::this_thread::get_id() == clock_.owner_) {
                clock_.spent_ns_ += clock_.now() - since_;
            }
        }

      private:
        StageClock& clock_;
        std::int64_t since_;
    };

    /// ns, spent since the last call.
    std::int64_t take() noexcept {
        owner_ = std::this_thread::get_id();
        return std::exchange(spent_ns_, 0);
    }

  private:
    [[nodiscard]] std::int64_t now() const { return clock_ == nullptr ? 0 : clock_(); }

    Function clock_;
    std::int64_t spent_ns_ = 0;
    std::thread::id owner_ = std::this_thread::get_id();
};

}  // namespace haptic::sim
