// The newest samples of a run, by number, for viewers that each take them at their own pace.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "view/snapshot.hpp"

namespace haptic::sim::view {

/// A sample of a scene, and how many there were before it, kept or not.
struct NumberedSample {
    std::uint32_t scene = 0;
    std::uint64_t number = 0;
    StepSample sample;
};

class SampleHistory {
  public:
    static constexpr std::size_t kCapacity = 8192;

    /// Their numbers rise; where they do not follow one another, some were dropped.
    void add(const NumberedSample& sample);

    /// Forgets them all.
    void clear() noexcept;

    /// Samples that follow one another.
    struct Run {
        std::uint64_t number = 0;  // of the first
        std::vector<StepSample> samples;
    };
    /// The oldest ones from `number` on, at most `most` of them; empty if there are none.
    [[nodiscard]] Run from(std::uint64_t number, std::size_t most) const;

    /// The number after the newest.
    [[nodiscard]] std::uint64_t end() const noexcept { return end_; }

  private:
    std::vector<NumberedSample> ring_;  // once it is full, the oldest is at begin_
    std::size_t begin_ = 0;
    std::uint64_t end_ = 0;
};

}  // namespace haptic::sim::view
