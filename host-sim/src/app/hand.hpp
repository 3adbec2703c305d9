// Where a real-time run has its device pose from: the newest state that rt-core published and that can be believed.
#pragma once

#include <cstdint>

#include <haptic/frames.hpp>
#include <haptic/ring.hpp>
#include <haptic/sim/simulation.hpp>

namespace haptic::sim {

class DeviceHand {
  public:
    /// The hand is where `initial` says until a state comes.
    DeviceHand(RingReader<DeviceState>& states, const StepInput& initial) : states_(&states), input_(initial) {}

    /// The input of the step that begins at `time_ns`: the newest valid state not older than kFreshNs, otherwise the
    /// pose of the last step.
    [[nodiscard]] StepInput at(std::int64_t time_ns, std::int64_t now_ns);

    /// Whether the last call found a fresh state.
    [[nodiscard]] bool fresh() const noexcept { return fresh_; }
    [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }
    [[nodiscard]] std::uint32_t safety_state() const noexcept { return safety_state_; }

    /// Older than this, a state says nothing of where the hand is now: a hundred ticks of rt-core.
    static constexpr std::int64_t kFreshNs = 100'000'000;

  private:
    RingReader<DeviceState>* states_;
    StepInput input_;
    std::int64_t latest_ns_ = 0;
    bool fresh_ = false;
    std::uint64_t rejected_ = 0;
    std::uint32_t safety_state_ = 0;
};

/// What is wrong with a device state, or null: position and orientation finite, the orientation of unit length.
[[nodiscard]] const char* find_defect(const DeviceState& state) noexcept;

}  // namespace haptic::sim
