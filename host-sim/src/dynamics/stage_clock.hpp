// Stage clock: the time that a part of the step takes, on the caller's clock. The simulation does not depend on it.
#pragma once

#include <cstdint>
#include <utility>

namespace haptic::sim {

class StageClock {
  public:
    /// Monotonic clock, ns.
    using Function = std::int64_t (*)();
    /// Without a clock no time passes.
    explicit StageClock(Function clock) : clock_(clock) {}

    /// Adds its lifetime to the time spent.
    class Span {
      public:
        explicit Span(StageClock& clock) : clock_(clock), since_(clock.now()) {}
        Span(const Span&) = delete;
        Span& operator=(const Span&) = delete;
        ~Span() { clock_.spent_ns_ += clock_.now() - since_; }

      private:
        StageClock& clock_;
        std::int64_t since_;
    };

    /// ns, spent since the last call.
    std::int64_t take() noexcept { return std::exchange(spent_ns_, 0); }

  private:
    [[nodiscard]] std::int64_t now() const { return clock_ == nullptr ? 0 : clock_(); }

    Function clock_;
    std::int64_t spent_ns_ = 0;
};

}  // namespace haptic::sim
