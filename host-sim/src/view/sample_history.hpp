// Sample history: the newest step samples of a run, numbered, so that each viewer reads them at its own pace.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "view/snapshot.hpp"

namespace haptic::sim::view {

/// A sample of a scene and its number, which also counts dropped samples.
struct NumberedSample {
    std::uint32_t scene = 0;
    std::uint64_t number = 0;
    StepSample sample;
};

class SampleHistory {
  public:
    static constexpr std::size_t kCapacity = 8192;

    /// Numbers must increase; a gap means dropped samples.
    void add(const NumberedSample& sample);

    /// Removes all samples.
    void clear() noexcept;

    /// Consecutive samples.
    struct Run {
        std::uint64_t number = 0;  // of the first
        std::vector<StepSample> samples;
    };
    /// The first consecutive samples from `number` on, at most `max_count`; empty if there are none.
    [[nodiscard]] Run from(std::uint64_t number, std::size_t max_count) const;

    /// The number after the newest.
    [[nodiscard]] std::uint64_t end() const noexcept { return end_; }

  private:
    std::vector<NumberedSample> ring_;  // when full, the oldest is at begin_
    std::size_t begin_ = 0;
    std::uint64_t end_ = 0;
};

}  // namespace haptic::sim::view
