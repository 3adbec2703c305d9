// String encoders: string lengths from the wrapping counters of the board.
//
// A board counts modulo 2^16 or 2^24 and never resets its counters. The host unwraps them by the nearest difference.
// Lengths are relative: calibrate() declares that the present counts belong to the rest lengths, that is, to the grip
// held level at the centre.
// @source device-facts, section 2.3 (SH4 board), 3 (calibration).
#pragma once

#include <array>
#include <cstdint>

#include "device/kinematics.hpp"
#include "haptic/device/device_geometry.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::rt {

using RawCounters = std::array<std::uint32_t, kStrings>;  // modulo 2^counter_bits

class StringEncoders {
  public:
    /// maximum_speed: m/s, fastest string that a hand can cause; about 2.
    StringEncoders(const device::DeviceGeometry& geometry, double maximum_speed);

    /// Takes one latch of all counters, elapsed_ns after the last accepted one. Returns false if a string moved faster
    /// than maximum_speed. The string lengths are then unknown: this latch and all later ones are rejected, and
    /// lengths() does not change, until restart().
    bool update(const RawCounters& raw, std::int64_t elapsed_ns) HAPTIC_RT;

    /// Accepts the next latch unconditionally, as a calibration.
    void restart() HAPTIC_RT;

    /// Declares the present counts those of the rest lengths.
    void calibrate() HAPTIC_RT;

    /// m. The first latch counts as a calibration, so that a pose exists at once; it is meaningless until calibrate().
    [[nodiscard]] const StringArray& lengths() const HAPTIC_RT { return lengths_; }

    /// Bit i: string i moved too fast in the latch that was rejected first.
    [[nodiscard]] std::uint8_t jumped() const HAPTIC_RT { return jumped_; }

    /// m, largest movement of a string since the last mark(): tells whether the grip is held still.
    [[nodiscard]] double largest_movement() const HAPTIC_RT;
    void mark() HAPTIC_RT { marked_ = counts_; }

  private:
    using Counts = std::array<std::int64_t, kStrings>;

    double maximum_speed_;
    unsigned unused_bits_;            // high bits of 32 that the counter does not have
    StringArray metres_per_count_{};  // signed
    StringArray rest_lengths_{};
    StringArray lengths_{};
    Counts counts_{};  // unwrapped
    Counts offsets_{};
    Counts marked_{};
    RawCounters raw_{};
    bool started_ = false;
    bool lost_ = false;  // a counter jumped
    std::uint8_t jumped_ = 0;
};

}  // namespace haptic::rt
