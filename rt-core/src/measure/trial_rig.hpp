// Trial rig: the tick, the emulated board with its mechanics and the ring of the device states under a virtual clock,
// for the stability trials.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "haptic/device/emulated_board.hpp"
#include "haptic/ring.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

class TrialRig {
  public:
    struct Settings {
        std::string session;  // of the ring of device states
        TickSettings tick;
        PoseTrack hand;  // waits at its start until release_hand()
        device::GripMechanics mechanics;
    };

    /// `frames` must outlive the rig. Throws RingError, std::invalid_argument.
    TrialRig(const Settings& settings, FrameSource& frames);

    /// Runs ticks until the safety machine is Running, with the hand at the start of its track. Throws
    /// std::runtime_error after three times the nominal arming time.
    void arm();
    /// Runs one tick.
    void run_tick();
    void release_hand() { board_.device().release_hand(); }
    /// Moves grip and hand to the time of the next tick, whose exchange then leaves them there.
    void advance_grip() { board_.device().advance(now_ns_); }

    /// Time of the next tick.
    [[nodiscard]] std::int64_t now_ns() const noexcept { return now_ns_; }
    [[nodiscard]] Pose grip_pose() const { return board_.device().grip_pose(); }
    [[nodiscard]] Tick& tick() noexcept { return tick_; }

  private:
    std::int64_t period_ns_;
    std::int64_t arming_ns_;
    device::EmulatedBoard board_;
    RingWriter<DeviceState> states_;
    Tick tick_;
    std::int64_t now_ns_ = 0;
};

/// A session name that no other trial of this machine uses at the same time.
[[nodiscard]] std::string unique_session();

/// Peak-to-peak amplitude of equidistant samples after removing their least-squares line, because a slow drift is no
/// vibration. 0 for fewer than three samples.
[[nodiscard]] double amplitude_of(std::span<const double> values);

}  // namespace haptic::rt
