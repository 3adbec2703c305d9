// From the wrapping counters of the board to the lengths of the strings.
//
// A board counts modulo 2^16 or 2^24 and is never cleared. The host extends a counter by the nearest difference.
// Lengths are relative: calibrate() says that the present counts belong to the rest lengths, that is to the grip held
// level at the centre.
// @source device-facts, section 2.3 (SH4 board), 3 (calibration).
#pragma once

#include <array>
#include <cstdint>

#include <haptic/device/variant.hpp>
#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include "device/kinematics.hpp"

namespace haptic::rt {

using RawCounters = std::array<std::uint32_t, kStrings>;  // modulo 2^counter_bits

class StringEncoders {
  public:
    /// maximum_speed: m/s, of a string; what is faster is not a hand. Ball-park 2.
    StringEncoders(const device::Variant& variant, double maximum_speed);

    /// Takes one latch of all counters, elapsed_ns after the last one that was taken. False if a string moved faster
    /// than maximum_speed: where the strings are is then not known any more, so that neither this latch nor any other
    /// is taken, and the lengths stay, until restart().
    bool update(const RawCounters& raw, std::int64_t elapsed_ns) HAPTIC_RT;

    /// The next latch is taken whatever it says, and counts as a calibration.
    void restart() HAPTIC_RT;

    /// The present counts are those of the rest lengths from now on.
    void calibrate() HAPTIC_RT;

    /// m. The first latch counts as a calibration, so that there is a pose from the start; it means little before one.
    [[nodiscard]] const StringArray& lengths() const HAPTIC_RT { return lengths_; }

    /// Largest movement of a string since the last calibrate() or mark(), m: whether the grip is held still.
    [[nodiscard]] double largest_movement() const HAPTIC_RT;
    void mark() HAPTIC_RT { marked_ = counts_; }

  private:
    using Counts = std::array<std::int64_t, kStrings>;

    double maximum_speed_;
    unsigned unused_bits_;            // of 32, above those that a counter has
    StringArray metres_per_count_{};  // signed
    StringArray rest_lengths_{};
    StringArray lengths_{};
    Counts counts_{};  // extended and negated
    Counts offsets_{};
    Counts marked_{};
    RawCounters raw_{};
    bool started_ = false;
    bool lost_ = false;  // a jump was seen
};

}  // namespace haptic::rt
