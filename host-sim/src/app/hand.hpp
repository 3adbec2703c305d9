// Device hand: the newest valid device state that rt-core published, as input for the simulation.
#pragma once

#include <cstdint>

#include "haptic/frames.hpp"
#include "haptic/ring.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

class DeviceHand {
  public:
    /// `initial` is the input until the first valid state.
    DeviceHand(RingReader<DeviceState>& states, const StepInput& initial) : states_(&states), input_(initial) {}

    /// Input of the step that begins at `time_ns`: the newest valid state. If that is older than kFreshNs, its pose
    /// with all buttons released.
    [[nodiscard]] StepInput at(std::int64_t time_ns, std::int64_t now_ns);

    /// The last call had a fresh state.
    [[nodiscard]] bool fresh() const noexcept { return fresh_; }
    /// When the encoders of the newest valid state were latched; 0: none yet.
    [[nodiscard]] std::int64_t latch_time_ns() const noexcept { return latest_ns_; }
    [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }
    [[nodiscard]] std::uint32_t safety_state() const noexcept { return safety_state_; }

    /// Maximum age of a fresh state: a hundred ticks of rt-core.
    static constexpr std::int64_t kFreshNs = 100'000'000;

  private:
    RingReader<DeviceState>* states_;
    StepInput input_;
    std::int64_t latest_ns_ = 0;
    bool fresh_ = false;
    std::uint64_t rejected_ = 0;
    std::uint32_t safety_state_ = 0;
};

/// Defect of a device state, or null. Valid: position and orientation finite, orientation of unit length.
[[nodiscard]] const char* find_defect(const DeviceState& state) noexcept;

}  // namespace haptic::sim
